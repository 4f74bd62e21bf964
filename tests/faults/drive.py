"""One random drive with faults, in lock-step against the real controller, under the judge's eyes.

Everything random comes from the seed: the machine, what the operator does, which faults come when.
"""

import random
from collections import Counter
from collections.abc import Callable
from typing import Any

from canshaper.codec.frame import Frame
from tests.faults import inject
from tests.faults.axis_judge import FOREIGN_NS
from tests.faults.fault import Fault
from tests.faults.gated import gated
from tests.faults.hand import path
from tests.faults.inputs import Joystick
from tests.faults.joystick_faults import joystick_frames
from tests.faults.judge import Judge, Violation
from tests.faults.machine import Machine
from tests.faults.senders import Sender, radius_frames
from tests.faults.variants import NAMES, machine

# Most of a drive's ticks lie under faults; the rest is the way back to normal work.
BODY_TICKS = (50, 110)
# Within so many ticks an axis moves that is commanded: a filter that still damps the last swing
# may hold it for a part of a swing of 2.4 s, never against the joystick.
MOVES_WITHIN = 75
# Punctual ticks after which an overrun of the loop is over.
OVERRUN_TICKS = 55


def plan(driven: Machine, rng: random.Random) -> tuple[int, list[Fault]]:
    """How many ticks lie under faults, and the faults."""
    ticks = rng.randint(*BODY_TICKS)
    return ticks, inject.random_faults(driven, rng, ticks)


class Drive:
    """A drive: what is sent, what comes back, and what the judge says of it."""

    def __init__(
        self,
        seed: int,
        controller_of: Callable[[Any], Any] = gated,
        trace: Callable[[str], None] | None = None,
    ) -> None:
        self.seed = seed
        self.rng = rng = random.Random(f"canshaper faults {seed}")
        self.machine, deployment = machine(NAMES[seed % len(NAMES)])
        self.ticks, self.faults = plan(self.machine, rng)
        self.controller: Any = controller_of(deployment)
        self.judge = Judge(self.machine)
        self.tick_number = 0  # ticks of the wall clock
        self._trace = trace
        self._untold = 0
        tick_ms = self.machine.tick_ms
        self.joysticks = {v.name: Sender(v, tick_ms, rng) for v in self.machine.joysticks.values()}
        self.stop = Sender(self.machine.stop, tick_ms, rng) if self.machine.stop else None
        self.switches = [Sender(one, tick_ms, rng) for one in self.machine.switches]
        self.paths = {
            name: path(rng, self.ticks, axis.signal.full, int(axis.band * axis.signal.full))
            for name, axis in self.machine.axes.items()
        }
        self.toggles = {
            name: (rng.randrange(self.ticks), rng.randrange(self.ticks)) for name in self.joysticks
        }
        self.toggled = rng.random() < 0.2
        self._radius = rng.randint(2000, 8000)
        self._waiting: list[Frame] = []
        # What a test changes between controller and buses, behind the judge's back.
        self.incoming: Callable[[Frame], Frame | None] = lambda frame: frame
        self.outgoing: Callable[[Frame], Frame | None] = lambda frame: frame

    @property
    def now_ns(self) -> int:
        return self.tick_number * self.machine.tick_ns

    def run(self) -> Counter[str]:
        """Drive; what was seen, counted.

        Raises:
            Violation: with seed, machine, time and what was allowed.
        """
        try:
            self._body()
            self._way_back()
            self._end()
        except Violation as violation:
            faults = "; ".join(map(str, self.faults)) or "no faults"
            raise Violation(
                f"seed {self.seed}, machine {self.machine.name}, tick {self.tick_number}"
                f" ({self.now_ns // 1_000_000} ms): {violation}\n  faults: {faults}\n"
                f"  again, tick by tick: python -m tests.faults {self.seed} --trace"
            ) from None
        stats = self.judge.stats
        stats.update({f"fault {f.kind}": 1 for f in self.faults})
        stats.update({"drives": 1, "ticks": self.tick_number, f"machine {self.machine.name}": 1})
        return stats

    # -- under faults -----------------------------------------------------------------------------

    def _body(self) -> None:
        while self.tick_number < self.ticks:
            active = [f for f in self.faults if f.active(self.tick_number)]
            passed, missed, stalled = self._loop(active)
            for _ in range(passed):
                self.tick_number += 1
                last = self.tick_number - 1
                joysticks = {n: p[min(last, self.ticks - 1)] for n, p in self.paths.items()}
                switches = {n: self._switches(v, last) for n, v in self.machine.joysticks.items()}
                self._take(joysticks, switches, active)
            if stalled:
                self._write_trace("stood still")
                self.judge.stalled()
                self.controller.stalled()
            self._step(missed, active)

    def _switches(self, joystick: Joystick, tick: int) -> dict[str, int]:
        raw = joystick.pressed()
        first, second = self.toggles[joystick.name]
        if self.toggled and joystick.off and min(first, second) <= tick < max(first, second):
            raw[joystick.off.name] = 1
        return raw

    def _loop(self, active: list[Fault]) -> tuple[int, int, bool]:
        """How the loop does.

        Returns:
            (ticks that pass before the next call, ticks reported as missed, whether it stood still
            for too long).
        """
        if self._untold:
            missed, self._untold = self._untold, 0
            return 0, missed, False
        limit = self.machine.longest_gap_ns // self.machine.tick_ns
        for fault in active:
            once = fault.start == self.tick_number or "done" not in fault.memory
            if fault.kind == "loop: late often":
                missed = fault.rng.choice((0, 1, 1, 2))
                return 1 + missed, missed, False
            if not once:
                continue
            if fault.kind == "loop: late once":
                fault.memory["done"] = True
                missed = fault.rng.randint(1, limit - 1)
                return 1 + missed, missed, False
            if fault.kind == "loop: late, reported later":
                # A loop that was held up in its sleep learns of it after the next body.
                fault.memory["done"] = True
                late = fault.rng.randint(2, limit)
                self._untold = late - 1
                return late, 0, False
            if fault.kind == "loop: stands still":
                fault.memory["done"] = True
                missed = limit + fault.rng.randint(0, 39)
                return 1 + missed, missed, True
        return 1, 0, False

    def _take(
        self,
        joysticks: dict[str, int],
        switches: dict[str, dict[str, int]],
        active: list[Fault],
    ) -> None:
        """Everything that is put on the buses in one tick of the clock."""
        frames: list[Frame] = []
        for name, joystick in self.machine.joysticks.items():
            sender = self.joysticks[name]
            raw = dict(switches[name])
            for axis in joystick.axes:
                raw |= axis.raw(joysticks[axis.name])
            due = range(sender.due(self.tick_number))
            sent = joystick_frames(joystick, [sender.counted(raw) for _ in due], active)
            frames += [Frame(*joystick.key, data) for data in sender.passed(sent)]
        frames += self._stop_frames(active)
        for sender in self.switches:
            source = sender.source
            for _ in range(sender.due(self.tick_number)):
                raw = sender.counted(dict(source.codes))
                sent = inject.input_frames(source, raw, active, inject.SWITCHES)
                frames += [Frame(*source.key, data) for data in sender.passed(sent)]
        frames += radius_frames(self.machine, self._radius, active)
        for fault in active:
            if extra := inject.EXTRA.get(fault.kind):
                frames += extra(fault)
        self._waiting += frames

    def _stop_frames(self, active: list[Fault]) -> list[Frame]:
        if (sender := self.stop) is None:
            return []
        frames: list[bytes] = []
        for _ in range(sender.due(self.tick_number)):
            raw = sender.counted({self.machine.stop_field.name: 0})
            frames += inject.input_frames(sender.source, raw, active, inject.STOP)
        return [Frame(*sender.source.key, data) for data in sender.passed(frames)]

    def _step(self, missed: int, active: list[Fault]) -> None:
        """One body of the loop."""
        now_ns = self.now_ns
        for frame in self._waiting:
            self._write_trace(f"   in {frame.bus} {frame.can_id:#05x} {frame.data.hex(' ')}")
            self.judge.receive(frame, now_ns)
            if (seen := self.incoming(frame)) is not None:
                self.controller.receive(seen, now_ns)
        self._waiting = []
        fails = {f.axis.valve_key for f in active if f.kind == "loop: valve not sent"}
        fails |= {f.axis.status_key for f in active if f.kind == "loop: status not sent"}
        sent, failed = [], []
        for made in self.controller.tick(now_ns, missed):
            if (frame := self.outgoing(made)) is None:
                continue
            sent.append(frame)
            if frame[:3] in fails:
                failed.append(frame)
                self.controller.send_failed(frame)
        if self._trace:
            self._show(sent, failed, missed, active)
        self.judge.tick(sent, failed, now_ns, missed)
        if self._trace:
            self._trace("      " + self.judge.words())

    # -- the way back -----------------------------------------------------------------------------

    def _way_back(self) -> None:
        """All faults are over: by the rules of docs/states.md every axis works again."""
        machine, rng = self.machine, self.rng
        cycles = max(a.period_ticks for a in machine.axes.values())
        # enough for frames that qualify, a state a tick, and valves that are served seldom
        some = 4 + 3 * cycles + max(v.qualify for v in machine.joysticks.values())
        kinds = {f.kind for f in self.faults}
        patient = rng.random() < (0.5 if machine.rest_ticks < 70 else 0.05)
        if patient:
            self._healthy(machine.rest_ticks, enable=1)
        if kinds & {"loop: late once", "loop: late often", "loop: late, reported later"}:
            self._healthy(OVERRUN_TICKS, enable=1)
        if "others: our valve" in kinds:
            self._healthy(FOREIGN_NS // machine.tick_ns, enable=1)
        resets = patient and all(v.reset for v in machine.joysticks.values())
        if resets and rng.random() < 0.5:
            self._healthy(some, enable=1, reset=0)
            self._healthy(some, enable=1, reset=1)
        else:
            self._healthy(some, enable=0)
        self._healthy(some, enable=1)
        for name, axis in self.judge.axes.items():
            if axis.state != 1:
                raise Violation(f"{name}: state {axis.state} on the way back, allowed is 1, READY")
        sign = rng.choice((-1, 1))
        moved: set[str] = set()
        for _ in range(MOVES_WITHIN):
            self._healthy(1, enable=1, deflected=sign)
            moved.update(n for n, axis in self.judge.axes.items() if axis.raw * sign > 0)
            if moved == self.judge.axes.keys():
                break
        if missing := self.judge.axes.keys() - moved:
            raise Violation(f"{', '.join(missing)}: does not move again, with everything healthy")

    def _healthy(self, ticks: int, enable: int, reset: int = 0, deflected: int = 0) -> None:
        axes = self.machine.axes.values()
        joysticks = {a.name: deflected * a.signal.full for a in axes}
        switches = {}
        for name, joystick in self.machine.joysticks.items():
            switches[name] = joystick.pressed(enable)
            if joystick.reset:
                switches[name][joystick.reset.name] = reset
        for _ in range(ticks):
            self.tick_number += 1
            self._take(joysticks, switches, [])
            missed, self._untold = self._untold, 0
            self._step(missed, [])

    def _end(self) -> None:
        """The last thing sent: every valve neutral."""
        frames = {f[:3]: f for f in self.controller.neutral_frames()}
        if frames.keys() != self.machine.valves.keys():
            raise Violation("neutral frames at the end: not those of every valve")
        for key, axis in self.machine.valves.items():
            if axis.sent(frames[key].data)[0] != 0:
                raise Violation(f"{axis.name}: the last frame is not neutral")

    # -- trace for a reader ------------------------------------------------------------------------

    def _write_trace(self, text: str) -> None:
        if self._trace:
            self._trace(text)

    def _show(
        self, sent: list[Frame], failed: list[Frame], missed: int, active: list[Fault]
    ) -> None:
        names = ", ".join(f.kind for f in active)
        late = f" missed {missed}" if missed else ""
        self._write_trace(f"{self.tick_number:4d} {self.now_ns // 1_000_000:6d} ms{late} {names}")
        for frame in sent:
            lost = " not sent" if frame in failed else ""
            self._write_trace(f"  out {frame.bus} {frame.can_id:#05x} {frame.data.hex(' ')}{lost}")
