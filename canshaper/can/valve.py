"""Valve messages: the grid steps of axes to the bytes of a frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cantools.database.can import Signal

from canshaper.can.codecs import Sender
from canshaper.can.frame import Frame, new_frame
from canshaper.can.signals import valve_steps


class ValveMessage:
    """A message with the commands of one axis, or of several.

    Attributes:
        sender: its place on the bus.
        raw: raw value of every signal, which the axes change.
    """

    def __init__(self, sender: Sender) -> None:
        self.sender = sender
        self.raw: dict[str, Any] = dict(sender.fields.start)
        self._bus, self._id, self._extended = sender.key
        self._protect = sender.protector.protect

    def frame(self) -> Frame:
        """The next frame, protected, with what its axes have put in."""
        data = self._protect(self.raw)
        return new_frame(Frame, (self._bus, self._id, self._extended, data))


@dataclass(frozen=True, slots=True)
class DirectionCodec:
    """Signal that tells the direction of a magnitude, as the valve state of ISO 11783-7 does.

    Attributes:
        signal: its name.
        codes: raw codes of neutral, of positive and of negative commands, in this order.
    """

    signal: str
    codes: tuple[int, int, int]


class ValveCodec:
    """Command of one axis: a whole number of steps, to its signals and back.

    Args:
        message: the message it is sent in.
        signal: the command; with a direction its magnitude.
        direction: where the direction is told, if not by the sign.
        also: signals that tell the same in another resolution.

    Attributes:
        steps: steps from zero to full command.
    """

    def __init__(
        self,
        message: ValveMessage,
        signal: Signal,
        direction: DirectionCodec | None = None,
        also: Sequence[Signal] = (),
    ) -> None:
        self.message = message
        self.steps = _steps(signal)
        self._raw = message.raw
        self._signal = signal.name
        self._zero, self._sign = _zero(signal), 1 if signal.scale > 0 else -1
        self._direction = direction
        self._also = [(s.name, _zero(s), _steps(s) * (1 if s.scale > 0 else -1)) for s in also]
        self.put(0)

    def put(self, steps: int) -> None:
        """Put a command into the message.

        Args:
            steps: the command; negative for the negative direction.

        Raises:
            ValueError: it is beyond full command.
        """
        if not -self.steps <= steps <= self.steps:
            raise ValueError(f"valve command of {steps} steps, allowed is +-{self.steps}")
        raw, size = self._raw, steps
        if self._direction is not None:
            raw[self._direction.signal] = self._direction.codes[
                0 if steps == 0 else 1 if steps > 0 else 2
            ]
            size = abs(steps)
        raw[self._signal] = self._zero + self._sign * size
        for name, zero, full in self._also:
            raw[name] = zero + round(full * size / self.steps)

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Steps of a command from the raw values of a message; None where it is no command."""
        steps = self._sign * (int(raw[self._signal]) - self._zero)
        if self._direction is not None:
            codes = dict(zip(self._direction.codes, (0, 1, -1), strict=True))
            sign = codes.get(raw[self._direction.signal])
            if sign is None or steps < 0:
                return None
            steps *= sign
        return steps if abs(steps) <= self.steps else None


def _steps(signal: Signal) -> int:
    return valve_steps(signal.maximum or 0.0, abs(signal.scale))


def _zero(signal: Signal) -> int:
    return round(-signal.offset / signal.scale)
