"""The gate at work: it receives frames, begins ticks, and judges each frame that is to leave."""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence

from canshaper.gate import rules
from canshaper.gate.axis import AxisState, ValveState
from canshaper.gate.fields import word_of
from canshaper.gate.received import AxisInput, JoystickState, Received, SwitchState
from canshaper.gate.record import Joystick, Key, Message, Record, Switch


class Gate:
    """Judges the frames to all valves of a machine, by the frames that it has received itself."""

    def __init__(self, record: Record) -> None:
        self.record = record
        self.number = -1  # number of the present deadline
        self.made = 0  # number of ticks that were run, without missed deadlines
        self.frames = 0  # number of frames received
        self.stood = False  # the loop stood still, and no tick was run since
        self.others: dict[Key, int] = {}  # frames sent in this tick, by message that is no valve's
        self.messages = {name: Received(one) for name, one in record.messages.items()}
        self.joysticks = {name: self._joystick(one) for name, one in record.joysticks.items()}
        self.axes = {
            name: AxisState(one, self.joysticks[one.joystick]) for name, one in record.axes.items()
        }
        for axis in self.axes.values():
            axis.partner = self.axes.get(axis.of.partner)
            axis.joystick.received.axes.append(axis)
        all_axes = [*self.axes.values()]
        self.stop = self._switch(record.stop, all_axes, emergency=True) if record.stop else None
        messages = self.messages.values()
        self.ids: dict[Key, Received] = {
            (one.of.bus, can_id, one.of.extended): one for one in messages for can_id in one.of.ids
        }
        self.groups = [(*one.of.group, one) for one in messages if one.of.group]
        self.valves = {
            key: ValveState(one, [self.axes[name] for name in one.axes])
            for key, one in record.valves.items()
        }

    def _joystick(self, of: Joystick) -> JoystickState:
        received = self.messages[of.message]
        enabling = of.pressed, *of.others
        switches = [self._switch(one, received.axes, emergency=False) for one in enabling]
        received.joystick = JoystickState(of, received, *switches)
        return received.joystick

    def _switch(self, of: Switch, axes: Sequence[AxisInput], *, emergency: bool) -> SwitchState:
        switch = SwitchState(of, self.messages[of.message], axes, emergency=emergency)
        switch.received.switches.append(switch)
        return switch

    # --- what comes in ---------------------------------------------------------------------------

    def receive(self, key: Key, data: bytes, now_ns: int) -> Received | None:
        """Receive a frame; return its message if a joystick in it moves axes, else None."""
        self.frames += 1
        message = self.ids.get(key) or self._by_group(key, now_ns)
        if message is None:
            return None
        word = word_of(data)
        says, counts = message.take(data, word, now_ns)
        if says:
            for switch in message.switches:
                switch.take(word, self.frames, counts=counts, stood=self.stood)
        if counts:
            if message.joystick:
                message.joystick.take(word, self.frames, stood=self.stood)
            for axis in message.axes:
                axis.take(word, now_ns)
        return message if message.axes else None

    def _by_group(self, key: Key, now_ns: int) -> Received | None:
        """Return the J1939 message that any address may send; stop valves that others command."""
        bus, can_id, extended = key
        if key in self.valves:
            self._foreign(self.valves[key], now_ns)
        elif extended:
            for mask, group, message in self.groups:
                if bus == message.of.bus and can_id & mask == group:
                    source = can_id & 0xFF
                    ours = source == message.of.own or message.from_other(source, now_ns)
                    return None if ours else message
            for (at, own, _), valve in self.valves.items():
                mask = valve.of.group
                # Below the mask is the destination, where the group has one; 255 means all nodes.
                to_us = can_id >> 8 & 0xFF in (own >> 8 & 0xFF, 0xFF)
                if mask and bus == at and can_id & mask == own & mask and to_us:
                    self._foreign(valve, now_ns)
        return None

    def _foreign(self, valve: ValveState, now_ns: int) -> None:
        """Stop the axes of a valve that another sender commands, unless we only listen."""
        if not self.record.listens:
            for axis in valve.axes:
                axis.foreign_ns = now_ns
                axis.stop("second sender", self.frames, latches=True)

    def disagrees(self, axes: Iterable[AxisInput]) -> None:
        """Stop axes: the controller's decoder has read another demand in their joystick's frame."""
        for axis in axes:
            axis.stop("decoders disagree", self.frames)

    def stalled(self) -> None:
        """Stop every axis after a standstill; frames until the next tick count as old."""
        self.stood = True
        for axis in self.axes.values():
            axis.halt("loop stalled", self.made + 1, self.frames if axis.last else None)

    def send_failed(self, key: Key) -> None:
        """Stop the moving axes of a valve frame that did not reach its bus."""
        for axis in self.valves[key].axes if key in self.valves else ():
            if axis.last:
                axis.halt("send failed", self.made + 1, self.frames)

    def withheld(self, key: Key) -> None:
        """Take back the count of a valve frame that was too late and did not leave."""
        self.valves[key].count = self.valves[key].before

    def set(self, key: str, value: float) -> None:
        """Take over the number of a key axes.NAME.SECTION.KEY, and a new filter of its axis."""
        name, section, last = key.rsplit(".", 2)
        axis = self.axes[name.removeprefix("axes.")]
        axis.of.set(f"{section}.{last}", value)
        axis.change_filter()

    def measure(self, name: str, part: float) -> None:
        """Let a measurement move an axis: its demand is this part of full command, [-1, 1]."""
        axis = self.axes[name]
        steps = math.ceil(abs(part) * axis.of.command.size.full)
        axis.ramp = axis.of.velocity(-steps if part < 0.0 else steps)

    # --- a tick ----------------------------------------------------------------------------------

    def tick(self, now_ns: int, missed: int) -> None:
        """Begin a tick after so many missed deadlines: find what may leave in it."""
        last, self.number = self.number, self.number + 1 + missed
        self.made += 1
        self.others.clear()
        if self.stood:
            self.stood = False
            for message in self.messages.values():
                message.forget()
        for joystick in self.joysticks.values():
            joystick.look(now_ns)
        due = []
        for axis in self.axes.values():
            period = axis.of.period
            passed = self.number // period - last // period
            axis.due = passed > 0
            if axis.due:
                due.append(axis)
                why, latches, lasts = rules.stop_at_once(axis, self.stop, now_ns)
                demand = None if why else rules.demand_of(axis, now_ns)
                cause = self.frames if lasts else axis.hard_at
                made, number = self.made, self.number
                axis.look(why, demand, made, number, passed, cause=cause, latches=latches)
        for axis in due:
            axis.share()
            axis.least, axis.most = rules.bounds(axis)

    # --- what goes out ---------------------------------------------------------------------------

    def leaving(self, key: Key, data: bytes, of: bytes | None = None) -> str:
        """Return why a frame may not leave; else empty, and it counts as one that has left.

        A gateway has made it ``of`` the data of a joystick's frame; else that is None.
        """
        valve = self.valves.get(key)
        if valve is None:
            self.others[key] = sent = self.others.get(key, 0) + 1
            return rules.other_refused(self.record, key, data, sent)
        word, axes, received = word_of(data), valve.axes, valve.joystick.received
        if why := rules.bytes_refused(valve, data, word, of):
            return why
        count = valve.of.protection.count(data, word)
        due = axes[-1].due if of is None else received.waiting
        if why := rules.turn_refused(valve, count, due=due):
            return why
        velocities = []
        for axis in axes:
            steps = axis.of.command.steps(word)
            if steps is None:
                return f"axis={axis.of.name} limit=command"
            velocity = axis.of.velocity(steps)
            if steps and (why := rules.velocity_refused(axis, velocity, self.made)):
                return why
            velocities.append(velocity)
        for axis, velocity in zip(axes, velocities, strict=True):
            axis.left(velocity, self.made, self.number)
        if of is None:
            axes[-1].due = False
        else:
            received.waiting = False
        valve.before, valve.count = valve.count, count
        return ""

    def refused(self, key: Key) -> None:
        """Stop the axes of a refused frame; they wait for a reset."""
        for axis in self.valves[key].axes:
            axis.halt("refused", self.made, self.frames)

    def last(self, key: Key, data: bytes) -> str:
        """Return why a valve frame may not be the last one, right and neutral; or empty."""
        valve, word = self.valves[key], word_of(data)
        if why := rules.bytes_refused(valve, data, word, None, last=True):
            return why
        for axis in valve.axes:
            if axis.of.command.steps(word) != 0:
                return f"axis={axis.of.name} limit=neutral"
        valve.count = valve.of.protection.count(data, word)
        return ""

    # --- a reload --------------------------------------------------------------------------------

    def carry_over(self, before: "Gate", reopened: frozenset[str]) -> None:
        """Continue the state of the gate before a reload: each latch stays latched.

        Args:
            reopened: buses that were closed meanwhile: no frame received on them counts as good.
        """
        self.made, self.frames = before.made, before.frames
        places, were = self.record.places, before.record.places
        messages = {_known_by(one.of, were): one for one in before.messages.values()}
        for message in self.messages.values():
            if (same := messages.get(_known_by(message.of, places))) is not None:
                message.carry_over(same, missed=message.of.bus in reopened)
        valves = {(were[bus], *rest): one for (bus, *rest), one in before.valves.items()}
        for (bus, *rest), valve in self.valves.items():
            other = valves.get((places[bus], *rest))
            if other and valve.of.protection.counts == other.of.protection.counts:
                valve.count = other.count
        for name, axis in self.axes.items():
            bus, *rest = axis.of.valve
            for other_name, one in before.axes.items():
                at, *other_rest = one.of.valve
                same_valve = (places[bus], *rest) == (were[at], *other_rest)
                if name == other_name or (same_valve and axis.of.command == one.of.command):
                    axis.carry_over(one)


def _known_by(of: Message, places: Mapping[str, Hashable]) -> Hashable:
    """Return place and identifiers of a message, which stay if the file renames message or bus."""
    return places[of.bus], of.ids, of.extended, of.group
