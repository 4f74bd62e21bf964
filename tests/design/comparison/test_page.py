"""The page has what the command gives: the row of what we recommend, and the limits."""

import re

import pytest

from canshaper.cli.verbs.compare import _WORKS
from canshaper.design.comparison.manoeuvres import candidates, manoeuvres
from canshaper.design.comparison.measure import Outcome, measure
from canshaper.design.comparison.summary import least
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.files import ROOT

PAGE = (ROOT / "docs" / "comparison.md").read_text("utf-8")
ROBUST = "robust 1.8 s ±15 %"


def table(head: str) -> str:
    """A block of the page, by how its heads begin."""
    block = re.search(rf"```text\n(?:[^`]*\n)? {head} [^`]*```", PAGE)
    assert block is not None
    return block[0]


def cells(head: str, name: str) -> list[str]:
    line = next(line for line in table(head).splitlines() if line.strip().startswith(name + " "))
    return line.replace(name, "", 1).split()


@pytest.fixture(scope="module")
def deployment() -> Deployment:
    return load_deployment(ROOT / "config" / "forwarder-robust.yaml")


@pytest.fixture(scope="module")
def outcomes(deployment: Deployment) -> list[Outcome]:
    """Of every manoeuvre, at the right length."""
    robust = next(c for c in candidates(deployment) if c.name == ROBUST)
    return [measure(deployment, robust, task, 0) for task in manoeuvres()]


@pytest.mark.slow
def test_residuals(outcomes: list[Outcome]) -> None:
    works = dict.fromkeys(o.work for o in outcomes)
    worst = [max(o.residual_deg for o in outcomes if o.work == work) for work in works]
    given = dict(zip(_WORKS.values(), cells("left, deg", ROBUST), strict=True))
    assert given == dict(zip(works, (f"{deg:.{1 + (deg < 9.995)}f}" for deg in worst), strict=True))


@pytest.mark.slow
def test_what_is_felt(outcomes: list[Outcome]) -> None:
    slew, near_far = (o for o in outcomes if o.work == "pulse")
    felt = (near_far.rise_s, near_far.stop_s, near_far.run_on_m, slew.run_on_m)
    row = cells("felt", ROBUST)
    assert row[1:5] == [f"{value:.2f}" for value in felt]
    assert row[6] == f"{max(o.peak_deg for o in outcomes if o.work == 'both'):.1f}"
    assert row[7].partition("/")[2] == str(max(o.movements or 0 for o in outcomes))


@pytest.mark.slow
def test_limits(deployment: Deployment) -> None:
    head = "limit, % of swing"
    rows = {}
    for limit in least(deployment):
        parts = (limit.ours_15, limit.no_dip_15, limit.any_15, limit.no_dip_30)
        rows[f"{limit.duration_s:.1f} s"] = [f"{100 * part:.1f}" for part in parts]
    given = re.findall(r"^ (\d\.\d s) ", table(head), re.MULTILINE)
    assert len(given) >= 4
    assert {name: cells(head, name) for name in given} == {name: rows[name] for name in given}
