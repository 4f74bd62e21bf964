"""One pump for all axes: when the valves demand more oil than it delivers, they get less.

Flow is counted in full flows of one axis. Valves that share the flow behind their spools (LUDV) all
get the same part of their demand, whatever their loads. Plain load sensing keeps the pressure that
the heaviest load needs: when the flow is too small, the oil goes to the lighter loads, and the axis
with the heaviest load starves first. How far a pump limits a forestry crane: flow constraint in
time-optimal planning of a timber crane, arXiv 2506.20314.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from canshaper.errors import DesignError
from canshaper_sim.actuator import Actuator
from canshaper_sim.ranges import check_ranges

_ALLOWED = {
    "lag_s": (0.0, 1.0),
    "shares_flow": (0.0, 1.0),
    "slew_load": (0.0, 1.0),
    "near_far_load": (0.0, 1.0),
    "lift_load": (0.0, 1.0),
}
# A demand below this part of a full flow counts as none.
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True)
class PumpParameters:
    """How the pump follows the demand for oil, and how the valves share its flow."""

    lag_s: float = 0.0  # time constant with which it follows what is asked for
    shares_flow: float = 1.0  # 1: all valves get the same part; 0: plain load sensing
    # Pressures of the axes, fraction of the relief pressure: in plain load sensing they order them.
    slew_load: float = 0.8
    near_far_load: float = 0.5
    lift_load: float = 0.7

    def __post_init__(self) -> None:
        check_ranges("pump", self, _ALLOWED)
        if self.shares_flow not in (0.0, 1.0):
            raise DesignError(f"pump: shares_flow: expected 0 or 1, got {self.shares_flow:g}")


class Pump:
    """Pump and valves in motion: call ``advance`` before each step of the axes.

    Args:
        flow: largest flow of the pump, full axis flows.
        parameters: lag of the pump, and how the valves share its flow.
        axes: actuators that the pump drives, by name.
    """

    __slots__ = ("_by_load", "_delivered", "_flow", "_parameters")

    def __init__(
        self, flow: float, parameters: PumpParameters, axes: Mapping[str, Actuator]
    ) -> None:
        self._flow, self._parameters = flow, parameters
        # Joints have no load of their own here: the knuckle is as heavy as near-far.
        loads = {name: getattr(parameters, f"{name}_load", 0.5) for name in axes}
        self._by_load = [axes[name].valve for name in sorted(axes, key=lambda name: loads[name])]
        self._delivered = 0.0

    def advance(self, step_s: float) -> None:
        """Set each valve's ``supply`` for the next step by what all spools demand at present."""
        p, valves = self._parameters, self._by_load
        asked = [abs(valve.spool * valve.ease) for valve in valves]
        total = sum(asked)
        available = min(total, self._flow)
        if p.lag_s:
            change = (available - self._delivered) * -math.expm1(-step_s / p.lag_s)
            available = self._delivered = self._delivered + change
        if total <= available + _NOTHING:
            for valve in valves:
                valve.supply = valve.ease
        elif p.shares_flow:
            for valve in valves:
                valve.supply = available / total * valve.ease
        else:
            for valve, flow in zip(valves, asked, strict=True):
                part = min(1.0, available / flow) if flow > _NOTHING else 1.0
                valve.supply = part * valve.ease
                available -= part * flow
