"""The gate at work: frames come in, a tick begins, and each frame that wants to leave is judged."""

import math
from collections.abc import Hashable, Iterable, Mapping

from canshaper.gate import rules
from canshaper.gate.axis import AxisState
from canshaper.gate.fields import Word, word_of
from canshaper.gate.received import JoystickState, Received, SwitchState
from canshaper.gate.record import Key, Message, Record, Switch


class Gate:
    """All valves of a machine.

    Attributes:
        moved: axes by the name of the message that moves them.
        valves: valve messages with their axes.
    """

    def __init__(self, record: Record) -> None:
        self.record = record
        self.number = -1  # of this deadline
        self.others: dict[Key, int] = {}  # frames of it, by messages that are no valve's
        self.made = 0  # ticks; deadlines that were missed are none
        self.stood = False  # the loop stood still, and no tick was made since
        self.messages = {name: Received(one) for name, one in record.messages.items()}
        self.joysticks: dict[str, JoystickState] = {}
        for name, one in record.joysticks.items():
            switches = [self._switch(switch) for switch in (one.pressed, *one.others)]
            joystick = JoystickState(one, self.messages[one.message], switches)
            self.joysticks[name] = joystick
            joystick.received.joysticks.append(joystick)
        self.axes = {
            name: AxisState(one, self.joysticks[one.joystick]) for name, one in record.axes.items()
        }
        self.moved: dict[str, list[AxisState]] = {name: [] for name in record.messages}
        for axis in self.axes.values():
            axis.partner = self.axes.get(axis.of.partner)
            axis.joystick.received.axes.append(axis)
            self.moved[axis.joystick.of.message].append(axis)
        for joystick in self.joysticks.values():
            for switch in (joystick.pressed, *joystick.others):
                switch.axes = self.moved[joystick.of.message]
        self.stop: SwitchState | None = None
        if record.stop:
            self.stop = self._switch(record.stop, "emergency stop", latches=True)
            self.stop.axes = list(self.axes.values())
        self.ids: dict[Key, Received] = {}
        self.groups: list[Received] = []
        for message in self.messages.values():
            of = message.of
            self.ids.update({(of.bus, one, of.extended): message for one in of.ids})
            if of.group is not None:
                self.groups.append(message)
        self.valves = {
            key: (valve, [self.axes[name] for name in valve.axes])
            for key, valve in record.valves.items()
        }
        self.counts: dict[Key, int] = {}  # of the last frame that left, and of the one before
        self.before: dict[Key, int | None] = {}

    def _switch(self, of: Switch, why: str = "enable", *, latches: bool = False) -> SwitchState:
        switch = SwitchState(of, self.messages[of.message], why, latches=latches)
        switch.received.switches.append(switch)
        return switch

    # --- what comes in ---------------------------------------------------------------------------

    def receive(self, key: Key, data: bytes, now_ns: int) -> Received | None:
        """A frame was received; return its message, where that is one with a joystick."""
        message = self.ids.get(key)
        if message is None:
            message = self._by_group(key, now_ns)
            if message is None:
                return None
        word = word_of(data)
        says, counts = message.take(data, word, now_ns)
        if says:
            for switch in message.switches:
                if switch.see(word, counts=counts) and not self.stood:
                    for joystick in self.joysticks.values():
                        if joystick.pressed is switch:
                            joystick.press = self.made
        if counts:
            for joystick in message.joysticks:
                joystick.take(word, self.made, stood=self.stood)
            for axis in self.moved[message.of.name]:
                axis.take(word, now_ns)
        return message if message.axes else None

    def _by_group(self, key: Key, now_ns: int) -> Received | None:
        """A message of J1939 that any address may send; and commands of others to our valves."""
        bus, can_id, extended = key
        if key in self.valves:
            self._foreign(self.valves[key][1], now_ns)
            return None
        if not extended:
            return None
        for message in self.groups:
            mask, group = message.of.group  # type: ignore[misc]
            if bus == message.of.bus and can_id & mask == group:
                source = can_id & 0xFF
                ours = source == message.of.own or message.from_other(source, now_ns)
                return None if ours else message
        for (at, own, _), (valve, axes) in self.valves.items():
            same = valve.group and bus == at and can_id & valve.group == own & valve.group
            # Below the mask: a destination, where the group has one; 255 is all of them.
            if same and can_id >> 8 & 0xFF in (own >> 8 & 0xFF, 0xFF):
                self._foreign(axes, now_ns)
        return None

    def _foreign(self, axes: Iterable[AxisState], now_ns: int) -> None:
        """Someone else commands these axes; one who only listens is no one's rival."""
        if not self.record.listens:
            for axis in axes:
                axis.foreign_ns, axis.hard, axis.latches = now_ns, "second sender", True

    def disagrees(self, axes: Iterable[AxisState]) -> None:
        """Another decoder has read something else in a frame of their joystick."""
        for axis in axes:
            axis.hard = "decoders disagree"

    def stalled(self) -> None:
        """The loop stood still: what moves stops; what comes before the next tick has waited."""
        self.stood = True
        for axis in self.axes.values():
            axis.halt("loop stalled", self.made + 1, latch=axis.last != 0.0)

    def send_failed(self, key: Key) -> None:
        """A frame did not reach its bus: what moves stops."""
        for axis in self.valves[key][1] if key in self.valves else ():
            if axis.last:
                axis.halt("send failed", self.made + 1, latch=True)

    def withheld(self, key: Key) -> None:
        """A frame was too late and did not leave: the next one has its count."""
        last = self.before.get(key)
        if last is None:
            self.counts.pop(key, None)
        else:
            self.counts[key] = last

    def set(self, key: str, value: float) -> None:
        """A number of the file is another one from now on: axes.NAME.SECTION.KEY."""
        name, section, last = key.rsplit(".", 2)
        axis = self.axes[name.removeprefix("axes.")]
        axis.of.set(f"{section}.{last}", value)
        axis.change_filter()

    def measure(self, name: str, part: float) -> None:
        """A measurement moves an axis: so large a part of full command is the demand, [-1, 1]."""
        axis = self.axes[name]
        steps = math.ceil(abs(part) * axis.of.command.size.full)
        velocity = axis.of.openings[part < 0.0].velocity(steps) if steps else 0.0
        axis.ramp = -velocity if part < 0.0 else velocity

    # --- a tick ----------------------------------------------------------------------------------

    def tick(self, now_ns: int, missed: int) -> None:
        """A tick begins, after so many deadlines that were missed."""
        last, self.number = self.number, self.number + 1 + missed
        self.made += 1
        self.others.clear()
        if self.stood:
            self.stood = False
            for message in self.messages.values():
                message.forget()
        for joystick in self.joysticks.values():
            joystick.look(now_ns)
        axes = self.axes.values()
        for axis in axes:
            period = axis.of.period
            passed = self.number // period - last // period
            axis.due = passed > 0
            if axis.due:
                why, latches = rules.stop_at_once(axis, self.stop, now_ns)
                demand = None if why else rules.demand_of(axis, now_ns)
                axis.look(why, demand, self.made, self.number, passed, latches=latches)
        for axis in axes:
            if axis.due:
                partner = axis.partner
                asked_now = bool(axis.forth.most or axis.back.most)
                if partner is not None:
                    asked_now = asked_now or bool(partner.forth.most or partner.back.most)
                axis.asked_now, axis.asked = asked_now, asked_now or axis.asked_now
                if not axis.asked or axis.forth.most or axis.back.most:
                    axis.way, axis.alone = 0.0, 0
                if axis.ticks > 1 and axis.of.forwarded:
                    axis.skip()
                axis.least, axis.most = rules.bounds(axis)

    # --- what goes out ---------------------------------------------------------------------------

    def leaving(self, key: Key, data: bytes, of: bytes | None = None) -> str:
        """Why a frame may not leave; in a gateway it was made ``of`` one of the joystick."""
        known = self.valves.get(key)
        if known is None:
            self.others[key] = sent = self.others.get(key, 0) + 1
            return rules.other_refused(self.record, key, data, sent)
        valve, axes = known
        word, joystick = word_of(data), axes[0].joystick
        held = not joystick.pressed.released and any(one.armed or one.stop_left for one in axes)
        if why := rules.bytes_refused(valve, data, word, of, held=held):
            return why
        count = valve.protection.count(data, word)
        # Axes of one message have one period, and so their turn together.
        due = axes[-1].due if of is None else joystick.received.waiting
        if why := rules.turn_refused(valve, count, self.counts.get(key), due=due):
            return why
        velocities = []
        for axis in axes:
            velocity = _velocity(axis, word)
            if velocity is None:
                return f"axis={axis.of.name} limit=command"
            if velocity and (why := rules.velocity_refused(axis, velocity, self.made)):
                return why
            velocities.append(velocity)
        for axis, velocity in zip(axes, velocities, strict=True):
            axis.left(velocity, self.made, self.number)
        if of is None:
            axes[-1].due = False
        else:
            joystick.received.waiting = False
        self.before[key], self.counts[key] = self.counts.get(key), count
        return ""

    def refused(self, key: Key) -> None:
        """A frame was refused: its axes stop, and wait for a reset."""
        for axis in self.valves[key][1]:
            axis.halt("refused", self.made, latch=True)

    def last(self, key: Key, data: bytes) -> str:
        """Why a frame may not be the last one: it has to be right and neutral."""
        (valve, axes), word = self.valves[key], word_of(data)
        if why := rules.bytes_refused(valve, data, word, None, held=False):
            return why
        moves = [axis.of.name for axis in axes if _velocity(axis, word) != 0.0]
        if moves:
            return f"axis={moves[0]} limit=neutral"
        self.counts[key] = valve.protection.count(data, word)
        return ""

    # --- a reload --------------------------------------------------------------------------------

    def carry_over(self, before: "Gate", reopened: frozenset[str]) -> None:
        """Go on where the gate of the file before has ended: what is latched stays latched.

        Args:
            before: that gate.
            reopened: buses that were closed meanwhile: nothing good that is known of them counts.
        """
        self.made = before.made
        places, were = self.record.places, before.record.places
        messages = {_known_by(one.of, were): one for one in before.messages.values()}
        for message in self.messages.values():
            if (same := messages.get(_known_by(message.of, places))) is not None:
                message.carry_over(same, missed=message.of.bus in reopened)
        keys = {(were[bus], *rest): (bus, *rest) for bus, *rest in before.valves}
        for key in self.valves:
            bus, *rest = key
            same_key = keys.get((places[bus], *rest))
            if same_key is not None and same_key in before.counts:
                valve, other = self.valves[key][0], before.valves[same_key][0]
                if valve.protection.counts == other.protection.counts:
                    self.counts[key] = before.counts[same_key]
        for name, axis in self.axes.items():
            bus, *rest = axis.of.valve
            for other_name, one in before.axes.items():
                at, *other_rest = one.of.valve
                same_valve = (places[bus], *rest) == (were[at], *other_rest)
                if name == other_name or (same_valve and axis.of.command == one.of.command):
                    axis.carry_over(one)


def _velocity(axis: AxisState, word: Word) -> float | None:
    """Velocity that a frame gives an axis; None where it is no command."""
    steps = axis.of.command.steps(word)
    if not steps:
        return None if steps is None else 0.0
    forth, back = axis.of.openings
    return forth.velocity(steps) if steps > 0 else -back.velocity(-steps)


def _known_by(of: Message, places: Mapping[str, Hashable]) -> Hashable:
    """Place and identifiers of a message: they stay where the file gives it another name."""
    return places[of.bus], of.ids, of.extended, of.group
