"""The chooser of sway data and filter by itself: what it takes, when, and with which number."""

from collections.abc import Callable, Sequence

import pytest

from canshaper.controller.parameter_sets import SetChooser, profile_by_number, programs
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.registry import ParameterSet, build_shaper
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.sway import SwayMode, SwayModel
from tests.controller.set_files import DBC, FAST, FAST_SETS, SETS, SLEW, YAML
from tests.rigs.forwarder import Make

MS = 1_000_000
TICK_S = 0.02
MODE = SwayMode.from_period(2.356, 0.038)
LIMITS = "limits: { deadband_pct: 5, rise_per_s: 5, fall_per_s: 5, tail_s: 2.0, stop_s: 2.0,"


class Watched(ShapedAxis):
    """An axis that is where the test says, and keeps the filters that it gets."""

    def __init__(self, bound: BoundAxis) -> None:
        sway, filter_ = SwayModel(MODE, TICK_S), bound.config.filter
        shaper = build_shaper(filter_.kind, TICK_S, sway, **filter_.parameters())
        super().__init__(TICK_S, bound.config.limits.output_limits(), sway=sway, shaper=shaper)
        self.at_rest = True
        self.retuned: list[Shaper] = []
        self.past: Sequence[float] = ()

    @property
    def neutral(self) -> bool:
        return self.at_rest

    def retune(
        self,
        mode: SwayMode,
        shaper_for: Callable[[SwayModel], Shaper],
        past: Sequence[float] = (),
    ) -> None:
        self.past = past

        def kept(sway: SwayModel) -> Shaper:
            self.retuned.append(shaper_for(sway))
            return self.retuned[-1]

        super().retune(mode, kept, past)

    def move(self, demand: float, applied: float) -> None:
        """In motion, with this demand and output."""
        self.at_rest, self.demand, self.output.applied = False, demand, applied


class Choice:
    """The profile that the test chooses."""

    def __init__(self) -> None:
        self.chosen = ""

    def name(self, _now_ns: int) -> str:
        return self.chosen


class Bench:
    """A chooser, its axis and the choice."""

    def __init__(self, bound: BoundAxis) -> None:
        self.axis, self.choice = Watched(bound), Choice()
        self.chooser = SetChooser(bound, self.axis, None, self.choice)

    def changes(self, now_ns: int, profile: str) -> bool:
        """Whether this choice changes the axis at this moment."""
        self.choice.chosen, before = profile, len(self.axis.retuned)
        self.chooser.update(now_ns)
        return len(self.axis.retuned) > before


@pytest.fixture
def slew(changed_rig: Make) -> Callable[..., BoundAxis]:
    """The slew axis with two loads and two profiles, and with pieces of its section replaced."""

    def made(*changes: tuple[str, str]) -> BoundAxis:
        section = SLEW + SETS
        for old, new in changes:
            assert old in section, old
            section = section.replace(old, new)
        rig = changed_rig(yaml=YAML | {SLEW: section}, dbc=DBC)
        return rig.deployment.axes["slew"]

    return made


def test_each_number_has_the_profile_that_its_set_is_of(slew: Callable[..., BoundAxis]) -> None:
    assert profile_by_number(slew()) == ["", "", "", "fast", "calm"]
    with_loads = slew((FAST, FAST_SETS))
    assert profile_by_number(with_loads) == ["", "", "", "fast", "fast", "fast", "calm"]


def test_without_profiles_no_number_has_one(changed_rig: Make) -> None:
    """With loads and without."""
    loads = {SLEW: SLEW + SETS.partition("    profiles:")[0]}
    axes = changed_rig(yaml={**YAML, **loads}, dbc=DBC).deployment.axes
    assert len(programs(axes["slew"])[""][1]) == 2
    assert profile_by_number(axes["slew"]) == []
    assert profile_by_number(axes["near_far"]) == []


def test_the_programs_are_those_of_the_file(slew: Callable[..., BoundAxis]) -> None:
    by_name = programs(slew())
    assert list(by_name) == ["", "fast", "calm"]
    base, sets = by_name[""]
    assert base == ParameterSet(0.0, MODE, "gff", {"a1": 0.708, "a2": 0.12})
    assert [(one.at, one.parameters) for one in sets] == [
        (0.0, {"a1": 0.7, "a2": 0.12}),
        (1000.0, {"a1": 0.9, "a2": 0.2}),
    ]
    assert by_name["fast"] == (ParameterSet(0.0, MODE, "gff", {"a1": 0.5, "a2": 0.06}), [])


def test_what_is_chosen_already_changes_nothing(slew: Callable[..., BoundAxis]) -> None:
    """The axis begins with its own filter."""
    bench = Bench(slew())
    for now_ns in (0, 200 * MS, 400 * MS):
        assert not bench.changes(now_ns, "")
    bench.axis.move(1.0, 0.0)
    assert not bench.changes(600 * MS, "")
    assert bench.chooser.number == 0


def test_the_first_change_may_come_at_the_time_0(slew: Callable[..., BoundAxis]) -> None:
    bench = Bench(slew())
    assert bench.changes(0, "fast")
    assert bench.chooser.number == 3


def test_100_ms_lie_between_two_changes(slew: Callable[..., BoundAxis]) -> None:
    bench = Bench(slew())
    assert bench.changes(0, "fast")
    assert not bench.changes(20 * MS, "calm")
    assert not bench.changes(100 * MS - 1, "calm")
    assert bench.chooser.number == 3
    assert bench.changes(100 * MS, "calm")
    assert bench.chooser.number == 4


def waits(bench: Bench, profile: str, now_ns: int) -> bool:
    """Whether this choice changes the axis 200 ms after it is made, and not before."""
    early = [bench.changes(now_ns + after, profile) for after in (0, 100 * MS, 200 * MS - 1)]
    return early == [False] * 3 and bench.changes(now_ns + 200 * MS, profile)


def test_in_steady_motion_a_choice_waits_200_ms(slew: Callable[..., BoundAxis]) -> None:
    """However long the motion was steady before."""
    bench = Bench(slew())
    bench.axis.move(-0.6, -0.59)
    for n in range(50):
        assert not bench.changes(n * 20 * MS, "")
    assert waits(bench, "fast", 1000 * MS)


def test_a_profile_in_a_press_changes_no_swing(slew: Callable[..., BoundAxis]) -> None:
    """The pendulum is the same."""
    bench = Bench(slew())
    bench.axis.move(0.5, 0.5)
    bench.axis.output.commanded = True
    assert bench.changes(0, "fast") or bench.changes(200 * MS, "fast")
    assert bench.axis.past == ()


def test_a_fiftieth_off_the_speed_is_steady(slew: Callable[..., BoundAxis]) -> None:
    bench = Bench(slew())
    bench.axis.move(0.02, 0.0)
    assert waits(bench, "fast", 0)


def test_more_than_a_fiftieth_off_the_speed_is_not_steady(slew: Callable[..., BoundAxis]) -> None:
    bench = Bench(slew())
    bench.axis.move(0.6, 0.579)
    assert not any(bench.changes(n * 20 * MS, "fast") for n in range(50))
    bench.axis.move(0.6, 0.581)
    assert not bench.changes(1179 * MS, "fast")
    assert bench.changes(1180 * MS, "fast")  # 200 ms after the last one that was off


@pytest.mark.parametrize(("applied", "steady"), [(0.482, True), (0.518, True), (0.521, False)])
def test_an_axis_with_a_limit_is_steady_at_that(
    changed_rig: Make, applied: float, *, steady: bool
) -> None:
    """Half of full speed is all that a full press gives."""
    limited = LIMITS.replace("{ ", "{ max_pct: 50, ")
    rig = changed_rig(yaml={**YAML, LIMITS: limited}, dbc=DBC)
    bench = Bench(rig.deployment.axes["slew"])
    bench.axis.move(1.0, applied)
    assert waits(bench, "fast", 0) is steady


def test_a_limit_aware_filter_is_made_for_the_rate_of_the_valve(
    changed_rig: Make,
) -> None:
    """The poles that it has for a quick valve are too quick for this one."""
    robust = "kind: robust, tick_ms: 20, taps: [0.25, 0.5, 0.25]"
    other = "kind: robust, tick_ms: 20, taps: [0.5, 0.5]"
    slew = SLEW.replace("kind: gff, a1: 0.708, a2: 0.12", robust)
    slew += f"\n    profiles: {{ fast: {{ filter: {{ {other} }} }} }}"
    profile = {"codes: { balanced: 0, fast: 1, calm: 2 }": "codes: { balanced: 0, fast: 1 }"}
    slow = LIMITS.replace("rise_per_s: 5", "rise_per_s: 1")
    changed = {**YAML, SLEW: slew, **profile, LIMITS: slow}
    bench = Bench(changed_rig(yaml=changed, dbc=DBC).deployment.axes["slew"])
    assert bench.changes(0, "fast")
    (shaper,) = bench.axis.retuned
    assert isinstance(shaper, LimitAware)
    pole = -1.3 * MODE.omega_rad_s**0.5
    assert shaper.gff.poles_rad_s == pytest.approx((pole, pole))
