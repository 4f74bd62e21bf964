"""Faults rehearsed at the real daemon, in front of an operator who does as the announcement says.

The rules judge by the frames that are on the buses, and know of no rehearsal: for them every
joystick is sound, so what the daemon does by a rehearsed fault beyond what they allow is a wrong
move.
"""

import functools
import random
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from canshaper.codec.frame import Frame
from canshaper.commissioning.procedure.rehearsed import Row, judged
from canshaper.daemon.rehearsal.fault import Fault
from canshaper.daemon.rehearsal.faults import rehearsed_faults
from canshaper.machine.binding import load_deployment
from tests.faults.bench import Bench, Loader
from tests.faults.machine import Machine
from tests.faults.rules import Rules
from tests.faults.shipped import directory
from tests.faults.world import World
from tests.rigs.files import text_of

CONTROL = "\ncontrol:\n  rehearse_faults: true\n"
HALF = 0.5
Report = Mapping[str, Any]
# What the operator does in a tick: enable, reset and deflection.
Hand = Callable[["Rehearsed", float], tuple[int, int, float]]


@functools.cache
def slow_file(name: str) -> Path:
    """A shipped deployment at reduced speed, which allows rehearsed faults."""
    text = text_of(name)
    text = re.sub(r"(\n *|[{ ])(rise_per_s: [125])(?=[,\n])", r"\1max_pct: 40,\1\2", text)
    text = re.sub(r"(max_pct: 40),(?=\n)", r"\1", text).replace("max_pct: 50", "max_pct: 40")
    path = Path(directory().name) / f"{name}-rehearsed.yaml"
    path.write_text(text + CONTROL, encoding="utf-8")
    return path


@functools.cache
def faults_of(name: str) -> dict[str, Fault]:
    """The faults that can be rehearsed at it."""
    return rehearsed_faults(load_deployment(slow_file(name)))


def held(run: "Rehearsed", _since_s: float) -> tuple[int, int, float]:
    """Hold every joystick at half while the fault waits and acts, where something has to move."""
    return 1, 0, HALF * bool(run.fault.axes) * (run.report["phase"] in ("armed", "made"))


class Rehearsed:
    """A daemon at which faults are rehearsed, one after another.

    Args:
        name: the deployment.
        names: the faults.
        hand: what the operator does from the request on, by the time since then.

    Attributes:
        answers: how each ended.
        fault: the one that is rehearsed.
        report: what the daemon said of it last.
        present: whether the client goes on asking.
        made_s: when a hand saw that it was made.
        refused: why the daemon has refused a fault.
        settles: the joystick comes back before the next fault.
    """

    def __init__(self, name: str, names: list[str], hand: Hand = held, seed: int = 1) -> None:
        self.machine = machine = Machine(name, slow_file(name))
        self.world = World(machine, random.Random(seed), 1, [], self._put)
        self.rules = Rules(machine)
        self.bench = Bench(self.world, self.rules, Loader(slow_file(name)))
        self.bench.control = self  # type: ignore[assignment]
        self.deployment = load_deployment(slow_file(name))
        self.faults, self._names, self._hand = faults_of(name), names, hand
        self.answers: dict[str, Report] = {}
        self.fault, self.report = self.faults[names[0]], dict[str, Any]()
        self.present = self.settles = True
        self.made_s: float | None = None
        self.refused = ""
        for axis, bound in self.deployment.axes.items():
            if bound.feedback:
                every_ns = bound.feedback.config.timeout_ms * 250_000
                self.world.every(every_ns, every_ns, lambda axis=axis: self._feedback(axis))
        self._script = self._drive()
        self._wait_s = 0.0
        self._over = False
        self.world.healthy = (1, 0, 0.0)

    def _feedback(self, axis: str) -> None:
        """A valve follows."""
        bound = self.deployment.axes[axis].feedback
        assert bound is not None
        signal, full = bound.signal, bound.config.full or float(bound.signal.maximum)
        code = (self.rules.axes[axis].velocity * full - signal.offset) / signal.scale
        raw = {one.name: 0 for one in bound.message.signals} | {signal.name: round(code)}
        self._put(Frame(*bound.key, bound.layout.encode(raw)), self.world.now_ns)

    def _put(self, frame: Any, now_ns: int) -> None:
        self.bench.put(frame, now_ns)

    def run(self, limit_s: float = 3000.0) -> dict[str, Report]:
        """Rehearse them all."""
        self.bench.run(limit_s)
        assert self._over, f"{self.fault.name} did not end: {self.report}"
        return self.answers

    def verdicts(self) -> list[Row]:
        """Return the text that a person reads."""
        return [judged(self.faults[n], one, self.deployment) for n, one in self.answers.items()]

    # -- the client, and the operator ------------------------------------------------------------

    def serve(self, answer: Callable[[Mapping[str, Any], str], Any], now_ns: int) -> None:
        self._answer = answer
        if self.world.now_ns / 1e9 >= self._wait_s and not self._over:
            try:
                self._wait_s = self.world.now_ns / 1e9 + next(self._script)
            except StopIteration:
                self._over = True
                self.world.at(self.world.now_ns + 1, lambda: self.bench.signal(15))

    def close(self) -> None: ...

    def ask(self, what: str) -> Report:
        """Ask the daemon."""
        answer: Report = self._answer({"fault": what}, "bench")["fault"]
        return answer

    def refusal(self, what: str) -> str:
        """Why the daemon refuses."""
        try:
            self.ask(what)
        except ValueError as error:
            return str(error)
        return ""

    def _drive(self) -> Iterator[float]:
        world = self.world
        yield 5.0 if self.machine.nodes else 1.5
        for name in self._names:
            # Cause gone, overrun and other sender forgotten, then a press in neutral.
            if self.settles:
                yield from self._press()
            self.made_s = None
            self.fault, since_s = self.faults[name], world.now_ns / 1e9
            self.refused = self.refusal(name)
            if self.refused:
                return
            self.report = dict(self.ask("report"))
            while self.report["phase"] != "done":
                world.healthy = self._hand(self, world.now_ns / 1e9 - since_s)
                yield 0.0 if self.present else 4.0
                self.report = dict(self.ask("report"))
            self.answers[name] = self.report
            self.present = True
            if self.settles:
                world.healthy = (1, 0, 0.0)
                yield 2.5

    def _press(self) -> Iterator[float]:
        for enable in (1, 0, 1):
            self.world.healthy = (enable, 0, 0.0)
            yield 0.4
