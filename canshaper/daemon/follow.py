"""Moves the deadlines to just after the frames of a joystick, so that no frame waits for a tick.

The filter is designed for a fixed tick, so a period stays within ``MOST`` of it. Only frames that
passed every check count. Without such frames the deadlines are not moved. Nor are they moved if the
cycle of the joystick differs too much from its DBC file: they could never keep up with it.
"""

import logging

from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import follow_fault

log = logging.getLogger("canshaper")

# Largest relative difference between a period and the tick.
MOST = 0.01
# Time from a joystick frame to the deadline, so that a frame that is late by less is still read.
AFTER_NS = 900_000
# Number of frames over which the cycle is measured; their mean hardly shows the jitter of one.
MEASURED = 50
# Largest relative error of the cycle to continue to follow a joystick, and to follow it again.
OFF, AGAIN = 0.9 * MOST, 0.5 * MOST
# A deadline waits for a frame of another joystick that comes so soon after the previous frame.
CLUSTER_NS = 1_000_000


class TickFollower:
    """Moves the next deadline towards the frames of a joystick.

    Args:
        deployment: a deployment with ``tick``.
        controller: its inputs know when their last good frames arrived.

    Attributes:
        follows: whether the deadlines follow the joystick: its cycle is near that of the DBC file.
    """

    def __init__(self, deployment: Deployment, controller: Controller) -> None:
        tick = deployment.config.tick
        assert tick is not None  # called for such deployments only
        self._period_ns = deployment.config.tick_ms * 1_000_000
        self._most_ns = round(MOST * self._period_ns)
        cycles = {
            name: round((joystick.message.cycle_time or 0) * 1_000_000)
            for name, joystick in deployment.joysticks.items()
        }
        cycle_ns = cycles.pop(tick.follow)
        # If several frames come in a tick, the deadline follows the nearest one.
        self._apart_ns = min(cycle_ns, self._period_ns)
        self._name, self.follows = tick.follow, True
        self._joystick = controller.joysticks[tick.follow]
        self._others = [controller.joysticks[n] for n, ns in cycles.items() if ns == cycle_ns]
        self._cycle_ns = cycle_ns
        self._followed_ns: int | None = None
        self._frames, self._cycles, self._span_ns = 0, 0, 0  # since the last measured cycle
        self._news = ""

    def __call__(self, deadline_ns: int) -> int:
        """Return by how many ns to move the next deadline; negative for earlier, 0 for not.

        Args:
            deadline_ns: time of that deadline.
        """
        came_ns = self._joystick.received_ns
        if came_ns is None or came_ns == self._followed_ns:
            return 0
        if self._followed_ns is not None:
            self._measure(came_ns - self._followed_ns)
        self._followed_ns = came_ns
        if not self.follows:
            return 0
        error_ns = self._last_of_cluster(came_ns) + AFTER_NS - deadline_ns
        half_ns = self._apart_ns // 2
        error_ns = (error_ns + half_ns) % self._apart_ns - half_ns
        return max(-self._most_ns, min(self._most_ns, error_ns))

    def _measure(self, passed_ns: int) -> None:
        """Add the time between two frames, some lost between; set ``follows`` by their mean."""
        self._frames += 1
        self._cycles += max(1, round(passed_ns / self._cycle_ns))
        self._span_ns += passed_ns
        if self._frames < MEASURED:
            return
        cycle_ns = self._span_ns / self._cycles
        self._frames = self._cycles = self._span_ns = 0
        off = abs(cycle_ns / self._cycle_ns - 1.0)
        follows = off <= (OFF if self.follows else AGAIN)
        if follows is self.follows:
            return
        self.follows = follows
        self._news = (
            f"tick={'follows' if follows else 'plain'} joystick={self._name}"
            f" cycle_ms={cycle_ns / 1e6:.2f} expected={self._cycle_ns / 1e6:g}"
        )

    def news(self) -> str:
        """Return a line for the log if ``follows`` changed since the last call; else empty."""
        news, self._news = self._news, ""
        return news

    def _last_of_cluster(self, came_ns: int) -> int:
        """Return when the last frame of other joysticks comes that follows this one closely.

        Each of them comes ``CLUSTER_NS`` after the one before at most, as in the last cycle.
        """
        cycle_ns = self._cycle_ns
        offsets = [
            (other_ns - came_ns) % cycle_ns
            for other in self._others
            if (other_ns := other.received_ns) is not None and came_ns - other_ns < cycle_ns
        ]
        last_ns = 0
        for offset_ns in sorted(offsets):
            if offset_ns - last_ns > CLUSTER_NS:
                break
            last_ns = offset_ns
        return came_ns + last_ns


def tick_follower(deployment: Deployment, controller: Controller) -> TickFollower | None:
    """Make the follower of a deployment with ``tick``; log and return None if it cannot follow.

    The command line may have put its bus on an interface without time stamps of frames.
    """
    tick = deployment.config.tick
    assert tick is not None  # called for such deployments only
    if fault := follow_fault(deployment.config, deployment.joysticks[tick.follow]):
        log.warning("tick=plain %s of %s", fault, tick.follow)
        return None
    return TickFollower(deployment, controller)
