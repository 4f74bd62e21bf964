"""The simulated valve's decoder of its frames, from the DBC and the deployment file alone.

A real valve does not know how the controller encodes. So this module uses nothing of
``canshaper.codec``: an error there moves the simulated crane as it would move a real one.
"""

from cantools.database.can import Signal

from canshaper.machine.deployment import Deployment

# Part of a step that the rounding of decimals may take.
_ROUNDING = 1e-6


class CommandReader:
    """Reader of the command of one axis.

    Args:
        deployment: names message and signals.
        axis: the axis of the valve.

    Attributes:
        zero: raw value at rest.
        step: change of the raw value for one step of the command, 1 or -1.
        full: number of steps at full speed.
    """

    __slots__ = ("_codes", "_counter", "_flags", "_negative", "_signal", "full", "step", "zero")

    def __init__(self, deployment: Deployment, axis: str) -> None:
        section = deployment.axes[axis].config
        valve, command = section.valve, section.command
        entry = deployment.messages.find(valve.message)
        assert not isinstance(entry, str)  # the valve's message is bound
        signals = {signal.name: signal for signal in entry[1].signals}
        # A gateway forwards the joystick's own frames: its section says what they mean.
        stick = deployment.config.joysticks[command.joystick]
        forwarded = deployment.config.gateway and valve.message == stick.message
        scaling = command if forwarded else valve
        self._signal = signal = signals[valve.signal]
        low, high = float(signal.minimum or 0.0), float(signal.maximum or 0.0)
        zero = scaling.zero or 0.0
        full = scaling.full or (min(zero - low, high - zero) if low < zero else high - zero)
        self.zero = round((zero - signal.offset) / signal.scale)
        self.full = int(full / abs(signal.scale) + _ROUNDING)
        self.step = -1 if (signal.scale < 0.0) != scaling.invert else 1
        self._negative = self._codes = self._flags = None
        if forwarded and command.negative:
            self._negative = signals[command.negative]
        if forwarded and (flags := command.flags):
            self._flags = signals[flags.neutral], signals[flags.positive], signals[flags.negative]
        if of := valve.direction:
            codes = {of.neutral: 0, of.positive: 1, of.negative: -1}
            self._codes = signals[of.signal], codes
        bound = deployment.axes[axis].valve_message.signals  # also single bits
        self._counter = next((s for s in bound if s.name == valve.alive_counter), None)

    def count(self, data: bytes) -> int:
        """Return the alive counter of a frame; 0 if the message has none."""
        return _raw(self._counter, data) if self._counter else 0

    def command(self, data: bytes) -> float:
        """Return the command of a frame, -1 .. 1; 0 if its bytes hold no valid command."""
        steps = self.step * (_raw(self._signal, data) - self.zero)
        if self._negative:
            back = self.step * (_raw(self._negative, data) - self.zero)
            if min(steps, back) != 0:
                return 0.0
            steps -= back
        elif self._codes or self._flags:
            steps = steps * self._direction(data) if steps > 0 else 0
        return steps / self.full if abs(steps) <= self.full else 0.0

    def _direction(self, data: bytes) -> int:
        """Return 1 or -1; 0 for neutral and for an invalid direction code."""
        if self._codes:
            signal, codes = self._codes
            return codes.get(_raw(signal, data), 0)
        assert self._flags
        set_ = [_raw(flag, data) == 1 for flag in self._flags]
        return set_[1] - set_[2] if sum(set_) == 1 else 0


def _raw(signal: Signal, data: bytes) -> int:
    """Return the raw value of a signal."""
    if signal.byte_order == "little_endian":
        value = int.from_bytes(data, "little") >> signal.start
    else:  # ``start`` is its highest bit
        last = signal.start // 8 * 8 + 7 - signal.start % 8 + signal.length
        value = int.from_bytes(data, "big") >> (8 * len(data) - last)
    value &= (1 << signal.length) - 1
    if signal.is_signed and value >> (signal.length - 1):
        value -= 1 << signal.length
    return value
