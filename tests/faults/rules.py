"""The rules of docs/safety.md, judged by what is on the buses and when: no state machine in it.

It knows the deployment file, the DBC and every frame that the daemon has read or sent, and neither
the daemon's states nor what they are called. For every axis, in every frame of its valve:

    no motion unless an enabled, valid joystick was seen in neutral since start, fault or trip
    neutral while enable is off, the valve or its node has a fault, another sender commands it, or
    our address is another's; and, where it moved, until a press with the joystick in neutral
    neutral and latched after a standstill of the loop
    neutral within ``stop_s`` after the input is lost or invalid
    never faster than commanded within the tail, never against the joystick, or on the way back
    no jump: never quicker than the valve's rates, but to neutral
    the alive counter goes on by one
    where the file says so: no faster than there is oil for, and nothing towards an end stop

A reload, a change of a number: nothing of this ends with them, so the rules do not know them; but
what an operator commanded before a reload does not bound what a partner adds behind it.
"""

from canshaper.codec.frame import Frame
from tests.faults.axis_rules import SLACK_NS, AxisRules
from tests.faults.judge import Violation
from tests.faults.machine import Key, Machine
from tests.faults.other_nodes import AddressRules, NodeRules, WordRules
from tests.faults.received import Received, ReceivedJoystick, ReceivedSwitches
from tests.faults.shared import EndRules, FlowRules


class Rules:
    """All axes of a machine, and its nodes."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        joysticks = {name: ReceivedJoystick(v) for name, v in machine.joysticks.items()}
        switches = {one: ReceivedSwitches(one) for one in machine.switches}
        for one in joysticks.values():
            one.connect(joysticks, switches)
        inputs = (*joysticks.values(), *switches.values())
        self._inputs: dict[Key, Received] = {v.source.key: v for v in inputs}
        self.axes = {
            name: AxisRules(axis, joysticks[axis.joystick.name], machine.tick_ns)
            for name, axis in machine.axes.items()
        }
        for one in self.axes.values():
            if one.axis.moves_with:
                one.partner = self.axes[one.axis.moves_with.name]
        self._by_valve: dict[Key, list[AxisRules]] = {}
        for one in self.axes.values():
            self._by_valve.setdefault(one.axis.valve_key, []).append(one)
        self._nodes = {node: NodeRules(node, machine.tick_ns) for node in machine.nodes.values()}
        self._words = {
            name: WordRules(axis.words, machine.tick_ns)
            for name, axis in machine.axes.items()
            if axis.words
        }
        self.addresses = {bus: AddressRules(bus, own) for bus, own in machine.addresses.items()}
        self._oil = FlowRules(machine.hydraulics, self.axes) if machine.hydraulics else None
        self._ends = {
            n: EndRules(self.axes[n], one, machine.tick_ns) for n, one in machine.ends.items()
        }
        # Longest time between two ticks after which a motion may go on; and how old what is sent
        # may be: a tick; in a gateway as long as that, because frames leave before the next tick.
        waits = [
            a.valve_timeout_ns - (a.period_ticks - 1) * machine.tick_ns
            for a in machine.axes.values()
        ]
        shortest_ns = min(machine.shortest_timeout_ns, *waits)
        self._longest_gap_ns = shortest_ns
        self._oldest_ns = (shortest_ns if machine.gateway else machine.tick_ns) + SLACK_NS
        self._pending_ns: int | None = None
        self._ticked_ns = -1
        self._late_ns = 0
        self._ticks: dict[Key, int] = dict.fromkeys(self._by_valve, 0)
        self._last: dict[Key, tuple[Frame, int]] = {}
        self.frames = self.moves = 0

    # -- what comes in ----------------------------------------------------------------------------

    def commanded(self, frame: Frame) -> list[AxisRules]:
        """The axes whose valve this frame of another sender commands."""
        if frame.bus in self.addresses and frame.extended:
            group = frame.can_id & 0x03FFFF00
            return [
                one
                for (bus, can_id, _), axes in self._by_valve.items()
                if bus == frame.bus and can_id & 0x03FFFF00 == group
                for one in axes
            ]
        return self._by_valve.get(frame[:3], [])

    def reads(self, now_ns: int) -> None:
        """The daemon begins to read."""
        self._pending_ns = now_ns

    def receive(self, frame: Frame, arrived_ns: int) -> None:
        """The daemon has read a frame."""
        if entry := self._inputs.get(frame[:3]):
            entry.receive(frame.data, arrived_ns)
        for ends in self._ends.values():
            ends.receive(frame, arrived_ns)
        for one in self.commanded(frame):
            one.foreign_ns = arrived_ns
            one.causes.add("another sender")
        for node in self._nodes.values():
            node.receive(frame, arrived_ns)
        for words in self._words.values():
            words.receive(frame, arrived_ns)
        for address in self.addresses.values():
            address.receive(frame)

    def failed(self, frame: Frame, now_ns: int) -> None:
        """A frame did not get onto its bus."""
        _, sent_ns = self._last.get(frame[:3], (frame, now_ns))
        for one in self._by_valve.get(frame[:3], ()):
            one.lost += 1
            if now_ns - sent_ns > one.axis.valve_timeout_ns:  # the valve has closed by itself
                one.velocity = 0.0
            if one.velocity or one.axis.sent(frame.data)[0]:  # at rest nothing is lost
                one.causes.add("the last frame was not sent")

    def decide(self) -> None:
        """Bring every axis to what has been read."""
        now_ns, self._pending_ns = self._pending_ns, None
        if now_ns is None:
            return
        if now_ns != self._ticked_ns:  # what waited behind a standstill is read in many rounds
            gap_ns = now_ns - self._ticked_ns if self._ticked_ns >= 0 else 0
            # Silence counts when the loop has looked; in a standstill it did not.
            self._late_ns = max(gap_ns - self.machine.tick_ns, 0)
            self._ticked_ns = now_ns
            for key in self._ticks:
                self._ticks[key] += 1
            for address in self.addresses.values():
                address.ticked()
            for one in self.axes.values():
                one.after(gap_ns, now_ns, longest_ns=self._longest_gap_ns)
        for name, one in self.axes.items():
            if words := self._words.get(name):
                node_causes = self._nodes[words.words.node].causes(now_ns - self._late_ns)
                one.causes |= words.causes(now_ns) | node_causes
            if drive := self.machine.drives.get(name):
                one.causes |= self._nodes[drive].causes(now_ns - self._late_ns)
            node = self.machine.joystick_nodes.get(one.axis.joystick.name)
            works = node is None or not self._nodes[node].seen(now_ns)
            if node and self._nodes[node].may_be_lost(now_ns):
                one.may_stop(now_ns)
            one.decide(now_ns, joystick_works=works)
            address = self.addresses.get(one.axis.valve_key[0])
            if address and not address.usable(now_ns):
                one.silenced()
        if self._oil:
            self._oil.decide(now_ns)
        for node_rules in self._nodes.values():
            node_rules.looked_at()

    # -- what goes out ----------------------------------------------------------------------------

    def sent(self, frame: Frame, now_ns: int) -> None:
        """The daemon has sent a frame.

        Raises:
            Violation: it must not be.
        """
        if not self.machine.gateway:  # there a frame leaves while others are read
            self.decide()
        for address in self.addresses.values():
            if wrong := address.sent(frame, now_ns):
                raise Violation(wrong)
        axes = self._by_valve.get(frame[:3])
        if not axes:
            return
        self.frames += 1
        self._last[frame[:3]] = frame, now_ns
        ticks, self._ticks[frame[:3]] = self._ticks[frame[:3]], 0
        old_ns = now_ns - self._ticked_ns
        if wrong := axes[0].count(frame, late=old_ns > self._oldest_ns):
            raise Violation(f"{axes[0].axis.name}: {wrong}")
        if self.machine.gateway and not axes[0].axis.joystick.whole(frame.data):
            raise Violation(f"{axes[0].axis.name}: wrong checksum")
        for one in axes:
            if wrong := one.check(frame, ticks):
                raise Violation(f"{one.axis.name}: {wrong}")
            ends = self._ends.get(one.axis.name)
            if ends and (wrong := ends.wrong(now_ns)):
                raise Violation(f"{one.axis.name}: {wrong}")
            if one.raw and old_ns > self._oldest_ns:
                raise Violation(f"{one.axis.name}: sent {one.raw} of {old_ns / 1e6:.0f} ms ago")
            self.moves += one.raw != 0

    def words(self) -> str:
        """The limits in force now, for a reader."""
        return "; ".join(
            f"{name} {one.velocity:.3f}{' armed' * one.armed}{' latched' * one.latched}"
            for name, one in self.axes.items()
        )

    def end(self, now_ns: int) -> None:
        """The daemon has ended.

        Raises:
            Violation: the last frame of a valve is not neutral, and the valve has not closed.
        """
        for key, (frame, sent_ns) in self._last.items():
            for one in self._by_valve[key]:
                # No frame from an address that is not ours: the valve's own timeout acts.
                silent = key[0] in self.addresses and now_ns - sent_ns > 2 * self.machine.tick_ns
                if one.axis.sent(frame.data)[0] and not silent:
                    raise Violation(f"{one.axis.name}: the last frame is not neutral")
