"""The speed of an axis as its machine reports it: from one bus and one sender, or it is silence."""

from cantools.database.can import Message, Signal

from canshaper.codec.frame import Frame
from canshaper.codec.identifier import NULL, group_of
from canshaper.codec.layout import CLASSICAL_BYTES, FD_LENGTHS, Layout
from canshaper.codec.protection import UNPROTECTED
from canshaper.codec.signals import find_signal
from canshaper.config.inputs import Input
from canshaper.errors import ConfigError, Problem
from canshaper.inputs.value import ValueInput, measurable
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput

# Feedback older than that says nothing of the axis, which must not go on unseen.
SILENT_MS = 500


class SpeedFeedback:
    """Feedback of the speed of one axis.

    Where it is the ``feedback`` of the axis in the deployment, all that stands there holds: bus,
    source, counter, checksum. Any other message has to come on the bus of the valve.

    Args:
        deployment: the machine.
        axis: name of the axis.
        message: name of the message.
        signal: its signal.

    Raises:
        ConfigError: no such message or signal, or one that cannot be measured with.
    """

    def __init__(self, deployment: Deployment, axis: str, message: str, signal: str) -> None:
        bus = deployment.config.buses[deployment.axes[axis].config.valve.bus]
        feedback = _find(deployment, message, signal, fd=bus.fd)
        self._bound = bound = _bound(deployment, axis, message, feedback[0], signal)
        self._input = ValueInput(bound, feedback[1], *measurable(feedback[1]))
        self._keys = frozenset(bound.keys)
        _, can_id, _ = bound.key
        self._source = None if can_id & 0xFF == NULL else can_id & 0xFF

    @property
    def value(self) -> float:
        """The last speed that counted, in the unit of the DBC."""
        return self._input.value

    def valid(self, now_ns: int) -> bool:
        """Whether there is a speed now: neither silence nor an error nor what is no number."""
        measured_ns = self._input.measured_ns
        return measured_ns is not None and now_ns - measured_ns <= SILENT_MS * 1_000_000

    def receive(self, frame: Frame, arrived_ns: int) -> None:
        """Take a frame, where it is one of this message."""
        if self._mine(frame):
            self._input.receive(frame.data, arrived_ns)

    def _mine(self, frame: Frame) -> bool:
        if not self._bound.by_group:
            return frame[:3] in self._keys
        bus, can_id, _ = self._bound.key
        if frame.bus != bus or not frame.extended or group_of(frame.can_id) != group_of(can_id):
            return False
        source = frame.can_id & 0xFF
        if self._source is None:
            self._source = source  # the first that is received, and no other any more
        return source == self._source


def _find(deployment: Deployment, message: str, signal: str, *, fd: bool) -> tuple[Message, Signal]:
    match = deployment.messages.find(message)
    if isinstance(match, str):
        raise ConfigError([Problem("command line", None, "--speed", match)])
    definition = find_signal(match[1], signal)
    if definition is None:
        names = ", ".join(s.name for s in match[1].signals)
        raise _problem(
            deployment, f"expected a signal of {message}, got {signal!r}; there are {names}"
        )
    if match[1].is_multiplexed():
        raise _problem(deployment, f"{message} is multiplexed; nothing can be read from it")
    lengths = FD_LENGTHS if fd else range(CLASSICAL_BYTES + 1)
    if match[1].length not in lengths:
        text = f"{message}: expected the length of a frame, {lengths[-1]} bytes at most"
        text += f", got {match[1].length}"
        raise _problem(deployment, text)
    return match[1], definition


def _bound(
    deployment: Deployment, axis: str, name: str, message: Message, signal: str
) -> BoundInput:
    of_axis = deployment.axes[axis].feedback
    if of_axis and (of_axis.config.message, of_axis.config.signal) == (name, signal):
        return of_axis
    bus = deployment.axes[axis].config.valve.bus
    config = Input(bus=bus, message=name, timeout_ms=SILENT_MS)
    return BoundInput(config, message, Layout(message), UNPROTECTED, None)


def _problem(deployment: Deployment, text: str) -> ConfigError:
    return ConfigError([Problem(str(deployment.path), None, "--speed", text)])
