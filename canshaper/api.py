"""A machine and its controller for one's own program: frames in, frames out, no I/O."""

from pathlib import Path
from typing import NamedTuple

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller as _Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import Event
from canshaper.shaping.states import Reason, State
from canshaper.shipped import deployment_path


def load_machine(file: str | Path) -> Deployment:
    """Load a deployment file with its DBC files, and check everything.

    Args:
        file: path of the deployment file, or the name of one that comes with canshaper.

    Returns:
        The machine. It does not change, and serves any number of controllers.

    Raises:
        ConfigError: the machine must not start; ``problems`` lists every fault with its file, line
            and allowed values.

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
        state: state of the axis.
        reason: reason of this state.
        output: velocity setpoint in the valve frames, -1 to 1 of full speed.
    """

    state: State
    reason: Reason
    output: float


class Controller:
    """The controller of a machine with its gate, as the daemon runs it, but without buses.

    The controller has no clock: the caller passes times in ns, of a clock that never goes back. One
    thread calls the controller. It calls ``tick`` every ``machine.config.tick_ms``: a valve that
    gets no frame for its timeout closes by itself.

    Args:
        machine: the result of ``load_machine``.

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
        self._gated = GatedController(self._inner)

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """Pass a received frame to the controller.

        Args:
            frame: any frame; the controller ignores frames that the machine does not use.
            arrived_ns: arrival of the frame, ns; not later than the next tick.

        Returns:
            On a gateway the frame to send at once to the other bus; else None.
        """
        return self._gated.receive(frame, arrived_ns)

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        """Compute the frames of one tick.

        Args:
            now_ns: time of the tick, ns.
            missed: number of ticks that were due since the last one and did not run.

        Returns:
            The frames to send now, in this order.
        """
        return list(self._gated.tick(now_ns, missed))

    def send_failed(self, frame: Frame) -> None:
        """Report that a frame of ``tick`` was not sent."""
        self._gated.send_failed(frame)

    def neutral_frames(self) -> list[Frame]:
        """Return a neutral frame for every valve: the last frames before the program ends."""
        return self._gated.neutral_frames()

    def axes(self) -> dict[str, AxisState]:
        """Return the state of each axis by name."""
        controls = self._inner.axes.items()
        return {
            name: AxisState(one.axis.state, one.reason, one.axis.output.setpoint)
            for name, one in controls
        }

    def events(self) -> list[Event]:
        """Return the events since the last call: changes of axis states, valves and other nodes.

        Returns:
            Events, oldest first; each has a ``text`` as in the log of the daemon.
        """
        happened, self._inner.events[:] = [*self._inner.events], []
        return happened
