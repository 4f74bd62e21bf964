"""Valve messages of a deployment, bound to the DBC: one for each axis, or shared by several."""

import re
from dataclasses import dataclass, field

from cantools.database.can import Message, Signal

from canshaper.can.database import DbcFile
from canshaper.can.inputs import InputBinder
from canshaper.can.signals import (
    command_fault,
    magnitude_range,
    raw_limits,
    set_point_fault,
    symmetrical_range,
)
from canshaper.can.valve import DirectionCodec, ValveCodec, ValveMessage
from canshaper.config.schema import Cia408, DirectionCodes, Valve
from canshaper.config.source import Place

# A valve hears of a stop no sooner than with its next frame.
SLOWEST_VALVE_MS = 200
# Frames that a valve may miss but one before it closes by itself.
FRAMES_PER_TIMEOUT = 3
_FLOAT = re.compile("float", re.IGNORECASE)


@dataclass
class _Shared:
    """A valve message that is bound: what its other axes may not use again."""

    file: DbcFile
    message: Message
    ticks: int
    config: Valve
    codec: ValveMessage
    use: dict[str, str]


@dataclass
class ValveBinder(InputBinder):
    """Binds them, or notes every problem."""

    _shared: dict[tuple[str, int, bool], _Shared] = field(default_factory=dict)

    def valve(self, place: Place, valve: Valve) -> tuple[Message, ValveCodec, int] | None:
        """The valve of an axis: its message, its codec, and its period in ticks."""
        before = len(self.problems)
        shared = self._message(place, valve)
        if shared is None:
            return None
        message, file, ticks = shared.message, shared.file, shared.ticks
        if (cycle := ticks * self.config.tick_ms) > SLOWEST_VALVE_MS:
            text = f"has GenMsgCycleTime {cycle} ms, allowed for a valve is up to"
            self.problems.append(file.problem(message, f"{text} {SLOWEST_VALVE_MS} ms"))
        elif cycle * FRAMES_PER_TIMEOUT > valve.timeout_ms:
            text = f"found {valve.timeout_ms}, allowed is {cycle * FRAMES_PER_TIMEOUT} ms or more:"
            text += f" three cycles of {message.name}, so that two lost frames do not close it"
            self.add((*place, "timeout_ms"), text)
        signal = self._command((*place, "signal"), shared, valve, valve.signal)
        if signal and (why := command_fault(signal)):
            self.problems.append(file.problem(message, why))
        also = [
            self._command((*place, "also", i), shared, valve, name)
            for i, name in enumerate(valve.also)
        ]
        if valve.cia408:
            self._control((*place, "cia408"), shared, valve, valve.cia408)
            if signal and (why := set_point_fault(signal)):
                self.problems.append(file.problem(message, why))
        direction = valve.direction
        codec = self._direction((*place, "direction"), shared, direction) if direction else None
        if signal is None or not ticks or len(self.problems) > before:
            return None
        others = [s for s in also if s]
        return message, ValveCodec(shared.codec, signal, codec, others), ticks

    def _message(self, place: Place, valve: Valve) -> _Shared | None:
        """The message of a valve, new or already that of another axis."""
        known = self.messages.find(valve.message)
        if not isinstance(known, str):
            shared = self._shared.get(_key(valve, known[1]))
            if shared and shared.message is known[1]:
                for key in ("alive_counter", "checksum", "e2e"):
                    if getattr(valve, key) != getattr(shared.config, key):
                        text = f"differs from that of the other axes of {shared.message.name}"
                        self.add((*place, key), f"{text}, allowed is the same")
                return shared
        found = self.message(place, valve.bus, valve.message, takes=False)
        if not found:
            return None
        file, message = found
        ticks = self.period(file, message)
        use: dict[str, str] = {}
        protection = self.protection(place, valve, message, use)
        codec = ValveMessage(self.sender(valve.bus, message, protection))
        shared = _Shared(file, message, ticks, valve, codec, use)
        self._shared[_key(valve, message)] = shared
        return shared

    def _command(self, place: Place, shared: _Shared, valve: Valve, name: str) -> Signal | None:
        """A signal that tells the command, or its magnitude where a direction is told by codes."""
        signal = self.signal(place, shared.message, name)
        if signal is None:
            return None
        if why := magnitude_range(signal) if valve.direction else symmetrical_range(signal):
            if not valve.direction and not magnitude_range(signal):
                why += ", or a direction with this one"
            self.problems.append(shared.file.problem(shared.message, why))
            return None
        self.integer(place, signal)
        self._alone(place, shared, signal)
        return signal

    def _control(self, place: Place, shared: _Shared, valve: Valve, config: Cia408) -> None:
        self.node(place, valve.bus, config.node)
        signal = self.signal((*place, "control"), shared.message, config.control)
        if signal:
            self.integer((*place, "control"), signal, signed=False)
            self._alone((*place, "control"), shared, signal)
            self.state_bits((*place, "control"), signal)

    def _direction(
        self, place: Place, shared: _Shared, direction: DirectionCodes
    ) -> DirectionCodec | None:
        signal = self.signal((*place, "signal"), shared.message, direction.signal)
        if signal is None:
            return None
        self.integer((*place, "signal"), signal, signed=False)
        self._alone((*place, "signal"), shared, signal)
        codes = (direction.neutral, direction.positive, direction.negative)
        largest = raw_limits(signal)[1]
        for key, code in zip(("neutral", "positive", "negative"), codes, strict=True):
            name = next((str(n) for raw, n in (signal.choices or {}).items() if raw == code), "")
            if code > largest:
                text = f"found {code}, {signal.name} has {signal.length} bits: up to {largest}"
                self.add((*place, key), text)
            elif _FLOAT.search(name):
                text = f"found {code}, which the DBC names {name}; a floating axis drops its load"
                self.add((*place, key), text)
        return DirectionCodec(signal.name, codes)

    def _alone(self, place: Place, shared: _Shared, signal: Signal) -> None:
        self.alone(place, signal, shared.use)
        shared.use[signal.name] = ".".join(str(p) for p in place)


def _key(valve: Valve, message: Message) -> tuple[str, int, bool]:
    return valve.bus, message.frame_id, message.is_extended_frame
