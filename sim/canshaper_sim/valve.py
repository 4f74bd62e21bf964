"""One proportional valve with its actuator: from the value in the valve frame to a speed.

The command goes, in this order, through dead time (bus, valve electronics), the hysteresis of the
magnet, the deadband of the spool, the flow limit, the rate limit of the spool and the first-order
lag of oil and actuator. All values are fractions of the full speed of the axis. Between two changes
of the command the spool moves at a constant rate, so rate limit and lag are solved exactly for any
step length.

Without a pressure compensator the flow is that through an orifice, the root of the pressure left by
the load (Merritt, Hydraulic Control Systems, 1967): an axis moves slower against its load than
with it. A cylinder is faster towards its rod, by the ratio of its areas, 1.25 to 2
(``negative_gain``).
"""

import math
from collections import deque
from dataclasses import dataclass

from canshaper_sim.ranges import check_ranges

# Command changes nearer than this to the present are taken as present: rounding of summed steps.
_SAME_TIME_S = 1e-9

# name -> (lowest, highest) value that still describes a proportional valve on a mobile crane.
_ALLOWED = {
    "dead_time_s": (0.0, 0.2),
    "deadband": (0.0, 0.5),
    "negative_more_deadband": (-0.3, 0.3),
    "hysteresis": (0.0, 0.2),
    "negative_gain": (0.2, 2.0),
    "flow_limit": (0.05, 1.0),
    "load": (-0.9, 0.9),
    "load_per_t": (-0.9, 0.9),
    "rate_limit_1_s": (0.1, math.inf),  # inf: no rate limit
    "lag_s": (0.01, 1.0),  # a speed that jumps would need an infinite tip acceleration
}


@dataclass(frozen=True, slots=True)
class ValveParameters:
    """Behaviour of one valve; the defaults are a common mobile proportional valve."""

    dead_time_s: float = 0.0  # delay of the whole command
    deadband: float = 0.05  # fraction of full stroke in which no oil flows
    negative_more_deadband: float = 0.0  # additional deadband of negative commands
    hysteresis: float = 0.0  # play between command and spool, fraction of full stroke
    negative_gain: float = 1.0  # speed at full negative command, of that at full positive
    flow_limit: float = 1.0  # largest |speed|, fraction of full speed
    rate_limit_1_s: float = 5.0  # full speeds per second of spool travel
    lag_s: float = 0.1  # time constant; 0.05 .. 0.15 s is usual
    # Pressure that boom and empty grapple take in the positive direction, and help with in the
    # negative one; fraction of the supply's. With a pressure compensator it does not count: 0.
    load: float = 0.0
    load_per_t: float = 0.0  # increase of ``load`` for each tonne in the grapple

    def __post_init__(self) -> None:
        check_ranges("valve", self, _ALLOWED)

    def flow(self, command: float) -> float:
        """Return the steady-state speed for a command, behind deadband and flow limit; fractions.

        Just outside the deadband the flow starts at zero. A full positive command gives full flow,
        a negative one ``negative_gain`` times as much; a gain above 1 raises its flow limit too.
        """
        deadband = self.deadband
        if command < 0.0:
            deadband = max(0.0, deadband + self.negative_more_deadband)
        opening = (abs(command) - deadband) / (1.0 - deadband)
        if opening <= 0.0:
            return 0.0
        most = self.flow_limit
        if command < 0.0:
            opening *= self.negative_gain
            most *= max(1.0, self.negative_gain)
        return math.copysign(min(opening, most), command)

    def against(self, gripped_kg: float) -> float:
        """Return the pressure of the load in the positive direction, fraction of the supply's."""
        return self.load + self.load_per_t * gripped_kg / 1000.0


class Valve:
    """A valve in motion: call `set_command`, `advance` in steps, read `speed`, part of full speed.

    `supply` is the part of its demanded oil that the valve gets in the next step, 1 unless
    pump or load set it.
    `ease` is the factor of the load on the flow, 1 where a compensator cancels it.
    """

    __slots__ = (
        "_command",
        "_decay",
        "_decay_step_s",
        "_lag_s",
        "_pending",
        "_played",
        "_ramp_1_s",
        "_requested",
        "_target",
        "_time_s",
        "ease",
        "parameters",
        "speed",
        "spool",
        "supply",
    )

    def __init__(self, parameters: ValveParameters | None = None) -> None:
        self.parameters = parameters or ValveParameters()
        self.speed = 0.0  # achieved speed, fraction of full speed
        self.supply = self.ease = 1.0
        self._lag_s = self.parameters.lag_s
        self._ramp_1_s = self.parameters.rate_limit_1_s
        self._command = 0.0  # the last one
        self._played = 0.0  # command that the spool has followed, behind its play
        self.spool = 0.0  # flow after the rate limit, before the lag
        self._target = 0.0  # flow the spool moves to
        self._requested = 0.0  # flow of the last command, still in the dead time
        self._pending: deque[tuple[float, float]] = deque()  # (due time, flow)
        self._time_s = 0.0
        self._decay_step_s = 0.0  # step length for which _decay is valid
        self._decay = 1.0

    def set_command(self, command: float) -> None:
        """Hold `command`, -1 .. 1, from now on; the flow limit bounds larger values.

        Raises ValueError for a value that is not finite.
        """
        if command == self._command:
            return
        if not math.isfinite(command):
            raise ValueError(f"valve: command: expected a finite value, got {command}")
        self._command = command
        half = 0.5 * self.parameters.hysteresis
        self._played = min(max(self._played, command - half), command + half)
        flow = self.parameters.flow(self._played)
        if flow == self._requested:
            return
        self._requested = flow
        if self.parameters.dead_time_s > 0.0:
            self._pending.append((self._time_s + self.parameters.dead_time_s, flow))
        else:
            self._move_to(flow)

    def meet(self, load: float) -> None:
        """Reduce or raise the flow of the next step by this load (`ValveParameters.against`)."""
        forward = (self.spool or self._target) > 0.0
        self.supply = self.ease = math.sqrt(max(0.0, 1.0 - load if forward else 1.0 + load))

    def advance(self, step_s: float) -> tuple[float, float, float, float]:
        """Let step_s seconds pass, in two halves.

        Returns:
            Derivative of ``speed`` just after the start, full speeds per second; ``speed`` in the
            middle; ``speed`` at the end, and its derivative there.
        """
        speed, spool, half_s, lag_s = self.speed, self.spool, 0.5 * step_s, self._lag_s
        flow = spool * self.supply
        start_rate = (flow - speed) / lag_s
        if spool == self._target and not self._pending:  # nearly always: the lag alone is left
            decay = self._decay_over(half_s)
            middle = flow + (speed - flow) * decay
            self.speed = speed = flow + (middle - flow) * decay
            self._time_s = self._time_s + half_s + half_s
            return start_rate, middle, speed, (flow - speed) / lag_s
        self._pass(half_s)
        middle = self.speed
        self._pass(half_s)
        speed = self.speed
        return start_rate, middle, speed, (self.spool * self.supply - speed) / lag_s

    def _pass(self, step_s: float) -> None:
        """Let step_s seconds pass; commands whose dead time ends take effect within them."""
        rest_s = step_s
        while self._pending:
            due_s, flow = self._pending[0]
            wait_s = due_s - self._time_s
            if wait_s > rest_s + _SAME_TIME_S:
                break
            self._pending.popleft()
            if wait_s > _SAME_TIME_S:
                wait_s = min(wait_s, rest_s)
                self._follow(wait_s)
                self._time_s += wait_s
                rest_s -= wait_s
            self._move_to(flow)
        if rest_s > 0.0:
            self._follow(rest_s)
            self._time_s += rest_s

    def _move_to(self, flow: float) -> None:
        self._target = flow
        if self._ramp_1_s == math.inf:
            self.spool = flow

    def _follow(self, step_s: float) -> None:
        """Move the spool at its rate to its target and the speed behind it: tau v' = flow - v."""
        spool, supply = self.spool, self.supply
        gap = self._target - spool
        if gap == 0.0:
            flow = supply * spool
            self.speed = flow + (self.speed - flow) * self._decay_over(step_s)
            return
        ramp = math.copysign(self._ramp_1_s, gap)
        arrival_s = gap / ramp
        # The lag answers a ramp, once settled, with the same ramp one time constant late.
        late = supply * ramp * self._lag_s
        offset = self.speed - supply * spool + late
        if arrival_s > step_s:
            self.spool = spool + ramp * step_s
            self.speed = supply * self.spool - late + offset * self._decay_over(step_s)
            return
        self.spool = self._target
        flow = supply * self._target
        at_arrival = flow - late + offset * math.exp(-arrival_s / self._lag_s)
        rest_decay = math.exp((arrival_s - step_s) / self._lag_s)
        self.speed = flow + (at_arrival - flow) * rest_decay

    def _decay_over(self, step_s: float) -> float:
        if step_s != self._decay_step_s:  # steps are nearly always equally long
            self._decay_step_s = step_s
            self._decay = math.exp(-step_s / self._lag_s)
        return self._decay
