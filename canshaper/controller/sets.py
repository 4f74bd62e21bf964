"""Sway data and filter of an axis in motion: by the load, and by the operator's choice."""

from collections.abc import Mapping, Sequence

from canshaper.config.schedule import Profile
from canshaper.config.schema import AxisConfig
from canshaper.inputs.value import ValueInput
from canshaper.machine.bound_axis import BoundAxis
from canshaper.machine.filters import parameter_sets
from canshaper.shaping.axis import Axis
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.sets import STEPS_BETWEEN, ParameterSet, at_position, position
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.sway import SwayModel

# Between two changes of one axis: a weight that trembles must not keep the loop busy.
LEAST_BETWEEN_NS = 100_000_000


class SetChooser:
    """Keeps sway data and filter of one axis at what load state and operator ask for.

    Args:
        bound: the axis.
        axis: its state machine, which is retuned.
        load_state: says what hangs on the crane, where there is a signal for it.
        profile: the operator's choice, where there is one.
        codes: its codes by name.

    Attributes:
        number: set in force: 0 the axis' own, then its sets, then each profile and its sets, in the
            order of the file; between two sets the nearer one.
    """

    def __init__(
        self,
        bound: BoundAxis,
        axis: Axis,
        load_state: ValueInput | None,
        profile: ValueInput | None,
        codes: Mapping[str, int],
    ) -> None:
        config = bound.config
        self.number = 0
        self._axis = axis
        self._load_state = load_state
        self._profile = profile
        self._rate = config.limits.slowest_per_s
        self._codes = {float(code): name for name, code in codes.items()}
        self._programs = programs(bound)
        self._first: dict[str, int] = {}
        number = 0
        for name, (_, sets) in self._programs.items():
            self._first[name] = number
            number += 1 + len(sets)
        self._now: tuple[str, int | None] = ("", None)
        self._not_before_ns = 0

    def update(self, now_ns: int) -> None:
        """Retune the axis where something has changed."""
        profile = self._profile.fresh(now_ns) if self._profile else None
        name = self._codes.get(profile, "") if profile is not None else ""
        if name not in self._programs:
            name = ""
        base, sets = self._programs[name]
        value = self._load_state.fresh(now_ns) if self._load_state and sets else None
        steps = None if value is None else position(sets, value)
        if (name, steps) == self._now or now_ns < self._not_before_ns:
            return
        self._now, self._not_before_ns = (name, steps), now_ns + LEAST_BETWEEN_NS
        chosen = base if steps is None else at_position(sets, steps)
        self.number = self._first[name]
        if steps is not None:
            self.number += 1 + round(steps / STEPS_BETWEEN)
        self._axis.retune(chosen.mode, lambda sway: self._shaper(chosen, sway))

    def _shaper(self, chosen: ParameterSet, sway: SwayModel) -> Shaper:
        return build_shaper(
            chosen.kind, sway.tick_s, sway, valve_rate_per_s=self._rate, **chosen.parameters
        )


def programs(bound: BoundAxis) -> Mapping[str, tuple[ParameterSet, Sequence[ParameterSet]]]:
    """What an axis can run, by the name of the profile ("" without one)."""
    config = bound.config
    assert config.sway is not None  # checked with the deployment
    mode = config.sway.mode()
    found: dict[str, tuple[ParameterSet, Sequence[ParameterSet]]] = {}
    parts: dict[str, AxisConfig | Profile] = {"": config, **config.profiles}
    for name, part in parts.items():
        base = ParameterSet(0.0, mode, part.filter.kind, part.filter.parameters())
        found[name] = (base, parameter_sets(part.gain_schedule))
    return found
