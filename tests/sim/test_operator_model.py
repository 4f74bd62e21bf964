"""A person at the joysticks: late, imprecise, the same for the same seed, and able to work."""

import itertools
import math
from dataclasses import replace
from statistics import stdev

import pytest

from canshaper.errors import DesignError
from canshaper_sim.axes import NEAR_FAR, SLEW
from canshaper_sim.crane import Crane, CraneParameters
from canshaper_sim.grapple import Sway
from canshaper_sim.operator_model import Known, OperatorModel, Operators, Skill

TICK_S = 0.02
EXACT = Skill(timing_s=0.0, aim_m=0.0, motor=0.0, run_on=0.0)
FALL = tuple(math.exp(-number * TICK_S / 0.11) for number in range(40))
KNOWN = Known(1.0, FALL)
WITHIN = 0.3, 0.15
Seen = list[tuple[float, float]]
STILL: Seen = [(0.0, 0.0), (0.0, 0.0)]


def model(
    skill: Skill = EXACT, to: tuple[float, float] = (2.0, 1.0), seed: str = "1"
) -> OperatorModel:
    task = [(KNOWN, to_m) for to_m in to]
    return OperatorModel(skill, (0.8, 1.0), task, WITHIN, seed=seed, tick_s=TICK_S)


def held(person: OperatorModel, views: list[Seen]) -> list[list[float]]:
    """Joysticks of each tick in which this is seen."""
    joysticks = []
    for number, seen in enumerate(views, 1):
        person.see(number * TICK_S, seen)
        joysticks.append(person.joysticks)
    return joysticks


class Drive:
    """A person who moves a crane whose valves have no filter before them."""

    def __init__(
        self, skill: Skill, *, to: tuple[float, float], sway: Sway | None = None, seed: str = "1"
    ) -> None:
        parameters = CraneParameters(start_radius_m=5.0)
        self.crane = Crane(parameters, sway)
        modes = parameters.grapple.mode5, parameters.grapple.mode6
        full = 5.0 * parameters.slew_full_speed_rad_s, parameters.near_far_full_speed_m_s
        known = [Known(f, FALL, mode.omega_rad_s) for f, mode in zip(full, modes, strict=True)]
        task = [*zip(known, (5.0 * to[0], to[1]), strict=True)]
        self.person = OperatorModel(skill, (0.6, 1.0), task, WITHIN, seed=seed, tick_s=TICK_S)
        self.to, self.joysticks, self.off_m = to, [[0.0, 0.0]], list[float]()
        self.swing_deg = list[float]()

    def go(self, seconds: float) -> "Drive":
        crane = self.crane
        for number in range(1, round(seconds / TICK_S) + 1):
            crane.step(TICK_S, dict(zip((SLEW, NEAR_FAR), self.person.joysticks, strict=True)))
            state = crane.state
            out, across = crane.parameters.grapple.offset_m(state.theta5_rad, state.theta6_rad)
            at = 5.0 * state.theta1_rad, state.radius_m
            self.person.see(number * TICK_S, [(at[0], across), (at[1], out)])
            self.joysticks.append(self.person.joysticks)
            self.off_m.append(math.hypot(at[0] - 5.0 * self.to[0], at[1] - self.to[1]))
            self.swing_deg.append(math.degrees(math.hypot(state.theta5_rad, state.theta6_rad)))
        return self


@pytest.mark.parametrize("reaction_s", [0.1, 0.26, 0.5])
def test_what_is_seen_moves_the_hand_one_reaction_later_and_not_before(reaction_s: float) -> None:
    skill = replace(EXACT, reaction_s=reaction_s)
    late, change = round(reaction_s / TICK_S), 60
    near: Seen = [(1.99, 0.0), (0.99, 0.0)]
    ones = held(model(skill), [STILL] * 150)
    others = held(model(skill), [*[STILL] * change, *[near] * 90])
    assert not any(any(one) for one in ones[:late])
    assert all(ones[late])
    first = next(k for k, pair in enumerate(zip(ones, others, strict=True)) if pair[0] != pair[1])
    assert first == change + late


def test_the_same_seed_is_the_same_person_and_another_one_is_not() -> None:
    ones, same, other = (
        Drive(Skill(), to=(0.6, 6.0), seed=seed).go(8.0).joysticks for seed in ("1", "1", "2")
    )
    assert ones == same
    assert ones != other


def test_a_seed_aims_and_errs_alike_with_any_crane() -> None:
    slow = [(Known(0.5, (1.0,) * 50), 2.0), (Known(0.5, (1.0,) * 50), 1.0)]
    there: Seen = [(2.0, 0.0), (1.0, 0.0)]
    skill = Skill(aim_m=0.5, run_on=0.0, timing_s=0.0, motor=0.0)
    first = held(model(skill, seed="7"), [there] * 14)[-1]
    second = held(
        OperatorModel(skill, (0.8, 1.0), slow, WITHIN, seed="7", tick_s=TICK_S), [there] * 14
    )
    assert [math.copysign(1.0, one) for one in first] == [
        math.copysign(1.0, one) for one in second[-1]
    ]
    assert first[0] / first[1] == pytest.approx(second[-1][0] / second[-1][1])


def test_without_noise_the_seed_does_not_matter_and_the_tip_arrives() -> None:
    first, second = (Drive(EXACT, to=(0.6, 6.0), seed=seed).go(12.0) for seed in ("1", "2"))
    assert first.joysticks == second.joysticks
    assert first.off_m[-1] < 0.12
    assert first.swing_deg[-1] < 6.0
    assert max(first.swing_deg) > 12.0
    assert not first.crane.swung_over


@pytest.mark.parametrize("name", ["timing_s", "aim_m", "motor", "run_on"])
def test_every_noise_matters(name: str) -> None:
    calm = replace(EXACT, catch=1.0 if name == "motor" else 0.0)
    noisy = replace(calm, **{name: 0.3})
    exact, other = (Drive(one, to=(0.6, 6.0), seed="3").go(8.0).joysticks for one in (calm, noisy))
    assert other != exact


def test_both_axes_arrive_together() -> None:
    drive = Drive(replace(EXACT, catch=0.0), to=(0.6, 6.5)).go(6.0)
    ends = [
        next(k for k in range(60, 300) if not drive.joysticks[k][axis]) * TICK_S for axis in (0, 1)
    ]
    assert ends[0] == pytest.approx(ends[1], abs=0.15)
    assert max(map(max, drive.joysticks)) == pytest.approx(0.6)


def test_the_tip_stops_where_the_hand_meant_it_to() -> None:
    drive = Drive(replace(EXACT, catch=0.0, dead_m=0.5), to=(0.6, 6.0)).go(5.0)
    assert drive.person.taps == 0
    assert drive.off_m[-1] < 0.04
    for slower in ({"reaction_s": 0.5}, {"ramp_s": 0.6}):
        slow = replace(EXACT, catch=0.0, dead_m=0.5, **slower)
        assert Drive(slow, to=(0.6, 6.0)).go(5.0).off_m[-1] < 0.10


def test_a_hand_takes_its_time() -> None:
    joysticks = Drive(EXACT, to=(0.6, 6.0)).go(8.0).joysticks
    steps = [
        abs(b - a)
        for one, other in itertools.pairwise(joysticks)
        for a, b in zip(one, other, strict=True)
    ]
    assert max(steps) == pytest.approx(TICK_S / EXACT.ramp_s)


def swinging(skill: Skill) -> Drive:
    return Drive(skill, to=(0.0, 5.0), sway=Sway(math.radians(20.0), math.radians(-14.0))).go(7.0)


def test_a_swing_is_caught_and_the_tip_ends_where_it_was() -> None:
    caught, waited = swinging(EXACT), swinging(replace(EXACT, catch=0.0))
    assert waited.joysticks == [[0.0, 0.0]] * 351
    assert max(waited.swing_deg[-120:]) > 10.0
    assert max(caught.swing_deg[-100:]) < 4.5  # one plane after the other, two turns each
    assert caught.off_m[-1] < 0.05
    assert 4 <= caught.person.taps <= 6
    plane = Drive(EXACT, to=(0.0, 5.0), sway=Sway(theta6_rad=math.radians(20.0))).go(4.0)
    assert max(plane.swing_deg[-60:]) < 3.0
    assert plane.person.taps == 2


def tapped_m(skill: Skill, way_m: float, seed: str) -> float:
    """Way of the first correction after the tip was found to be that far off."""
    person = model(skill, (0.0, 0.0), seed)
    joysticks = held(person, [*[STILL] * 20, *[[(-way_m, 0.0), (0.0, 0.0)]] * 100])
    pushed = [one for one, _ in joysticks[20:]]
    first = next(k for k, one in enumerate(pushed) if one)
    taken = itertools.takewhile(bool, pushed[first:])
    return KNOWN.full_m_s * TICK_S * sum(taken)


def test_a_tap_errs_by_a_part_of_its_size() -> None:
    skill = replace(EXACT, motor=0.2)
    small, large = ([tapped_m(skill, way_m, f"{n}") for n in range(60)] for way_m in (0.2, 0.6))
    assert tapped_m(EXACT, 0.2, "1") == pytest.approx(0.2, abs=0.03)
    assert tapped_m(EXACT, 0.6, "1") == pytest.approx(0.6, abs=0.03)
    assert stdev(small) / 0.2 == pytest.approx(0.2, rel=0.35)
    assert stdev(large) / stdev(small) == pytest.approx(3.0, rel=0.3)


def test_an_error_within_reason_is_left_alone() -> None:
    for off_m, taps in ((0.09, 0), (0.12, 1)):
        person = model(EXACT, (0.0, 0.0))
        held(person, [*[STILL] * 20, *[[(off_m, 0.0), (0.0, 0.0)]] * 20])
        assert person.taps == taps, off_m


@pytest.mark.parametrize(("run_on", "taps"), [(0.0, 2), (0.3, 1)])
def test_what_is_not_known_well_enough_is_waited_for(run_on: float, taps: int) -> None:
    task = [(Known(1.0, (1.0,) * 100), 0.0), (KNOWN, 0.0)]
    skill = replace(EXACT, run_on=run_on)
    person = OperatorModel(skill, (0.8, 1.0), task, WITHIN, seed="1", tick_s=TICK_S)
    off: Seen = [(-0.6, 0.0), (0.0, 0.0)]
    held(person, [*[STILL] * 20, *[off] * 45, *[[(-0.4, 0.0), (0.0, 0.0)]] * 20])
    assert person.taps == taps


def test_one_decision_at_a_time() -> None:
    person = model(EXACT, (0.0, 0.0))
    views: list[Seen] = [STILL] * 20
    views += [[(0.3, 0.0), (0.0, 0.0)]] * 5 + [[(0.3, 0.0), (0.3, 0.0)]] * 40
    joysticks = held(person, views)
    begins = [next(k for k, one in enumerate(joysticks) if one[axis]) for axis in (0, 1)]
    assert (begins[1] - begins[0]) * TICK_S == pytest.approx(EXACT.reaction_s, abs=1.1 * TICK_S)


@pytest.mark.parametrize(
    ("name", "value", "bounds"),
    [
        ("reaction_s", 0.01, "0.05 .. 1.0"),
        ("motor", 1.5, "0.0 .. 1.0"),
        ("aim_m", math.nan, "0.0 .. 1.0"),
    ],
)
def test_a_skill_that_no_one_has_is_refused(name: str, value: float, bounds: str) -> None:
    with pytest.raises(DesignError, match=f"operator: {name}: expected {bounds}, got {value}"):
        Skill(**{name: value})


def test_a_novice_is_worse_in_all_and_only_one_of_them_catches() -> None:
    people = Operators()
    for name in ("reaction_s", "ramp_s", "timing_s", "aim_m", "motor", "run_on"):
        assert getattr(people.novice, name) > getattr(people.catching, name)
    assert (people.catching.catch, people.waiting.catch, people.novice.catch) == (1.0, 0.0, 0.0)
