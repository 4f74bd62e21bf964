"""Robust shapers for a fleet: the drives, the choice among candidates, and what is refused."""

from pathlib import Path
from typing import Any

import pytest

from canshaper.campaign import fleet
from canshaper.campaign.fleet import (
    Candidate,
    FleetDesign,
    FleetRow,
    design_fleet,
    fitted,
    swinging,
)
from canshaper.campaign.measure import measured_drive
from canshaper.campaign.run import Source
from canshaper.campaign.statistics import Quantile
from canshaper.commissioning import robust_report
from canshaper.commissioning.filter_file import filter_changes
from canshaper.commissioning.robust import design_robust
from canshaper.design.parallel import Processes
from canshaper.errors import DesignError, UsageError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.cli.invocation import invoke
from tests.native.judge import needs_compiler
from tests.rigs.files import ROOT, machine_file

ROBUST = ROOT / "config/forwarder-robust.yaml"
SEEDS = range(1_000_000, 1_000_012)


@pytest.fixture
def compiler() -> None:
    needs_compiler()


@pytest.mark.slow
@pytest.mark.usefixtures("compiler")
def test_a_candidate_is_measured_as_a_campaign_measures_it() -> None:
    deployment = load_deployment(ROBUST)
    ranges = deployment.config.uncertainty
    rows = [measured_drive(deployment, seed, ranges) for seed in SEEDS]
    expected = [row["residual_deg"] for row in rows if not row["fault"]]
    left = fleet._left(Source.of(deployment, ranges), SEEDS, None)
    assert left == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
@pytest.mark.usefixtures("compiler")
def test_the_best_of_each_duration_is_judged_by_other_drives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The chosen designs are in force in what is judged; the worst twentieth is one drive here."""
    monkeypatch.setattr(fleet, "CHOOSING", SEEDS)
    monkeypatch.setattr(fleet, "JUDGING", range(2_000_000, 2_000_012))
    monkeypatch.setattr(fleet, "_MIDDLES", (0.3,))
    monkeypatch.setattr(fleet, "_RANGES", (0.1, 0.6))
    monkeypatch.setattr(fleet, "_DURATIONS", (1.0, 1.2, 1.3))
    deployment, done = load_deployment(ROBUST), list[float]()
    design = design_fleet(deployment, None, Processes(1), lambda part, _=None: done.append(part))
    assert done[-1] == 1.0 and len(done) == 8
    of = [row.candidate for row in design.rows]
    assert of[0] is None and of[1] and of[2] and of[3] and len(of) == 4  # 1.3 is past the tail
    assert (of[2].duration_s, of[3].duration_s) == pytest.approx((1.8, 2.16))
    assert of[1].low < of[2].low < of[2].high < of[1].high  # no length twice as wrong
    source = Source.of(deployment, deployment.config.uncertainty)
    assert design.asked.worst_deg == max(fleet._left(source, fleet.JUDGING, of[2]))
    machine = fitted(deployment, design.designs).axes["near_far"].config
    design_of = machine.filter.design()
    assert design_of and machine.sway
    assert design_of.length_range_pct == pytest.approx(10.0)
    assert machine.sway.length_m == pytest.approx(1.2 * (of[2].low + of[2].high) / 2.0, rel=1e-3)


@pytest.mark.usefixtures("compiler")
def test_a_shorter_tail_than_the_response_is_refused() -> None:
    with pytest.raises(UsageError, match=r"tail_s of the file, 2\.2 s, got 2\.5 s"):
        design_fleet(load_deployment(ROBUST), 2.5, Processes(1), lambda _, __=None: None)


@pytest.mark.parametrize("name", ["forwarder-load", "bridge-crane"])
def test_axes_with_several_filters_are_refused(name: str) -> None:
    with pytest.raises(DesignError, match=r"--fleet: axis \w+: expected one filter"):
        swinging(load_deployment(ROOT / f"config/{name}.yaml"))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ((), "expected --axis AXIS, or --fleet, got neither"),
        (("--fleet", "--axis", "slew"), "--fleet: expected only --duration"),
        (("--fleet", "--loads"), "--fleet: expected only --duration"),
    ],
)
def test_options_that_do_not_go_together(options: tuple[str, ...], text: str) -> None:
    result = invoke("robust", str(ROBUST), *options)
    assert result.exit_code == 2 and text in result.output


@pytest.mark.slow
def test_all_axes_are_written_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = machine_file(tmp_path, ROBUST)
    before = path.read_text(encoding="utf-8")
    deployment = load_deployment(path)
    designs = [design_robust(deployment, name, duration_s=1.0) for name in ("slew", "near_far")]
    row = FleetRow("", Candidate(0.9, 1.1, 1.0), 1.0, *[Quantile(1.0, None, None)] * 2)
    made = FleetDesign(designs, row, [row] * 3, 0)
    monkeypatch.setattr(fleet, "design_fleet", lambda *_: made)
    changes = filter_changes

    def fails(deployment: Deployment, axis: str, *given: Any, **own: Any) -> Any:
        if axis == "near_far":
            raise DesignError("no room")
        return changes(deployment, axis, *given, **own)

    with monkeypatch.context() as planted:
        planted.setattr(robust_report, "filter_changes", fails)
        assert invoke("robust", str(path), "--fleet", "--write").exit_code == 2
    assert path.read_text(encoding="utf-8") == before
    picture = tmp_path / "front.svg"
    done = invoke("robust", str(path), "--fleet", "--write", "--picture", str(picture))
    assert done.exit_code == 0 and "run-on, s" in picture.read_text(encoding="utf-8")
    now = load_deployment(path).axes
    lasts = [now[name].config.filter.design() for name in ("slew", "near_far")]
    assert [one and one.duration_s for one in lasts] == [1.0, 1.0]
