"""Draws the deadlines to a moment after the frames of a joystick, so that they need not wait.

The filter is designed for its tick: it stays within ``MOST`` of it. Nothing but the time of frames
that passed every check is looked at; without one the deadlines stay where they are.
"""

from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment

# A period may be so much shorter or longer than the tick.
MOST = 0.01
# From the joystick's frame to the deadline: the frame may come so late and is still read.
AFTER_NS = 1_200_000
# Frames of other joysticks that come so soon after another are waited for.
CLUSTER_NS = 1_000_000


class TickFollower:
    """Where the next deadline shall be.

    Args:
        deployment: one with ``tick``.
        controller: its inputs know when their last good frames came.
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
        self._joystick = controller.joysticks[tick.follow]
        self._others = [controller.joysticks[n] for n, ns in cycles.items() if ns == cycle_ns]
        self._cycle_ns = cycle_ns
        self._followed_ns: int | None = None

    def __call__(self, deadline_ns: int) -> int:
        """How much later the next deadline shall be, ns; negative for earlier.

        Args:
            deadline_ns: where it would be.
        """
        came_ns = self._joystick.received_ns
        if came_ns is None or came_ns == self._followed_ns:
            return 0
        self._followed_ns = came_ns
        error_ns = self._last_of_cluster(came_ns) + AFTER_NS - deadline_ns
        half_ns = self._apart_ns // 2
        error_ns = (error_ns + half_ns) % self._apart_ns - half_ns
        return max(-self._most_ns, min(self._most_ns, error_ns))

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
