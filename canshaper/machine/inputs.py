"""Messages that are taken: joysticks and the emergency stop, bound to their DBC messages."""

from dataclasses import dataclass

from cantools.database.can import Message

from canshaper.codec.codecs import JoystickCodec
from canshaper.codec.flags import FlaggedVelocity, RockerVelocity
from canshaper.codec.j1939 import NULL, at_every_priority, has_destination, with_source
from canshaper.codec.layout import is_j1939
from canshaper.codec.protection import Guard, Protection
from canshaper.codec.signals import (
    VelocitySignal,
    magnitude_range,
    radius_range,
    symmetrical_range,
)
from canshaper.config.input import Input
from canshaper.config.schedule import LoadState, ProfileSwitch
from canshaper.config.schema import Command, EmergencyStop, Feedback, Joystick, Radius, StatusWord
from canshaper.config.source import Place
from canshaper.machine.database import DbcFile
from canshaper.machine.protections import ProtectionBinder

Velocity = VelocitySignal | FlaggedVelocity | RockerVelocity
# Two frames may be lost in a row; more is no longer the noise of a bus.
USUAL_MAX_STEP = 3


@dataclass(frozen=True)
class BoundInput:
    """A message that is taken; ``key`` is (bus, id, extended)."""

    config: Input
    message: Message
    codec: JoystickCodec
    protection: Protection

    @property
    def key(self) -> tuple[str, int, bool]:
        """Where its frames are found; of J1939 with the source address, 254 for any."""
        can_id, source = self.message.frame_id, self.config.source
        if source is not None:
            can_id = with_source(can_id, source)
        return self.config.bus, can_id, self.message.is_extended_frame

    @property
    def keys(self) -> list[tuple[str, int, bool]]:
        """Everything its frames may come as, where their source is known."""
        bus, can_id, extended = self.key
        if not is_j1939(self.message) or self.any_source:
            return [self.key]
        return [(bus, one, extended) for one in at_every_priority(can_id)]

    @property
    def any_source(self) -> bool:
        """Whether it may come from any source address."""
        return is_j1939(self.message) and self.key[1] & 0xFF == NULL

    @property
    def by_group(self) -> bool:
        """Whether its frames are known by group and source, whatever their priority."""
        return is_j1939(self.message) and not has_destination(self.message.frame_id)

    def guard(self) -> Guard:
        """A new guard of its protection."""
        config = self.config
        step = config.alive_max_step or min(USUAL_MAX_STEP, self.protection.counts // 2)
        return Guard(self.protection, step, config.qualify)


@dataclass(frozen=True)
class BoundJoystick(BoundInput):
    """A joystick with its message."""

    config: Joystick
    name: str


@dataclass(frozen=True)
class BoundStop(BoundInput):
    """The emergency stop with its message."""

    config: EmergencyStop


@dataclass(frozen=True)
class BoundRadius(BoundInput):
    """A measured radius with its message."""

    config: Radius


@dataclass(frozen=True)
class BoundFeedback(BoundInput):
    """Feedback of a valve with its message."""

    config: Feedback


@dataclass(frozen=True)
class BoundStatusWord(BoundInput):
    """Status word of a valve with its message."""

    config: StatusWord


@dataclass(frozen=True)
class BoundSwitch(BoundInput):
    """The state of the grapple, or the operator's choice, with its message."""

    config: LoadState | ProfileSwitch


class InputBinder(ProtectionBinder):
    """Binds them, or notes every problem."""

    def joystick(self, name: str, joystick: Joystick) -> BoundJoystick | None:
        """A joystick; its velocities are those that the axes name."""
        place: Place = ("joysticks", name)
        before = len(self.problems)
        use: dict[str, str] = {}
        found = self._input(place, joystick, ("enable", "reset", "anti_sway_off"), use)
        if not found:
            return None
        self.node(place, joystick.bus, joystick.node)
        file, message, protection = found
        velocities = self._velocities(name, file, message, use)
        if len(self.problems) > before:
            return None
        return BoundJoystick(
            joystick, message, JoystickCodec(message, velocities), protection, name
        )

    def _velocities(
        self, joystick: str, file: DbcFile, message: Message, use: dict[str, str]
    ) -> list[Velocity]:
        """What the axes take from a joystick; ``use`` is what its other signals are."""
        found: list[Velocity] = []
        sticks = {
            n: a.command for n, a in self.config.axes.items() if a.command.joystick == joystick
        }
        moves = {s.signal: f"the stick of {axis}" for axis, s in reversed(sticks.items())}
        for axis, stick in sticks.items():
            place: Place = ("axes", axis, "command")
            if stick.negative:
                if rocker := self._rocker(place, stick, file, message, (moves, use)):
                    use[stick.negative] = f"the negative direction of {axis}"
                    use[stick.signal] = moves[stick.signal]
                    found.append(rocker)
                continue
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

    def _rocker(
        self,
        place: Place,
        stick: Command,
        file: DbcFile,
        message: Message,
        used: tuple[dict[str, str], dict[str, str]],
    ) -> RockerVelocity | None:
        """A rocker with a signal for each direction; ``used`` are sticks, and all else."""
        moves, use = used
        velocities = []
        for key, name, others in (
            ("signal", stick.signal, use),
            ("negative", stick.negative, {**moves, **use}),
        ):
            signal = self.signal((*place, key), message, name)
            if signal is None:
                continue
            if why := magnitude_range(signal):
                self.problems.append(file.problem(message, why))
                continue
            self.alone((*place, key), signal, others)
            velocities.append(VelocitySignal.of(signal))
        return RockerVelocity(*velocities) if len(velocities) == 2 else None

    def stop(self, stop: EmergencyStop) -> BoundStop | None:
        """The emergency stop."""
        place: Place = ("emergency_stop",)
        before = len(self.problems)
        found = self._input(place, stop, ("signal",), {})
        if not found or len(self.problems) > before:
            return None
        _, message, protection = found
        bound = BoundStop(stop, message, JoystickCodec(message, []), protection)
        self._known_source(place, bound, "the emergency stop")
        return bound if len(self.problems) == before else None

    def _known_source(self, place: Place, bound: BoundInput, what: str) -> None:
        """From any source address the first that is heard would count, and no other."""
        if bound.any_source:
            text = f"missing: in the DBC {bound.message.name} may come from any source address"
            self.add((*place, "source"), f"{text}; {what} needs a known one")

    def radius(self, place: Place, radius: Radius) -> BoundRadius | None:
        """The measured radius of a radial compensation."""
        before = len(self.problems)
        source = radius.source
        found = self.message(place, radius.bus, radius.message, takes=True, source=source)
        if not found:
            return None
        file, message = found
        signal = self.signal((*place, "signal"), message, radius.signal)
        if signal and (why := radius_range(signal)):
            self.problems.append(file.problem(message, why))
        self.timeout(place, radius.timeout_ms, message)
        use = {radius.signal: "signal"}
        protection = self.input_protection(place, radius, message, use)
        bound = BoundRadius(radius, message, JoystickCodec(message, []), protection)
        self._known_source(place, bound, "the radius")
        return bound if len(self.problems) == before else None

    def status_word(self, place: Place, config: StatusWord) -> BoundStatusWord | None:
        """The status word of a valve."""
        before = len(self.problems)
        found = self._input(place, config, ("signal",), {})
        if not found:
            return None
        _, message, protection = found
        if signal := self.signal((*place, "signal"), message, config.signal):
            self.state_bits((*place, "signal"), signal)
        if len(self.problems) > before:
            return None
        return BoundStatusWord(config, message, JoystickCodec(message, []), protection)

    def switch(self, place: Place, config: LoadState | ProfileSwitch) -> BoundSwitch | None:
        """The state of the grapple, or the operator's choice."""
        before = len(self.problems)
        found = self._input(place, config, (), {config.signal: "signal"})
        if not found:
            return None
        _, message, protection = found
        signal = self.signal((*place, "signal"), message, config.signal)
        if signal and isinstance(config, ProfileSwitch):
            self.integer((*place, "signal"), signal)
        if len(self.problems) > before:
            return None
        return BoundSwitch(config, message, JoystickCodec(message, []), protection)

    def node(self, place: Place, bus: str, name: str | None) -> None:
        """A node of CANopen that is named has to be one of its bus."""
        if name is None:
            return
        config = self.config.buses.get(bus)
        nodes = config.canopen.nodes if config and config.canopen else {}
        if name not in nodes:
            text = f"found {name!r}, nodes of bus {bus} are {', '.join(nodes) or 'none'}"
            self.add((*place, "node"), text)

    def feedback(self, place: Place, feedback: Feedback) -> BoundFeedback | None:
        """What a valve says of itself."""
        before = len(self.problems)
        found = self._input(place, feedback, (), {feedback.signal: "signal"})
        if not found:
            return None
        file, message, protection = found
        signal = self.signal((*place, "signal"), message, feedback.signal)
        if signal and feedback.full is None and not signal.maximum:
            text = f"{signal.name} has no range in the DBC; allowed is that, or full"
            self.problems.append(file.problem(message, text))
        if len(self.problems) > before:
            return None
        return BoundFeedback(feedback, message, JoystickCodec(message, []), protection)

    def _input(
        self, place: Place, config: Input, switches: tuple[str, ...], use: dict[str, str]
    ) -> tuple[DbcFile, Message, Protection] | None:
        """Message, its switches (noted in ``use``), its protection."""
        found = self.message(place, config.bus, config.message, takes=True, source=config.source)
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
        return file, message, self.input_protection(place, config, message, use)

    def input_protection(
        self, place: Place, config: Input, message: Message, use: dict[str, str]
    ) -> Protection:
        """Protection of a message that is taken, and the largest step of its counter."""
        address = self.address(config.bus, message, takes=True, source=config.source)
        protection = self.protection(place, config, message, use, address)
        most = protection.counts // 2
        # Beyond half of its range a step back could not be told from a step forward.
        if protection.counts and (config.alive_max_step or 0) > most:
            text = f"is {config.alive_max_step}, allowed is up to {most}: its counter has"
            self.add((*place, "alive_max_step"), f"{text} {protection.counts} values")
        return protection
