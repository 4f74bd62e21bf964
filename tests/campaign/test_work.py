"""An operator at work: places, practice, moves and their bounds."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from canshaper.campaign.work import AXES, LIMIT_S, LOADS, SetUp, do_work, learn, places
from canshaper.config.filters import filter_of
from canshaper.design.comparison.manoeuvres import Candidate
from canshaper.errors import CampaignError
from canshaper_sim.crane import CraneParameters
from canshaper_sim.operator_model import Known, Skill
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.recorder import Recorder
from tests.campaign.work import known, source, works
from tests.rigs.files import CONFIG
from tests.rigs.swing import crane_of


def test_places_are_those_of_the_seed_and_within_reach() -> None:
    crane = CraneParameters()
    assert places(crane, "3") == places(crane, "3") != places(crane, "4")
    for slew, radius_m in places(crane, "3")[1::2]:
        assert 0.95 < abs(slew) < 2.19
        assert 4.0 <= radius_m <= 7.0
    short = changed_parameters(["radius_max_m=5", "slew_max_rad=0.5", "slew_min_rad=-0.5"])
    for slew, radius_m in places(short, "3"):
        assert abs(slew) <= 0.5
        assert radius_m <= 5.0


@pytest.mark.parametrize(("bypass", "run_on_s"), [(True, 0.16), (False, 0.95)])
def test_practice_teaches_speed_and_run_on(run_on_s: float, *, bypass: bool) -> None:
    for one, full in zip(known(bypass=bypass), (0.5, 1.0), strict=True):
        assert one.full_m_s == pytest.approx(full, rel=0.02)
        assert 0.02 * sum(one.fall) == pytest.approx(run_on_s, abs=0.02)
        assert one.fall[0] == 1.0
        assert all(-0.01 < later <= sooner for sooner, later in pairwise(one.fall))


def test_a_machine_whose_nodes_have_to_boot_is_waited_for() -> None:
    learned = learn(source(file=str(CONFIG / "canopen-forwarder.yaml")), SetUp(bypass=True))
    assert [one.full_m_s for one in learned] == pytest.approx([0.5, 1.0], rel=0.02)


def test_a_crane_that_cannot_do_the_work_is_refused() -> None:
    joints, still = str(CONFIG / "forwarder-joints.yaml"), ("slew_min_rad=0", "slew_max_rad=0")
    with pytest.raises(
        CampaignError, match="yaml: expected axes slew and near_far, got slew, lift"
    ):
        learn(source(file=joints), SetUp(bypass=True))
    with pytest.raises(CampaignError, match="expected slew to move when its joystick is at 50%"):
        learn(source(*still), SetUp(bypass=True))


def test_moves_are_done_and_anti_sway_swings_less() -> None:
    raw, shaped = (do_work(source(), works(bypass=bypass), moves=2) for bypass in (True, False))
    assert raw == do_work(source(), works(bypass=True), moves=2)
    for one, other, load in zip(raw, shaped, LOADS, strict=True):
        assert one.load == other.load == load
        assert one.done
        assert other.done
        assert one.taps > other.taps
        assert one.peak_deg > 1.5 * other.peak_deg
        assert 3.0 < other.seconds < 12.0
        assert 0.0 < other.waiting_s < other.seconds - 2.0
        assert -0.01 < other.beyond_m < 0.3


def test_a_tip_that_passes_the_target_is_not_there() -> None:
    unaware = tuple(one._replace(fall=(0.0,)) for one in known(bypass=True))
    work = works(bypass=True, seed="2", speed=1.0, within=(0.2, math.inf))
    recorder, work = Recorder(source().load()), replace(work, known=unaware)
    (move,) = do_work(source(), work, recorder.receive, moves=1)
    slew, radius_m = places(CraneParameters(), work.seed)[1]
    target = radius_m * math.cos(slew), radius_m * math.sin(slew)
    end = round((1.5 + move.seconds) / 0.02)
    tips = crane_of(recorder.recording()).tip_m[:end]
    inside = [math.dist(tip, target) < 0.21 for tip in tips]
    assert all(inside[-15:])
    assert any(inside[:-25])
    assert not all(inside[-25:])


def test_between_two_moves_the_joysticks_are_neutral_and_the_swing_is_damped_out() -> None:
    recorder, work = Recorder(source().load()), works(bypass=True, within=(0.8, math.inf))
    first, _ = do_work(source(), work, recorder.receive, moves=2)
    recording = recorder.recording()
    end, sway_deg = round((1.5 + first.seconds) / 0.02), crane_of(recording).sway_deg
    assert max(sway_deg[end - 60 : end]) > 8.0
    assert max(sway_deg[end + 65 : end + 75]) < 5.0
    for axis in AXES:
        assert recording.axes[axis].joystick[end + 2 : end + 74] == [0.0] * 72


def test_a_log_swings_on_where_an_empty_grapple_hangs_still() -> None:
    waits = replace(works(bypass=True), skill=Skill(catch=0.0))
    empty, log = do_work(source(), waits, moves=2)
    assert empty.seconds < 24.0 < log.seconds
    assert log.taps == 0


def test_where_only_the_tip_counts_anti_sway_is_slower() -> None:
    raw, shaped = (
        do_work(source(), works(bypass=bypass, speed=1.0, within=(0.3, math.inf)), moves=1)[0]
        for bypass in (True, False)
    )
    assert raw.seconds < shaped.seconds - 1.0
    assert raw.peak_deg > 25.0


def test_the_crane_is_the_one_of_set_and_a_lean_in_the_wind_is_no_swing() -> None:
    slow, windy = source("slew_full_speed_rad_s=0.2"), source("wind.speed_m_s=20", "wind.drag_m2=3")
    assert do_work(slow, works(bypass=False), moves=1)[0].seconds > 9.0
    assert do_work(windy, works(bypass=False), moves=1)[0].done


def test_work_ends_where_the_grapple_swings_over() -> None:
    wild = source("slew_full_speed_rad_s=1.5")
    moves = do_work(wild, works(bypass=True, speed=1.0), moves=4)
    swung = next(number for number, one in enumerate(moves) if not one.done)
    assert 90.0 < moves[swung].peak_deg < 120.0
    assert all((one.done, one.seconds) == (False, LIMIT_S) for one in moves[swung:])
    assert moves[3].peak_deg == 90.0


def run_on_s(learned: tuple[Known, ...]) -> float:
    return 0.02 * sum(learned[1].fall)


def test_a_profile_works_by_its_gain_schedule() -> None:
    load = source(file=str(CONFIG / "forwarder-load.yaml"))
    precise, rough = (run_on_s(learn(load, SetUp(one))) for one in ("precise", "rough"))
    own = run_on_s(known(bypass=False))  # that of an empty grapple is the same
    assert rough < 0.85 * own < own < 0.95 * precise


def test_another_filter_works() -> None:
    zv = Candidate("ZV", {axis: filter_of("zv") for axis in AXES})
    learned = learn(source(), SetUp("ZV", candidate=zv))
    assert run_on_s(learned) < 0.85 * run_on_s(known(bypass=False))
