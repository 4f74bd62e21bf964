"""How long a loop may stand still: one rule for the daemon and all else that ticks as it does."""

from collections.abc import Callable

from canshaper.bus.clock import boottime_ns
from canshaper.machine.deployment import Deployment

# A frame may leave so late after it was computed, where a tick is shorter than that: a program
# that is held up now and then for some milliseconds goes on.
LEAST_LEAVE_NS = 10_000_000
NEVER_NS = 1 << 63  # later than any time of a clock


def longest_gap_ns(deployment: Deployment) -> int:
    """Longest time between two ticks, in ns, after which an axis in motion may go on.

    After the shortest age limit of an input, what waits in the sockets must not look fresh; after
    the shortest timeout of a valve, that valve has closed, and would get full speed in one step.
    A valve that gets a frame in every n-th tick only may have waited for n - 1 ticks before.
    """
    tick_ms = deployment.config.tick_ms
    limits = [one.config.timeout_ms for one in deployment.stopping_inputs]
    limits += [
        axis.config.valve.timeout_ms - (axis.period_ticks - 1) * tick_ms
        for axis in deployment.axes.values()
    ]
    return min(limits) * 1_000_000


class Standstill:
    """Whether a loop has stood still for too long since its last tick.

    Args:
        deployment: its machine.
        before: that of the deployment before, whose last tick counts here too.

    Attributes:
        clock: the time when a frame is about to leave, ns; a test may replace it.
        limit_ns: longest time between two ticks.
        last_ns: time of the last tick that was made: all its frames were sent in time.
        until_ns: what is computed in this tick may leave until then.
    """

    def __init__(self, deployment: Deployment, before: "Standstill | None" = None) -> None:
        self.clock: Callable[[], int] = boottime_ns
        self.limit_ns = longest_gap_ns(deployment)
        self.last_ns: int = before.last_ns if before else NEVER_NS
        self.until_ns = 0
        self._leave_ns = max(deployment.config.tick_ms * 1_000_000, LEAST_LEAVE_NS)

    def late(self) -> bool:
        """Whether it is too late for what was computed in this tick to leave."""
        return self.clock() > self.until_ns

    def over(self, now_ns: int) -> bool:
        """Whether the loop stood still for too long until now; a tick begins, or is made up."""
        latest_ns = self.last_ns + self.limit_ns
        self.until_ns = min(latest_ns, now_ns + self._leave_ns)
        return now_ns > latest_ns
