"""The command of an axis in its valve message: grid steps to raw values and back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from cantools.database.can import Signal

from canshaper.codec.sent import SentMessage
from canshaper.codec.signals import full_scale, valve_steps


class Direction(Protocol):
    """Signals that carry the direction of a magnitude."""

    def put(self, raw: dict[str, Any], sign: int) -> None:
        """Write a sign: 0 for neutral, 1 or -1."""

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the sign; None where the code is no direction."""


@dataclass(frozen=True, slots=True)
class DirectionCodec:
    """Signal that carries the direction of a magnitude, as the valve state of ISO 11783-7 does.

    Attributes:
        signal: its name.
        codes: raw codes of neutral, of positive and of negative commands, in this order.
    """

    signal: str
    codes: tuple[int, int, int]

    def put(self, raw: dict[str, Any], sign: int) -> None:
        """Write a sign: 0 for neutral, 1 or -1."""
        raw[self.signal] = self.codes[sign]  # the last one is that of -1

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the sign; None where the code is no direction."""
        return dict(zip(self.codes, (0, 1, -1), strict=True)).get(raw[self.signal])


@dataclass(frozen=True, slots=True)
class FlagsCodec:
    """Three flags that carry the direction of a magnitude, as joysticks of J1939-71 do.

    Attributes:
        signals: names of the flags of neutral, of positive and of negative, in this order.
    """

    signals: tuple[str, str, str]

    def put(self, raw: dict[str, Any], sign: int) -> None:
        """Write a sign: 0 for neutral, 1 or -1."""
        for name, of in zip(self.signals, (0, 1, -1), strict=True):
            raw[name] = int(of == sign)

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the sign; None where the flags are no direction."""
        signs = [of for n, of in zip(self.signals, (0, 1, -1), strict=True) if raw[n] == 1]
        return signs[0] if len(signs) == 1 else None


class ValveCodec:
    """Command of one axis: a whole number of steps, to its signals and back.

    Args:
        message: the message it is sent in.
        signal: the command; with a direction its magnitude.
        direction: where the direction stands, if not by the sign.
        negative: magnitude of negative commands, where they have a signal of their own, which is
            like that of the positive ones.
        also: signals that carry the same in another resolution.

    Attributes:
        steps: steps from zero to full command.
    """

    def __init__(
        self,
        message: SentMessage,
        signal: Signal,
        direction: Direction | None = None,
        also: Sequence[Signal] = (),
        negative: Signal | None = None,
    ) -> None:
        self.message = message
        self.steps = _steps(signal)
        self._signal = signal.name
        self._zero, self._sign = _zero(signal), 1 if signal.scale > 0 else -1
        self._direction = direction
        self._negative = negative.name if negative else None
        self._also = [(s.name, _zero(s), _steps(s) * (1 if s.scale > 0 else -1)) for s in also]
        self._plain = not (direction or negative or also)  # nearly every valve
        self.put(message.start, 0)

    def put(self, raw: dict[str, Any], steps: int) -> None:
        """Put a command into the message.

        Args:
            raw: raw values of the message, by signal.
            steps: the command; negative for the negative direction.

        Raises:
            ValueError: it is beyond full command.
        """
        if not -self.steps <= steps <= self.steps:
            raise ValueError(f"valve command: expected up to +-{self.steps} steps, got {steps}")
        if self._plain:
            raw[self._signal] = self._zero + self._sign * steps
            return
        size = steps
        if self._direction is not None:
            self._direction.put(raw, (steps > 0) - (steps < 0))
            size = abs(steps)
        elif self._negative is not None:
            size = max(steps, 0)
            raw[self._negative] = self._zero + self._sign * max(-steps, 0)
        raw[self._signal] = self._zero + self._sign * size
        for name, zero, full in self._also:
            raw[name] = zero + round(full * size / self.steps)

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the steps of a command from raw values; None where they are no command."""
        steps = self._sign * (int(raw[self._signal]) - self._zero)
        if self._direction is not None:
            sign = self._direction.read(raw)
            if sign is None or steps < 0:
                return None
            steps *= sign
        elif self._negative is not None:
            back = self._sign * (int(raw[self._negative]) - self._zero)
            if min(steps, back) != 0:
                return None
            steps -= back
        return steps if abs(steps) <= self.steps else None


def _steps(signal: Signal) -> int:
    return valve_steps(full_scale(signal), abs(signal.scale))


def _zero(signal: Signal) -> int:
    return round(-signal.offset / signal.scale)
