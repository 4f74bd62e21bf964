"""Sway sensors of a machine: what they send of the tool's swing, and every fault they have."""

import math
import random
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from cantools.database.can import Message

from tests.faults.axis import Axis
from tests.faults.inputs import Key
from tests.faults.sealed import with_header_p4
from tests.faults.swing import Swing

if TYPE_CHECKING:
    from tests.faults.fault import Fault

Values = dict[str, float]
DEGREE = math.pi / 180.0
NOISE = 0.1  # degrees, or degrees a second
DELAYED = 15  # frames


class SensorMessage:
    """A message with measurements: by signal the axis, whether of its rate, and the sign."""

    def __init__(self, key: Key, message: Message) -> None:
        self.key, self.message = key, message
        self.cycle_ms: int = message.cycle_time or 0
        self.node: int | None = None
        self.data_id: int | None = None  # of AUTOSAR E2E profile 4, where it has that
        self._count = 0
        self.signals: dict[str, tuple[Axis, bool, int]] = {}

    def values(self, swings: Mapping[str, Swing], rng: random.Random) -> Values:
        """Measurements now, in the unit of the DBC."""
        values = dict.fromkeys((s.name for s in self.message.signals), 0.0)
        for name, (axis, rate, sign) in self.signals.items():
            swing = swings[axis.name]
            shown = (swing.rate if rate else swing.angle) / DEGREE
            values[name] = sign * shown + rng.gauss(0.0, NOISE)
        return values

    def data(self, values: Values) -> bytes:
        """The frame: what is beyond a signal's range stays at its end."""
        held = {}
        for signal in self.message.signals:
            low, high = signal.minimum, signal.maximum
            assert low is not None
            assert high is not None
            held[signal.name] = min(max(values[signal.name], low), high)
        data = self.message.encode(held, strict=False)
        return data if self.data_id is None else self._sealed(data, self.data_id)

    def _sealed(self, data: bytes, data_id: int) -> bytes:
        """Put the header of profile 4 in front, with the next counter."""
        self._count += 1
        return with_header_p4(len(data), self._count, data_id, data[12:])


def _all(change: Callable[["Fault", float], float]) -> Callable[["Fault", Values], Values]:
    return lambda fault, values: {name: change(fault, value) for name, value in values.items()}


def _frozen(fault: "Fault", values: Values) -> Values:
    kept: Values = fault.memory.setdefault("values", values)
    return kept


def _delayed(fault: "Fault", values: Values) -> Values:
    queue: list[Values] = fault.memory.setdefault("queue", [])
    queue.append(values)
    return queue[max(0, len(queue) - 1 - DELAYED)]


def _offset(fault: "Fault", value: float) -> float:
    by = fault.memory.setdefault("by", fault.rng.choice((-8.0, -2.0, 2.0, 8.0)))
    return value + float(by)


# On what is measured.
VALUES: dict[str, Callable[["Fault", Values], Values]] = {
    "sensor: frozen": _frozen,
    "sensor: delayed": _delayed,
    "sensor: negated": _all(lambda _fault, value: -value),
    "sensor: twice": _all(lambda _fault, value: 2.0 * value),
    "sensor: offset": _all(_offset),
    "sensor: noise": _all(lambda fault, value: value + fault.rng.gauss(0.0, 5.0)),
    "sensor: jumps": _all(lambda fault, v: v + fault.rng.choice((0, 0, 0, -30.0, 30.0))),
}
# On the bytes of its frame.
BYTES: dict[str, Callable[["Fault", bytes], bytes | None]] = {
    "sensor: no frames": lambda _fault, _data: None,
    "sensor: anything": lambda fault, data: fault.rng.randbytes(len(data)),
    "sensor: no value": lambda _fault, data: b"\xff" * len(data),
    "sensor: wrong length": lambda fault, data: data[: fault.rng.randrange(len(data) or 1)],
}
KINDS = (*VALUES, *BYTES)


def sensor_frame(
    sensor: SensorMessage, values: dict[str, Any], active: "Iterable[Fault]"
) -> bytes | None:
    """The frame of a sensor with the faults that act on it; None where none is sent."""
    faults = [*active]
    for fault in faults:
        if change := VALUES.get(fault.kind):
            values = change(fault, dict(values))
    data: bytes | None = sensor.data(values)
    for fault in faults:
        if data is not None and (spoil := BYTES.get(fault.kind)):
            data = spoil(fault, data)
    return data
