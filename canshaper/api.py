"""A machine and its controller for a program of one's own: frames in, frames out, no I/O."""

from pathlib import Path
from typing import NamedTuple

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller as _Controller
from canshaper.controller.guarded import Guarded
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import Event
from canshaper.shaping.states import Reason, State
from canshaper.shipped import deployment_path


def load_machine(file: str | Path) -> Deployment:
    """Load a deployment file with its DBC files, and check the whole.

    Args:
        file: path of the deployment file, or the name of one that comes with canshaper.

    Returns:
        The machine. It does not change, and serves any number of controllers.

    Raises:
        ConfigError: it must not start; ``problems`` has everything that is wrong, with file, line
            and what is allowed.

    Examples:
        >>> from canshaper import load_machine
        >>> machine = load_machine("forwarder.yaml")
        >>> list(machine.axes), machine.config.tick_ms
        (['slew', 'near_far', 'lift'], 20)
    """
    return load_deployment(deployment_path(file))


class AxisState(NamedTuple):
    """State, reason and output of an axis.

    Attributes:
        state: its state.
        reason: why it is in it.
        output: velocity that the valve frames carry, -1 to 1 of the full speed.
    """

    state: State
    reason: Reason
    output: float


class Controller:
    """The controller of a machine with its gate: what the daemon runs, without buses.

    It has no clock: times are the caller's, in ns, of one that never goes back. It belongs to one
    thread. ``tick`` has to be called every ``machine.config.tick_ms``; where a valve gets no frame
    for its timeout it closes by itself.

    Args:
        machine: what ``load_machine`` gave.

    Examples:
        Without a joystick every valve gets neutral, and the axes wait:

        >>> from canshaper import Controller, load_machine
        >>> controller = Controller(load_machine("forwarder.yaml"))
        >>> frames = controller.tick(now_ns=0)
        >>> [(hex(frame.can_id), frame.data.hex()) for frame in frames][:2]
        [('0x200', '0001'), ('0x201', '0001')]
        >>> controller.axes()["slew"].state.name
        'NEUTRAL_WAIT'
    """

    def __init__(self, machine: Deployment) -> None:
        self.machine = machine
        self._inner = _Controller(machine)
        self._guarded = Guarded(self._inner)

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """Hand in a frame that came from a bus.

        Args:
            frame: any frame; those that are not of the machine are passed over.
            arrived_ns: when it arrived; not after the tick that follows.

        Returns:
            What it leaves as on the other bus of a gateway, to be sent at once; else None.
        """
        return self._guarded.receive(frame, arrived_ns)

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        """Compute one tick.

        Args:
            now_ns: time of the tick.
            missed: ticks that should have come since the last one, and did not.

        Returns:
            The frames to send now, in this order.
        """
        return list(self._guarded.tick(now_ns, missed))

    def send_failed(self, frame: Frame) -> None:
        """Report that a frame of ``tick`` did not get onto its bus."""
        self._guarded.send_failed(frame)

    def neutral_frames(self) -> list[Frame]:
        """A neutral frame for every valve: the last thing to send before the program ends."""
        return self._guarded.neutral_frames()

    def axes(self) -> dict[str, AxisState]:
        """Return the state of each axis by its name."""
        runners = self._inner.axes.items()
        return {name: AxisState(one.axis.state, one.reason, one.axis.sent) for name, one in runners}

    def events(self) -> list[Event]:
        """Return the events since the last call: changes of states, valves, other nodes.

        Returns:
            Events, oldest first; each has a ``text`` as in the log of the daemon.
        """
        happened, self._inner.events[:] = [*self._inner.events], []
        return happened
