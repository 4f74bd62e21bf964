"""The ticks of the loop: those of the daemon that a log was taken from, or those of a clock.

A log has no ticks, but a daemon sends its valve frames at them, so they can be found again. A tick
that was missed leaves a hole; its number is what a steady grid says. That grid is followed as the
clocks of log and daemon drift apart.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import lcm

from canshaper.codec.frame import Frame
from canshaper.recording.sorting import Key, Kind

Timed = tuple[int, Frame]
Sorted = tuple[int, Frame, Kind]
# How far two clocks drift apart, as a part of the time; NTP turns a clock by no more.
DRIFT = 5e-4
# Neutral frames so long after the last frames are those of another daemon.
RESTART_NS = 1_000_000_000
# So soon after neutral frames no daemon starts: it is the same one, with its files read again.
RELOAD_NS = 250_000_000
# What waits before a start has been read by then; older frames were for nobody.
WAITED_NS = 2_000_000_000
# Ticks by which the grid is found.
LEAST_HELD = 50
# A node of J1939 waits a quarter of a second for its address.
SETTLED_NS = 500_000_000
# Every axis is in neutral, and nothing changes any more, when no frame has come for so long: the
# longest timeout and the longest stop are over.
PAUSE_NS = 12_000_000_000
LEAD_NS = 1_000_000_000
# Where the periods of all messages fall together; those of a machine do after some hundred ticks.
MOST_BASES = 10_000


@dataclass(slots=True)
class Tick:
    """One tick, as the log has it.

    Attributes:
        number: of its deadline, from 0.
        now_ns: when, by the first frame that it sent.
        late_ns: how long after its deadline that is; it has read in between.
        taken: frames that came since the tick before, in order.
        others: those among them that are read after the valves were told.
        sent: what the daemon sent, by the log.
        starts: a daemon starts with it; True for one that has sent neutral frames before.
        reloaded: or has begun anew with its files read again.
        ends: neutral frames follow, of a daemon that stops or reads its files again.
        open: the last one in the log; of what it sent the end may be missing.
        says: of a daemon that ran before: what it sends with this tick and soon after.
    """

    number: int
    now_ns: int
    taken: list[Timed] = field(default_factory=list)
    others: list[Frame] = field(default_factory=list)
    sent: list[Timed] = field(default_factory=list)
    starts: bool = False
    reloaded: bool = False
    ends: bool = False
    late_ns: int = 0
    open: bool = False
    says: list[Timed] = field(default_factory=list)


def clocked(frames: Iterable[Sorted], tick_ns: int) -> Iterator[Tick]:
    """Ticks of a clock, from half a tick after the first frame that is taken to the last frame.

    What a daemon has sent is left out: it is another daemon's. Of a pause that is longer than
    ``PAUSE_NS`` the ticks after that are left out, but for the last ones before the next frame.
    """
    tick: Tick | None = None
    for time_ns, frame, kind in frames:
        if tick is None:
            if kind is not Kind.TAKEN:
                continue
            tick = Tick(0, time_ns + tick_ns // 2, starts=True)
        quiet_ns = tick.now_ns
        while time_ns > tick.now_ns:
            yield tick
            now_ns = tick.now_ns + tick_ns
            if now_ns - quiet_ns > PAUSE_NS and time_ns - now_ns > LEAD_NS:
                now_ns += (time_ns - LEAD_NS - now_ns) // tick_ns * tick_ns
            tick = Tick(tick.number + 1, now_ns)
        if kind is Kind.TAKEN:
            tick.taken.append((time_ns, frame))
        elif kind is Kind.OTHER:
            tick.others.append(frame)
    if tick is not None:
        yield tick


class Recovery:
    """Finds the ticks of a daemon by the frames that it sent.

    Args:
        tick_ns: time between two ticks.
        marker: the message that is sent first in a tick, and its period in ticks.
        neutral: the first neutral frame of it that a daemon sends when it starts.
        count: alive counter of such a frame; None where it has none.
        periods: period in ticks of what is sent less often.
    """

    def __init__(
        self,
        tick_ns: int,
        marker: tuple[Key, int],
        neutral: bytes,
        *,
        count: Callable[[bytes], int] | None,
        periods: Mapping[Key, int],
    ) -> None:
        self._tick_ns = tick_ns
        self._marker, self._marker_ticks = marker
        self._neutral = neutral
        self._count = count
        self._periods = periods
        # Those that are not in every tick.
        self._statuses = {key for key, period in periods.items() if period > 1}
        self._kept = max(LEAST_HELD, *(4 * period for period in periods.values()), 0)
        self._held: list[Tick] | None = None  # the first of a daemon, until its grid is known
        self._last: Tick | None = None
        self._extra: Tick | None = None  # for a deadline that had its tick: neutral at the end?
        self._step = 0
        self._grid_ns = 0  # when deadline 0 was, as far as the drift goes

    def ticks(self, frames: Iterable[Sorted]) -> Iterator[Tick]:
        """Every tick, once the next one has come."""
        head: Tick | None = None
        before: Tick | None = None
        for burst in self._bursts(frames):
            if head is not None:
                if self._count or burst.now_ns - head.now_ns < self._tick_ns // 2:
                    _begin_with(head, burst)
                    burst.starts = True
                    self._held = [burst]
                else:  # without a counter a neutral frame may look like the first one
                    self._held = [head, burst]
                head, before = None, burst
                continue
            if self._is_first(burst, before):
                yield from self._end()
                head = burst
                continue
            if self._extra is not None and self._loop_begins(burst):
                yield from self._end()  # its files were read again
                burst.starts = burst.reloaded = True
            before = burst
            if self._held is None and self._last is None:
                self._held = [burst]
            elif self._held is not None:
                self._held.append(burst)
                if len(self._held) > self._kept:
                    yield from self._settle()
            else:
                yield from self._place(burst)
        if head is not None:
            self._held = [head]
        yield from self._end()

    def _bursts(self, frames: Iterable[Sorted]) -> Iterator[Tick]:
        """What lies between two frames of the marker, without numbers."""
        burst: Tick | None = None
        taken: list[Timed] = []
        others: list[Frame] = []
        early: list[Timed] = []
        marker = self._marker
        for time_ns, frame, kind in frames:
            if kind is Kind.TAKEN:
                taken.append((time_ns, frame))
                continue
            if kind is not Kind.SENT:
                others.append(frame)
                continue
            if frame[:3] == marker:
                if burst is not None:
                    yield burst
                burst = Tick(-1, time_ns, taken, others, [*early, (time_ns, frame)])
                taken, others, early = [], [], []
            elif burst is None:
                continue
            elif frame.bus != self._marker[0] and self._ahead(burst, time_ns):
                early.append((time_ns, frame))
            else:
                burst.sent.append((time_ns, frame))
        if burst is not None:
            yield burst

    def _ahead(self, burst: Tick, time_ns: int) -> bool:
        """Whether a frame of another bus belongs to the next tick: it may be a little earlier."""
        return time_ns - burst.now_ns > self._marker_ticks * self._tick_ns // 2

    def _marker_data(self, burst: Tick) -> bytes:
        return next(frame.data for _, frame in burst.sent if frame[:3] == self._marker)

    def _is_first(self, burst: Tick, before: Tick | None) -> bool:
        """Whether these are the neutral frames of a daemon that starts."""
        if self._marker_data(burst) != self._neutral:
            return False
        if before is None:
            return True
        passed_ns = burst.now_ns - before.now_ns
        reloaded = self._count is not None and passed_ns < RELOAD_NS
        ended = self._extra is not None and not reloaded
        return ended or passed_ns > RESTART_NS

    def _loop_begins(self, burst: Tick) -> bool:
        """Whether a daemon that goes on counting has a new loop: its first tick sends all status.

        Without a counter its neutral frames look like those of a start, see ``_is_first``.
        """
        sent = {frame[:3] for _, frame in burst.sent}
        return bool(self._statuses) and self._statuses <= sent

    # -- numbers -------------------------------------------------------------------------------

    def _end(self) -> Iterator[Tick]:
        """Hand out all there is of one daemon."""
        yield from self._settle()
        last, extra = self._last, self._extra
        if last is not None:
            if extra is not None:
                last.sent += extra.sent
            last.ends, last.open = extra is not None, extra is None
            yield last
        self._last = self._extra = None

    def _settle(self) -> Iterator[Tick]:
        """Number the first ticks of a daemon, whose grid is known now."""
        held, self._held = self._held, None
        if not held:
            return
        self._grid_ns = self._phase([tick.now_ns for tick in held])
        first = held[0]
        self._grid_ns += (
            (first.now_ns - self._grid_ns + self._slack) // self._tick_ns * self._tick_ns
        )
        first.number, self._last, self._step = 0, first, 1
        placed: list[Tick] = []
        for tick in held[1:]:
            placed += self._place(tick)
        if first.starts:
            yield from placed
            return
        ran_before = [*placed, self._last]
        base = self._base(ran_before)
        for tick in ran_before:
            tick.number += base
        self._grid_ns -= base * self._tick_ns
        first.says = [one for tick in ran_before for one in tick.sent]
        yield from placed

    @property
    def _slack(self) -> int:
        return self._tick_ns // 50

    def _phase(self, times_ns: Sequence[int]) -> int:
        """When a deadline is: most ticks come soon after theirs."""
        rests = sorted({time_ns % self._tick_ns for time_ns in times_ns})
        near_ns = self._tick_ns // 4

        def followers(begin: int) -> int:
            return sum((rest - begin) % self._tick_ns < near_ns for rest in rests)

        best = max(rests, key=followers)
        return best - self._tick_ns * (times_ns[0] < best)

    def _place(self, tick: Tick) -> Iterator[Tick]:
        """Number a tick, and hand out the one before it."""
        if self._extra is not None:  # no end: a tick that was very late
            extra, self._extra = self._extra, None
            yield from self._numbered(extra, self._next_number())
        number = self._number(tick)
        if number < self._next_number():
            self._extra = tick
        else:
            yield from self._numbered(tick, number)

    def _next_number(self) -> int:
        assert self._last is not None  # there is one, where ticks are numbered
        return self._last.number + 1

    def _number(self, tick: Tick) -> int:
        """Number of the deadline that a tick was for, by the grid."""
        last = self._last
        assert last is not None
        # The grid is that of the most punctual ticks so far. Before a deadline comes no tick of
        # it, but one that is late for the deadline before may.
        quarter_ns = self._tick_ns // 4
        number, part_ns = divmod(tick.now_ns - self._grid_ns + quarter_ns, self._tick_ns)
        if part_ns - quarter_ns < -self._slack and number > last.number + 1:
            number -= 1
        if number <= last.number and self._step > 1:
            last.number -= 1  # it was late, and the one before it was not missed
            self._step -= 1
        return number

    def _numbered(self, tick: Tick, number: int) -> Iterator[Tick]:
        """Take a tick with its number; the grid follows the clocks."""
        last = self._last
        assert last is not None
        self._step = number - last.number
        drift_ns = round(DRIFT * (tick.now_ns - last.now_ns))
        self._grid_ns = min(self._grid_ns + drift_ns, tick.now_ns - number * self._tick_ns)
        tick.number, self._last = number, tick
        tick.late_ns = max(0, tick.now_ns - number * self._tick_ns - self._grid_ns)
        yield last

    def _base(self, ticks: Sequence[Tick]) -> int:
        """Number of the first tick of a daemon that ran before, by what it sends less often."""
        longest = min(lcm(self._marker_ticks, *self._periods.values()), MOST_BASES)
        seen = [
            (tick.number, period)
            for tick in ticks
            for _, frame in tick.sent
            if (period := self._periods.get(frame[:3], 1)) > 1
        ]
        best = max(
            range(longest),
            key=lambda base: sum((number + base) % period == 0 for number, period in seen),
        )
        # What a node does at its start is over by then, as it is in the log.
        return best + longest * -(-SETTLED_NS // (longest * self._tick_ns))


def _begin_with(head: Tick, first: Tick) -> None:
    """Put neutral frames of a start to the first tick, which has read what waited by then."""
    since_ns = head.now_ns - WAITED_NS
    first.taken = [timed for timed in head.taken if timed[0] > since_ns] + first.taken
    first.sent = head.sent + first.sent
