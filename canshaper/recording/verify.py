"""Replay of a daemon's own log: what was read in which tick, where the log leaves it open.

A log has the order of the frames on the bus. A daemon reads, thinks and sends; a joystick frame
that comes in between stands before the valve frame in the log, but was read a tick later. Nothing
in the log tells, only what was sent thereafter. So where what is sent does not agree, the ticks
before are gone through again with the other ways to read the log, the nearest first.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from canshaper.codec.frame import Frame
from canshaper.machine.inputs import BoundInput, BoundJoystick
from canshaper.recording.snapshot import Snapshot
from canshaper.recording.sorting import Key
from canshaper.recording.stepper import Choice, Result, Stepper
from canshaper.recording.ticks import Tick

# Ticks that can be gone through again, and how often the state is noted: seldom, because that
# takes as long as twenty ticks, but often where a search has just been needed.
KEPT, SELDOM, OFTEN = 512, 512, 16
# A frame that came so long before the valve frame, as a part of the tick, may not have been read.
OPEN_PART = 0.5
# Ages are compared with time limits of whole ticks: a little lateness decides.
TIE_NS = 3_000_000
# Deadlines by which a tick may be numbered too high.
MOST_EARLIER = 4
# Before its first neutral frames a daemon hears, but does not read.
OPENED_NS = 30_000_000
# Ticks that a search may run: a second or so.
MOST_RUNS = 3000
# Ticks that agree before another difference is worth a search.
AGREE_AGAIN = 100


@dataclass(slots=True)
class _Entry:
    tick: Tick
    choice: Choice | None
    result: Result
    before: Snapshot | None = None

    def restore(self) -> None:
        """Back to before the tick."""
        assert self.before is not None  # asked of those only that have it
        self.before.restore()


@dataclass(slots=True)
class _Open:
    """A tick with more than one way to read the log."""

    index: int
    before: Snapshot
    options: list[Choice]
    next: int = 1


class Verifier:
    """Drives a stepper so that it sends what the log says, if that can be.

    Attributes:
        settled: ticks in which what was sent decided what had been read.
        late_ns: how long before its valve frame a tick reads, as far as that was seen.
    """

    def __init__(self, stepper: Stepper) -> None:
        self.settled = 0
        self.late_ns = 0
        self._stepper = stepper
        self._window: list[_Entry] = []
        self._noted = 0
        self._every = SELDOM
        self._agreed = AGREE_AGAIN
        self._lenient = False
        self._runs = 0  # of a search
        self._inputs = _inputs(stepper)

    def run(self, ticks: Iterable[Tick]) -> Iterator[tuple[Tick, Result]]:
        """Every tick with what it made, once it is settled."""
        stepper = self._stepper
        for tick in ticks:
            if tick.starts or stepper.fresh:
                yield from self._flush(0)
                stepper.begin(tick)
            self._noted += 1
            if self._noted >= self._every or not self._window:
                yield from self._flush(KEPT)
                self._noted = 0
                self._every = min(2 * self._every, SELDOM)
                entry = _Entry(tick, None, NOTHING, Snapshot(stepper))
            else:
                entry = _Entry(tick, None, NOTHING)
            self._window.append(entry)
            self._one(entry)
        yield from self._flush(0)

    def _one(self, entry: _Entry) -> None:
        """Run the newest tick, and look for another way when it does not agree."""
        entry.choice = self._first_choice(entry.tick)
        entry.result = self._stepper.step(entry.tick, entry.choice)
        if self._agrees(entry.result):
            self._agreed += 1
            return
        if self._agreed >= AGREE_AGAIN and self._search():
            self._agreed += 1
            return
        if entry.result.agrees:  # a status waited for its turn on the bus: it does so here
            self._lenient = True
            return
        self._agreed = 0
        self._stepper.align()

    def _agrees(self, result: Result) -> bool:
        return result.agrees and (self._lenient or not result.behind)

    def _flush(self, keep: int) -> Iterator[tuple[Tick, Result]]:
        """Hand out the oldest ticks; what remains begins with a noted state."""
        while len(self._window) > keep:
            end = next((i for i, e in enumerate(self._window) if i and e.before), None)
            end = end or len(self._window)
            if keep and len(self._window) - end < keep // 2:
                return
            for entry in self._window[:end]:
                yield entry.tick, entry.result
            del self._window[:end]

    # -- the search ----------------------------------------------------------------------------

    def _search(self) -> bool:
        """Find choices with which all ticks agree, from the latest noted state on, then earlier."""
        window = self._window
        noted = [i for i, entry in enumerate(window) if entry.before]
        self._runs = 0
        were = [(e.choice, e.result, e.before) for e in window]
        for start in reversed(noted):
            if start and len(window) - start < 4:
                continue
            if self._from(start):
                return True
            if self._runs > MOST_RUNS:
                break
        # No way: as it was.
        for entry, (choice, result, before) in zip(window, were, strict=True):
            entry.choice, entry.result, entry.before = choice, result, before
        start = noted[-1]
        window[start].restore()
        for entry in window[start:]:
            self._stepper.step(entry.tick, entry.choice)
        return False

    def _from(self, start: int) -> bool:
        """Go through the ticks from one on; depth first, the latest choice changes first."""
        window, stepper = self._window, self._stepper
        window[start].restore()
        stack: list[_Open] = []
        index = start
        while index < len(window):
            entry = window[index]
            options = self._options(index)
            if len(options) > 1:
                stack.append(_Open(index, Snapshot(stepper), options))
            entry.choice = options[0]
            entry.result = stepper.step(entry.tick, entry.choice)
            self._runs += 1
            # What differed before and could not be helped must not be searched for again.
            while not self._agrees(entry.result):
                while stack and stack[-1].next >= len(stack[-1].options):
                    stack.pop()
                if not stack or self._runs > MOST_RUNS:
                    return False
                top = stack[-1]
                top.before.restore()
                index = top.index
                entry = window[index]
                entry.choice = top.options[top.next]
                top.next += 1
                entry.result = stepper.step(entry.tick, entry.choice)
                self._runs += 1
            if index > start and entry.before is not None:
                entry.before = None  # of another way; noted anew below
            index += 1
        self._learn(start, stack)
        return True

    def _learn(self, start: int, stack: list[_Open]) -> None:
        """Note what was found out."""
        self._every = self._noted = OFTEN  # the later notes are of another way
        for one in stack:
            choice = one.options[one.next - 1]
            if choice == one.options[0]:
                continue
            self.settled += 1
            waiting = self._window[one.index].tick.taken
            now_ns = self._window[one.index].tick.now_ns
            usual = one.options[0]
            moved = range(min(choice.last, usual.last), max(choice.last, usual.last))
            carried = 0
            for number in moved:
                if 0 <= number - carried < len(waiting):
                    distance = now_ns - waiting[number - carried][0]
                    self.late_ns = distance + 1 if choice.last < usual.last else distance

    def _first_choice(self, tick: Tick) -> Choice | None:
        """What a tick has read most likely; None for all."""
        stepper = self._stepper
        if tick.starts and not tick.reloaded:
            return self._at_start(tick)[0]
        if not self.late_ns or not tick.taken or tick.now_ns - tick.taken[-1][0] >= self.late_ns:
            return None
        waiting = stepper.waiting(tick)
        last = len(waiting)
        while last > len(stepper.carried) and tick.now_ns - waiting[last - 1][0] < self.late_ns:
            last -= 1
        return Choice(0, last)

    def _at_start(self, tick: Tick) -> list[Choice]:
        """What came before the daemon listened is lost to it, and when that was is not known."""
        waiting = self._stepper.waiting(tick)
        opened_ns = tick.sent[0][0] - OPENED_NS
        usual = next((i for i, (time, _) in enumerate(waiting) if time >= opened_ns), len(waiting))
        order = sorted(range(len(waiting) + 1), key=lambda first: abs(first - usual))
        return [Choice(first, len(waiting)) for first in order]

    def _options(self, index: int) -> list[Choice]:
        """Ways to read the log at a tick, the most likely first."""
        stepper, tick = self._stepper, self._window[index].tick
        if tick.starts and not tick.reloaded:
            return self._at_start(tick)
        waiting = stepper.waiting(tick)
        usual = self._first_choice(tick) or Choice(0, len(waiting))
        lasts = [len(waiting)]
        open_ns = max(OPEN_PART * stepper.deployment.config.tick_ms * 1e6, tick.late_ns)
        least = len(stepper.carried)
        for number in range(len(waiting) - 1, least - 1, -1):
            time_ns, frame = waiting[number]
            if tick.now_ns - time_ns > open_ns:
                break
            if self._news(frame, index, number - least):
                lasts.append(number)
        if usual.last not in lasts:
            lasts.append(usual.last)
        lasts.sort(key=lambda last: abs(last - usual.last))
        # What the newest tick sends by its clock, a heartbeat or a claim, is decided there, too.
        tie = index == len(self._window) - 1 or self._tie(tick)
        shifts = [0, -TIE_NS, TIE_NS] if tie else [0]
        if len(shifts) > 1 and tick.late_ns > TIE_NS:
            shifts.append(-tick.late_ns)
        missed = tick.number - stepper.number - 1
        return [
            Choice(0, last, shift, earlier)
            for last in lasts
            for shift in shifts
            for earlier in range(min(max(missed, 0), MOST_EARLIER) + 1)
        ]

    def _news(self, frame: Frame, index: int, number: int) -> bool:
        """Whether a frame says something else than the one of its message before."""
        key = frame[:3]
        for i in range(index, max(-1, index - 16), -1):
            taken = self._window[i].tick.taken
            for _, other in reversed(taken[:number] if i == index else taken):
                if other[:3] == key:
                    return self._content(key, other.data) != self._content(key, frame.data)
        return True

    def _content(self, key: Key, data: bytes) -> object:
        """What a frame says, without its alive counter and checksum."""
        bound = self._inputs.get(key)
        if not isinstance(bound, BoundJoystick) or len(data) != bound.message.length:
            return data
        raw, commands = bound.codec.decode(data)
        config = bound.config
        return commands, [
            raw.get(n or "") for n in (config.enable, config.reset, config.anti_sway_off)
        ]

    def _tie(self, tick: Tick) -> bool:
        """Whether an input, or the tick before, is just about as old as it may be."""
        standstill = self._stepper.standstill
        gap_ns = tick.now_ns - standstill.last_ns - standstill.limit_ns
        if abs(gap_ns) < TIE_NS + tick.late_ns:
            return True
        for key, bound in self._inputs.items():
            heard_ns = self._stepper.heard.get(key)
            if heard_ns is not None:
                age_ns = tick.now_ns - heard_ns - bound.config.timeout_ms * 1_000_000
                if abs(age_ns) < TIE_NS + tick.late_ns:
                    return True
        return False


NOTHING = Result([], {}, [])


def _inputs(stepper: Stepper) -> dict[Key, BoundInput]:
    deployment = stepper.deployment
    return {key: bound for bound in deployment.inputs() for key in bound.keys}
