"""Messages that are taken: levers and the emergency stop, bound to their DBC messages."""

from dataclasses import dataclass

from cantools.database.can import Message, Signal

from canshaper.can.codecs import LeverCodec
from canshaper.can.database import DbcFile
from canshaper.can.flags import FlaggedVelocity
from canshaper.can.lookup import Lookup
from canshaper.can.protection import Guard
from canshaper.can.signals import VelocitySignal, magnitude_range, symmetrical_range
from canshaper.config.schema import EmergencyStop, Input, Lever
from canshaper.config.source import Place

# Two frames may be lost in a row; more is no longer the noise of a bus.
USUAL_MAX_STEP = 3


@dataclass(frozen=True)
class BoundInput:
    """A message that is taken; ``key`` is (bus, id, extended)."""

    config: Input
    message: Message
    codec: LeverCodec
    counter_range: int
    checksum: tuple[str, int] | None

    @property
    def key(self) -> tuple[str, int, bool]:
        """Where its frames are found."""
        return self.config.bus, self.message.frame_id, self.message.is_extended_frame

    def guard(self) -> Guard:
        """A new guard of its protection."""
        config = self.config
        step = config.alive_max_step or min(USUAL_MAX_STEP, self.counter_range // 2)
        return Guard(self.counter_range, step, self.checksum, config.qualify)


@dataclass(frozen=True)
class BoundLever(BoundInput):
    """A lever with its message."""

    config: Lever
    name: str


@dataclass(frozen=True)
class BoundStop(BoundInput):
    """The emergency stop with its message."""

    config: EmergencyStop


class InputBinder(Lookup):
    """Binds them, or notes every problem."""

    def lever(self, name: str, lever: Lever) -> BoundLever | None:
        """A lever; its velocities are those that the axes name."""
        place: Place = ("levers", name)
        before = len(self.problems)
        use: dict[str, str] = {}
        found = self._input(place, lever, ("enable", "reset", "anti_sway_off"), use)
        if not found:
            return None
        file, message, counter_range, checksum = found
        velocities = self._velocities(name, file, message, use)
        if len(self.problems) > before:
            return None
        return BoundLever(
            lever, message, LeverCodec(message, velocities), counter_range, checksum, name
        )

    def _velocities(
        self, lever: str, file: DbcFile, message: Message, use: dict[str, str]
    ) -> list[VelocitySignal | FlaggedVelocity]:
        """What the axes take from a lever; ``use`` is what its other signals are."""
        found: list[VelocitySignal | FlaggedVelocity] = []
        sticks = {n: a.stick for n, a in self.config.axes.items() if a.stick.lever == lever}
        moves = {s.signal: f"the stick of {axis}" for axis, s in reversed(sticks.items())}
        for axis, stick in sticks.items():
            place: Place = ("axes", axis, "stick")
            flags = stick.flags.model_dump() if stick.flags else {}
            for key, name in flags.items():
                if flag := self.signal((*place, "flags", key), message, name):
                    self.integer((*place, "flags", key), flag, signed=False)
                    self.alone((*place, "flags", key), flag, {**moves, **use})
                    use[name] = f"the {key} flag of {axis}"
            signal = self.signal((*place, "signal"), message, stick.signal)
            if signal is None:
                continue
            if why := magnitude_range(signal) if flags else symmetrical_range(signal):
                if not flags and not magnitude_range(signal):
                    why += ", or direction flags with this one"
                self.problems.append(file.problem(message, why))
                continue
            self.alone((*place, "signal"), signal, use)
            velocity = VelocitySignal.of(signal)
            if flags:
                use[signal.name] = moves[signal.name]  # with other flags it would be another one
            found.append(FlaggedVelocity(velocity, **flags) if flags else velocity)
        return found

    def stop(self, stop: EmergencyStop) -> BoundStop | None:
        """The emergency stop."""
        place: Place = ("emergency_stop",)
        before = len(self.problems)
        found = self._input(place, stop, ("signal",), {})
        if not found or len(self.problems) > before:
            return None
        _, message, counter_range, checksum = found
        return BoundStop(stop, message, LeverCodec(message, []), counter_range, checksum)

    def _input(
        self, place: Place, config: Input, switches: tuple[str, ...], use: dict[str, str]
    ) -> tuple[DbcFile, Message, int, tuple[str, int] | None] | None:
        """Message, its switches (noted in ``use``), range of its counter, place of its checksum."""
        found = self.message(place, config.bus, config.message, takes=True)
        if not found:
            return None
        file, message = found
        if message.cycle_time:
            self.timeout(place, config.timeout_ms, message)
        else:
            self.problems.append(file.problem(message, "has no GenMsgCycleTime"))
        for key in switches:
            if signal := self.signal((*place, key), message, getattr(config, key)):
                self.integer((*place, key), signal)
                self.alone((*place, key), signal, use)
                use[signal.name] = key
        return file, message, *self._protection(place, config, message, use)

    def _protection(
        self, place: Place, config: Input, message: Message, use: dict[str, str]
    ) -> tuple[int, tuple[str, int] | None]:
        counter_range = 0
        if counter := self.signal((*place, "alive_counter"), message, config.alive_counter):
            self.integer((*place, "alive_counter"), counter, signed=False)
            self.alone((*place, "alive_counter"), counter, use)
            use[counter.name] = "alive_counter"
            counter_range = 1 << counter.length
            # Beyond half of its range a step back could not be told from a step forward.
            if (config.alive_max_step or 0) > counter_range // 2:
                self.add(
                    (*place, "alive_max_step"),
                    f"is {config.alive_max_step}, allowed is up to {counter_range // 2}:"
                    f" {counter.name} has {counter.length} bits",
                )
        if config.checksum is None:
            return counter_range, None
        at: Place = (*place, "checksum", "signal")
        signal = self.signal(at, message, config.checksum.signal)
        if signal is None:
            return counter_range, None
        self.alone(at, signal, use)
        use[signal.name] = "checksum"
        byte = _whole_byte(signal)
        if byte is None:
            self.add(at, f"{signal.name} is no unsigned byte of its own; allowed is one that is")
            return counter_range, None
        return counter_range, (config.checksum.kind, byte)


def _whole_byte(signal: Signal) -> int | None:
    """Number of the byte that an unsigned integer signal fills, or None."""
    first = 0 if signal.byte_order == "little_endian" else 7
    if signal.is_float or signal.is_signed or signal.length != 8 or signal.start % 8 != first:
        return None
    return signal.start // 8
