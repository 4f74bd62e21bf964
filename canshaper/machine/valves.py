"""Valve messages of a deployment, bound to the DBC: one for each axis, or shared by several."""

import re
from dataclasses import dataclass, field

from cantools.database.can import Message, Signal

from canshaper.codec.codecs import Sender
from canshaper.codec.protection import Protection
from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.signals import (
    command_fault,
    find_signal,
    magnitude_range,
    raw_limits,
    set_point_fault,
    symmetrical_range,
)
from canshaper.codec.valve import Direction, DirectionCodec, FlagsCodec, ValveCodec, ValveMessage
from canshaper.config.schema import Cia408, Command, DirectionCodes, Joystick, Valve
from canshaper.config.source import Place
from canshaper.machine.database import DbcFile
from canshaper.machine.inputs import InputBinder

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

    def valve(
        self, place: Place, valve: Valve, stick: Command
    ) -> tuple[Message, ValveCodec, int] | None:
        """The valve of an axis: its message, its codec, and its period in ticks."""
        before = len(self.problems)
        name = self._rewrites(valve)
        if name is not None:
            self._check_rewritten(place, valve, stick, name)
        shared = self._message(place, valve, name)
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
        magnitude = bool(valve.direction or (name and (stick.flags or stick.negative)))
        signal = self._command((*place, "signal"), shared, valve.signal, magnitude)
        if signal and (why := command_fault(signal)):
            self.problems.append(file.problem(message, why))
        also = [
            self._command((*place, "also", i), shared, other, magnitude)
            for i, other in enumerate(valve.also)
        ]
        if valve.cia408:
            self._control((*place, "cia408"), shared, valve, valve.cia408)
            if signal and (why := set_point_fault(signal)):
                self.problems.append(file.problem(message, why))
        direction = valve.direction
        codec: Direction | None = None
        if direction:
            codec = self._direction((*place, "direction"), shared, direction)
        elif name and (flags := stick.flags):
            codec = FlagsCodec((flags.neutral, flags.positive, flags.negative))
        negative = None
        if name and stick.negative:
            negative = self.signal((*place, "signal"), message, stick.negative)
            if signal and negative and not _alike(signal, negative):
                text = f"{negative.name} is not like {signal.name}; allowed are two that are"
                self.problems.append(file.problem(message, text))
        if signal is None or not ticks or len(self.problems) > before:
            return None
        others = [s for s in also if s]
        return message, ValveCodec(shared.codec, signal, codec, others, negative), ticks

    def _rewrites(self, valve: Valve) -> str | None:
        """Name of the joystick whose frames leave as this message, through the gateway."""
        gateway = self.config.gateway
        if gateway is None or (bus := gateway.other(valve.bus)) is None:
            return None
        of = {
            (joystick.bus, joystick.message): name
            for name, joystick in self.config.joysticks.items()
        }
        return of.get((bus, valve.message))

    def _check_rewritten(self, place: Place, valve: Valve, stick: Command, name: str) -> None:
        """In the frames of a joystick only its own sticks may be rewritten, protected as it is."""
        joystick = self.config.joysticks[name]
        if stick.joystick != name:
            text = (
                f"found {valve.message!r}, the message of joystick {name}, whose frames leave with"
            )
            self.add((*place, "message"), f"{text} its own sticks; that of this axis is at another")
        elif valve.signal != stick.signal:
            text = f"found {valve.signal!r}; in the message of its joystick allowed is that of the"
            self.add((*place, "signal"), f"{text} stick, {stick.signal!r}")
        for axis, other in self.config.axes.items():
            there = other.valve.bus, other.valve.message
            if other.command.joystick == name and there != (valve.bus, valve.message):
                text = f"found {other.valve.message!r}; the frames of joystick {name} leave as"
                text += f" {valve.message} on bus {valve.bus}, with this stick unshaped in them"
                self.add(("axes", axis, "valve", "message"), text)
        for key in ("direction", "cia408"):
            if getattr(valve, key) is not None:
                text = f"found in the message of joystick {name}; allowed is what the stick has"
                self.add((*place, key), text)
        for key in ("alive_counter", "checksum", "e2e"):
            if getattr(valve, key) != getattr(joystick, key):
                self.add(
                    (*place, key), f"differs from that of joystick {name}, allowed is the same"
                )
        if valve.timeout_ms <= joystick.timeout_ms:
            text = f"found {valve.timeout_ms}, allowed is more than the {joystick.timeout_ms} ms of"
            text += f" joystick {name}: who takes its frames must not give up before we do"
            self.add((*place, "timeout_ms"), text)

    def _message(self, place: Place, valve: Valve, joystick: str | None) -> _Shared | None:
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
        taken = self.config.joysticks[joystick] if joystick is not None else None
        source = taken.source if taken else None
        # A joystick's message keeps the address of its sender, who is not on this bus.
        found = self.message(
            place, valve.bus, valve.message, takes=taken is not None, source=source
        )
        if not found:
            return None
        file, message = found
        ticks = self.period(file, message)
        use: dict[str, str] = {}
        address = self.address(valve.bus, message, takes=taken is not None, source=source)
        protection = self.protection(place, valve, message, use, address)
        if taken is None:
            codec = ValveMessage(self.sender(valve.bus, message, protection))
        else:
            codec = self._rewritten(place, valve, taken, message, protection)
        shared = _Shared(file, message, ticks, valve, codec, use)
        self._shared[_key(valve, message)] = shared
        return shared

    def _rewritten(
        self,
        place: Place,
        valve: Valve,
        joystick: Joystick,
        message: Message,
        protection: Protection,
    ) -> ValveMessage:
        """The message of a joystick as it leaves."""
        can_id, any_source = self.address(valve.bus, message, takes=True, source=joystick.source)
        if any_source:
            text = f"in the DBC {message.name} may come from any source address; where its frames"
            self.add((*place, "message"), f"{text} leave, its joystick needs the key source")
        ours: set[str] = set()
        for axis in self.config.axes.values():
            if (axis.valve.bus, axis.valve.message) == (valve.bus, valve.message):
                stick = axis.command
                ours |= {axis.valve.signal, *axis.valve.also}
                ours |= {stick.negative} if stick.negative else set()
                ours |= {*stick.flags.model_dump().values()} if stick.flags else set()
        sender = Sender(valve.bus, message, can_id & 0xFF, protection)
        if find_signal(message, joystick.enable) is None:  # told with the joystick
            return ValveMessage(sender)
        return RewrittenMessage(sender, joystick.enable, frozenset(ours))

    def _command(self, place: Place, shared: _Shared, name: str, magnitude: bool) -> Signal | None:
        """A signal that tells the command, or its magnitude where a direction is told apart."""
        signal = self.signal(place, shared.message, name)
        if signal is None:
            return None
        if why := magnitude_range(signal) if magnitude else symmetrical_range(signal):
            if not magnitude and not magnitude_range(signal):
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


def _alike(one: Signal, other: Signal) -> bool:
    """Whether two signals count the same way."""
    return (one.scale, one.offset, one.maximum, one.length) == (
        other.scale,
        other.offset,
        other.maximum,
        other.length,
    )


def _key(valve: Valve, message: Message) -> tuple[str, int, bool]:
    return valve.bus, message.frame_id, message.is_extended_frame
