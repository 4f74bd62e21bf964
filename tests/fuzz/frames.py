"""Any frames at any time: bytes to a script for the controller, under the eyes of the judge."""

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from tests.faults.inputs import Input, Switches
from tests.faults.judge import Judge
from tests.faults.variants import NAMES, machine

# More bytes than this say nothing new and take time.
MOST_BYTES = 2000


class Script:
    """A drive of one machine, step by step.

    Everything that comes in goes to the judge too, which raises a ``Violation`` when something is
    sent that was not allowed. Any other exception is a fault of the controller.
    """

    def __init__(self, name: str) -> None:
        self.machine, deployment = machine(name)
        self.controller = Controller(deployment)
        self.judge = Judge(self.machine)
        self.inputs: list[Input] = list(self.machine.inputs.values())
        self.now_ns = 0
        self.counts = dict.fromkeys(self.machine.inputs, 0)
        self._fails = 0

    def receive(self, frame: Frame) -> None:
        now_ns = self.now_ns + 1  # frames come after the last tick
        self.judge.receive(frame, now_ns)
        self.controller.receive(frame, now_ns)

    def joystick(self, number: int, word: int) -> None:
        """A frame of an input with any content, next counter and right checksum."""
        source = self.inputs[number % len(self.inputs)]
        self.counts[source.key] += 1
        raw = {n: f.get(word) for n, f in source.fields.items()}
        if source.counter:
            raw[source.counter.name] = self.counts[source.key] & source.counter.mask
        self.receive(Frame(*source.key, source.data(raw)))

    def healthy(self, deflected: int) -> None:
        """A frame of every input as it should be, joysticks at so many parts of 100."""
        for source in self.inputs:
            self.counts[source.key] += 1
            raw = (
                {source.counter.name: self.counts[source.key] & source.counter.mask}
                if (source.counter)
                else {}
            )
            if isinstance(source, Switches):
                raw |= source.codes
            for joystick in self.machine.joysticks.values():
                if joystick is source:
                    raw |= joystick.pressed()
                    for axis in joystick.axes:
                        raw |= axis.raw(deflected * axis.signal.full // 100)
            self.receive(Frame(*source.key, source.data(raw)))

    def tick(self, missed: int = 0, late_ns: int = 0) -> None:
        """One body of the loop; after too many missed ticks it stood still."""
        gap_ns = (1 + missed) * self.machine.tick_ns + late_ns
        self.now_ns += gap_ns
        if gap_ns > self.machine.longest_gap_ns:
            self.judge.stalled()
            self.controller.stalled()
        sent, failed = [], []
        for number, frame in enumerate(self.controller.tick(self.now_ns, missed)):
            sent.append(frame)
            if self._fails >> number & 1 and frame[:3] != self.machine.service:
                failed.append(frame)
                self.controller.send_failed(frame)
        self._fails = 0
        self.judge.tick(sent, failed, self.now_ns, missed)

    def not_sent(self, which: int) -> None:
        """Of the next frames these do not go out, a bit for each."""
        self._fails = which


class Bytes:
    """Reads a script from bytes; behind their end there are zeros."""

    def __init__(self, data: bytes) -> None:
        self._data = data[:MOST_BYTES]
        self._at = 0

    @property
    def left(self) -> bool:
        return self._at < len(self._data)

    def take(self, count: int = 1) -> bytes:
        data = self._data[self._at : self._at + count]
        self._at += count
        return data + bytes(count - len(data))

    def number(self, count: int = 1) -> int:
        return int.from_bytes(self.take(count), "little")


def run(data: bytes) -> int:
    """Drive what the bytes say; how many frames moved a valve.

    Raises:
        Violation: something was sent that was not allowed.
    """
    source = Bytes(data)
    script = Script(NAMES[source.number() % len(NAMES)])
    buses = [*script.machine.buses, "nowhere"]
    ours = [*script.machine.valves, *script.machine.statuses, *script.machine.inputs]
    while source.left:
        kind = source.number()
        if kind < 80:
            script.tick()
        elif kind < 110:
            script.joystick(source.number(), source.number(8))
        elif kind < 170:
            script.healthy(source.number() % 101 * (-1 if kind & 1 else 1))
            script.tick()
        elif kind < 180:
            script.tick(missed=source.number())
        elif kind < 190:
            script.tick(late_ns=source.number(4))
        elif kind < 200:
            script.not_sent(source.number())
        elif kind < 225:
            key = ours[source.number() % len(ours)]
            script.receive(Frame(*key, source.take(source.number() % 10)))
        else:
            bus = buses[source.number() % len(buses)]
            can_id = source.number(4)
            extended = bool(can_id >> 31)
            can_id &= (1 << 29) - 1 if extended else (1 << 11) - 1
            script.receive(Frame(bus, can_id, extended, source.take(source.number() % 9)))
    for frame in script.controller.neutral_frames():
        axis = script.machine.valves[frame[:3]]
        assert axis.sent(frame.data)[0] == 0
    return script.judge.stats["moves"]
