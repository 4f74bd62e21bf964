"""Robust shapers for a fleet: the drives, the choice among candidates, and what is refused."""

from pathlib import Path
from typing import Any

import pytest

from canshaper.campaign import fleet, fleet_candidates
from canshaper.campaign.fleet import design_fleet
from canshaper.campaign.fleet_candidates import (
    BOX,
    FILE,
    FLEET,
    GFF,
    OTHER,
    ROBUST,
    Candidate,
    Driven,
    FleetFilter,
    fitted,
    swinging,
)
from canshaper.campaign.measure import measured_drive
from canshaper.campaign.run import Source
from canshaper.cli.verbs import compare
from canshaper.commissioning.origins import filter_changes
from canshaper.commissioning.robust import design_robust
from canshaper.design.comparison.manoeuvres import with_candidate
from canshaper.design.parallel import Processes
from canshaper.errors import DesignError, UsageError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.cli.invocation import invoke
from tests.native.judge import needs_compiler
from tests.rigs.files import ROOT, machine_file

PATH = ROOT / "config/forwarder-robust.yaml"
WITH_GFF = ROOT / "config/forwarder-gff.yaml"
SEEDS = range(1_000_000, 1_000_012)


@pytest.fixture
def compiler() -> None:
    needs_compiler()


@pytest.mark.slow
@pytest.mark.usefixtures("compiler")
def test_a_candidate_is_measured_as_a_campaign_measures_it() -> None:
    deployment = load_deployment(PATH)
    ranges = deployment.config.uncertainty
    rows = [measured_drive(deployment, seed, ranges) for seed in SEEDS]
    expected = [row["residual_deg"] for row in rows if not row["fault"]]
    driven = fleet._driven(Source.of(deployment, ranges), SEEDS, {}, None)
    assert driven.left_deg == pytest.approx(expected, abs=1e-9)
    assert driven.run_on_s == [row["run_on_s"] for row in rows if not row["fault"]]


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """The worst twentieth is one drive of them."""
    monkeypatch.setattr(fleet, "CHOOSING", SEEDS)
    for module in (fleet, fleet_candidates):
        monkeypatch.setattr(module, "JUDGING", range(2_000_000, 2_000_012))
    monkeypatch.setattr(fleet, "_MIDDLES", (0.3,))
    monkeypatch.setattr(fleet, "_RANGES", {ROBUST: (0.1, 0.6), GFF: (0.2,)})


@pytest.fixture
def designs(monkeypatch: pytest.MonkeyPatch) -> list[Candidate]:
    """Candidates of each design that is made."""
    made = list[Candidate]()

    def designed(deployment: Deployment, name: str, candidate: Candidate) -> FleetFilter:
        made.append(candidate)
        return fleet_candidates.designed(deployment, name, candidate)

    monkeypatch.setattr(fleet, "designed", designed)
    return made


def judged(deployment: Deployment, candidate: Candidate | None) -> float:
    source = Source.of(deployment, deployment.config.uncertainty)
    return fleet._driven(source, fleet.JUDGING, {}, candidate).worst_deg


@pytest.mark.slow
@pytest.mark.usefixtures("compiler", "few")
def test_the_best_of_each_duration_is_judged_by_other_drives(
    monkeypatch: pytest.MonkeyPatch, designs: list[Candidate]
) -> None:
    """The chosen designs are in force in what is judged, and each is made once."""
    monkeypatch.setattr(fleet, "_DURATIONS", (1.0, 1.2, 1.3))
    deployment, done = load_deployment(PATH), list[float]()
    asked, rows = design_fleet(
        deployment, ROBUST, None, Processes(1), lambda part, _=None: done.append(part)
    )
    assert done[-1] == 1.0 and len(done) == 8
    assert len(designs) == 2 * len({*designs}) == 2 * (4 + 1)
    of = [row.candidate for own in rows.values() for row in own]
    assert of[0] is None and of[1] and of[2] and of[3] and len(of) == 4  # 1.3 is past the tail
    assert (of[2].duration_s, of[3].duration_s) == pytest.approx((1.8, 2.16))
    assert of[1].low < of[2].low < of[2].high < of[1].high  # no length twice as wrong
    assert asked is rows[FLEET][0]
    assert asked.worst_deg == judged(deployment, of[2])
    machine = fitted(deployment, asked.filters).axes["near_far"].config
    design_of = machine.filter.design()
    assert design_of and machine.sway
    assert design_of.length_range_pct == pytest.approx(10.0)
    assert machine.sway.length_m == pytest.approx(1.2 * (of[2].low + of[2].high) / 2.0, rel=1e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("compiler", "few")
def test_gff_keeps_the_run_on_and_stands_next_to_robust_shapers(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What no poles keep is left out; what is written is what was judged, tail included."""
    monkeypatch.setattr(fleet, "_DURATIONS", (0.8, 1.0))
    path = machine_file(tmp_path, WITH_GFF)
    deployment = load_deployment(path)
    asked, rows = design_fleet(deployment, GFF, 2.3, Processes(1), lambda _, __=None: None)
    assert [len(own) for own in rows.values()] == [1, 1, 1, 1]  # none settles in 1.84 s
    assert asked.worst_deg == judged(deployment, asked.candidate)
    fleet_candidates.write_fleet(deployment, asked.filters, "tune")
    assert judged(load_deployment(path), None) == asked.worst_deg
    of = load_deployment(path).axes["slew"].config.filter.design()
    assert of and of.objective and of.objective.max_run_on_s == 2.3 and of.objective.third_pole
    said = fleet_candidates.verdict(asked, rows)
    robust_deg = rows[OTHER][0].worst_deg
    assert f"with robust shapers for the fleet {robust_deg:.1f}" in said
    assert ("buys nothing" in said) == (robust_deg <= asked.worst_deg)


@pytest.mark.slow
@pytest.mark.usefixtures("compiler", "few")
def test_a_run_on_that_no_poles_keep_is_refused() -> None:
    with pytest.raises(UsageError, match=r"^--max-run-on: no poles of .* run-on at most 1\.5 s"):
        design_fleet(load_deployment(WITH_GFF), GFF, 1.5, Processes(1), lambda _, __=None: None)


@pytest.mark.slow
@pytest.mark.usefixtures("compiler", "few")
def test_a_comparison_has_rows_of_the_file_and_of_the_fleet() -> None:
    deployment = load_deployment(PATH)
    own, made = compare._for_fleet(deployment, 1)
    of_file, of_fleet = (with_candidate(deployment, one).axes for one in (own, made))
    for name in ("slew", "near_far"):
        was, is_now = deployment.axes[name].config, of_fleet[name].config
        assert of_file[name].config.filter == was.filter != is_now.filter
        assert of_file[name].config.sway == was.sway != is_now.sway


def test_a_comparison_of_ropes_has_none() -> None:
    done = invoke("compare", str(ROOT / "config/bridge-crane.yaml"), "--fleet")
    assert done.exit_code == 2 and "--fleet: expected slew and near-far" in done.output


@pytest.mark.usefixtures("compiler")
def test_a_shorter_tail_than_the_response_is_refused() -> None:
    with pytest.raises(UsageError, match=r"tail_s of the file, 2\.2 s, got 2\.5 s"):
        design_fleet(load_deployment(PATH), ROBUST, 2.5, Processes(1), lambda _, __=None: None)


@pytest.mark.parametrize("name", ["forwarder-load", "bridge-crane"])
def test_axes_with_several_filters_are_refused(name: str) -> None:
    with pytest.raises(DesignError, match=r"--fleet: axis \w+: expected one filter"):
        swinging(load_deployment(ROOT / f"config/{name}.yaml"))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("robust",), "expected --axis AXIS, or --fleet, got neither"),
        (("robust", "--fleet", "--axis", "slew"), "--fleet: expected only --duration"),
        (("robust", "--fleet", "--loads"), "--fleet: expected only --duration"),
        (("tune",), "expected --axis AXIS, or --fleet, got neither"),
        (("tune", "--fleet", "--axis", "slew"), "--fleet: expected only --max-run-on"),
        (("tune", "--fleet", "--q", "1"), "--fleet: expected only --max-run-on"),
        (("tune", "--fleet", "--json"), "--fleet: expected only --max-run-on"),
    ],
)
def test_options_that_do_not_go_together(options: tuple[str, ...], text: str) -> None:
    result = invoke(options[0], str(PATH), *options[1:])
    assert result.exit_code == 2 and text in result.output


@pytest.mark.slow
def test_all_axes_are_written_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = machine_file(tmp_path, PATH)
    before = path.read_text(encoding="utf-8")
    deployment = load_deployment(path)
    made = [
        FleetFilter(name, design_robust(deployment, name, duration_s=1.0).section, {})
        for name in ("slew", "near_far")
    ]
    row = Driven(Candidate(ROBUST, 0.9, 1.1, 1.0), made, [1.0], [1.0])
    rows = {FILE: [Driven(None, (), [1.0], [1.0])], BOX: [], FLEET: [row], OTHER: []}
    monkeypatch.setattr(fleet, "design_fleet", lambda *_: (row, rows))
    changes = filter_changes

    def fails(deployment: Deployment, axis: str, *given: Any, **own: Any) -> Any:
        if axis == "near_far":
            raise DesignError("no room")
        return changes(deployment, axis, *given, **own)

    with monkeypatch.context() as planted:
        planted.setattr(fleet_candidates, "filter_changes", fails)
        assert invoke("robust", str(path), "--fleet", "--write").exit_code == 2
    assert path.read_text(encoding="utf-8") == before
    picture = tmp_path / "front.svg"
    done = invoke("robust", str(path), "--fleet", "--write", "--picture", str(picture))
    assert done.exit_code == 0 and "run-on, s" in picture.read_text(encoding="utf-8")
    now = load_deployment(path).axes
    lasts = [now[name].config.filter.design() for name in ("slew", "near_far")]
    assert [one and one.duration_s for one in lasts] == [1.0, 1.0]
