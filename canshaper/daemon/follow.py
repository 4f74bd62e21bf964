"""Draws the deadlines to a moment after the frames of a joystick, so that they need not wait.

The filter is designed for its tick: it stays within ``MOST`` of it. Nothing but the time of frames
that passed every check is looked at; without one the deadlines stay where they are. So they do with
a joystick whose cycle is not that of its DBC file: the deadlines could never keep up with it.
"""

import logging

from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import follow_fault

log = logging.getLogger("canshaper")

# Largest part by which a period may be shorter or longer than the tick.
MOST = 0.01
# From the joystick's frame to the deadline: the frame may come so late and is still read.
AFTER_NS = 900_000
# Its cycle is measured over so many frames; jitter of a frame hardly shows in their mean.
MEASURED = 50
# Largest error of the cycle: while it is followed, and until it is followed again.
OFF, AGAIN = 0.9 * MOST, 0.5 * MOST
# Frames of other joysticks that come so soon after another are waited for.
CLUSTER_NS = 1_000_000


class TickFollower:
    """Where the next deadline shall be.

    Args:
        deployment: one with ``tick``.
        controller: its inputs know when their last good frames came.

    Attributes:
        follows: whether the cycle of the joystick is one that can be followed.
    """

    def __init__(self, deployment: Deployment, controller: Controller) -> None:
        tick = deployment.config.tick
        assert tick is not None  # asked for such deployments only
        self._period_ns = deployment.config.tick_ms * 1_000_000
        self._most_ns = round(MOST * self._period_ns)
        cycles = {
            name: round((joystick.message.cycle_time or 0) * 1_000_000)
            for name, joystick in deployment.joysticks.items()
        }
        cycle_ns = cycles.pop(tick.follow)
        # With several frames a tick, the nearest of them is followed.
        self._apart_ns = min(cycle_ns, self._period_ns)
        self._name, self.follows = tick.follow, True
        self._joystick = controller.joysticks[tick.follow]
        self._others = [controller.joysticks[n] for n, ns in cycles.items() if ns == cycle_ns]
        self._cycle_ns = cycle_ns
        self._followed_ns: int | None = None
        self._frames, self._cycles, self._span_ns = 0, 0, 0  # since the cycle was measured last
        self._news = ""

    def __call__(self, deadline_ns: int) -> int:
        """How much later the next deadline shall be, ns; negative for earlier.

        Args:
            deadline_ns: where it would be.
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
        """Measure the cycle by the time between two frames, in which others may be lost."""
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
        """Return a line for the log where following has begun or ended."""
        news, self._news = self._news, ""
        return news

    def _last_of_cluster(self, came_ns: int) -> int:
        """When the last of the frames came that stand next to each other from this one on."""
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
    """Make the follower of a joystick; None where the ticks stay where they are.

    The command line may have put a bus on an interface that does not say when frames came.
    """
    tick = deployment.config.tick
    if tick is None:
        return None
    if fault := follow_fault(deployment.config, deployment.joysticks[tick.follow]):
        log.warning("tick=plain %s of %s", fault, tick.follow)
        return None
    return TickFollower(deployment, controller)
