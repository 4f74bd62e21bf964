"""Cost of the live page: pictures a second, and how late the daemon is with and without it.

Two daemons and two cranes on udp_multicast as ``canshaper studio`` starts them, with joysticks that
move all the time, for so many seconds without a page, then with both cranes in a headless Chromium,
and so on in turn. Lateness is that of every tick of the shaped crane's daemon, which has the
priority of its unit where that is permitted. Where there is no graphics card, Chromium draws on the
same cores.

    python benchmarks/studio.py
    python benchmarks/studio.py --seconds 60 --rounds 5
"""

import argparse
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from measure import Row, conditions, print_table, quantile
from rig import CONFIG, ROOT

sys.path.insert(0, str(ROOT))

import observed
import uvicorn
from playwright.sync_api import Browser

from canshaper.studio.access import Access
from canshaper.studio.commission import Commission
from canshaper.studio.crane import copied, groups
from canshaper.studio.server import build_app, listening, server
from canshaper.studio.stage import SHAPED, Stage
from canshaper.studio.words import Events
from canshaper_sim.crane import CraneParameters
from tests.studio.browser import NoBrowserError, browser, opened

HAND_S = 0.02
STROKE_S = 2.0
DEFLECTION = 0.5
SETTLE_S = 3.0
SIZE = {"width": 1280, "height": 800}
AXES = ("slew", "near_far", "lift")
# A hand that waves to and fro, as a gamepad; the same as `wave` below.
WAVE = """() => {
  const wave = () => {
    const part = (performance.now() / 1000 / %(stroke)s) %% 2;
    return (part < 1 ? 1 : -1) * %(most)s * (1 - Math.abs(2 * (part %% 1) - 1));
  };
  navigator.getGamepads = () => [{ connected: true, axes: [wave(), wave(), 0, wave()] }];
}"""
REST = "() => { navigator.getGamepads = () => []; }"
INTERVALS = """(ms) => new Promise((done) => {
  const gaps_ms = [];
  let last = null;
  const end = performance.now() + ms;
  const picture = (now) => {
    if (last !== null) gaps_ms.push(now - last);
    last = now;
    if (now < end) requestAnimationFrame(picture);
    else done(gaps_ms);
  };
  requestAnimationFrame(picture);
})"""


@dataclass
class Condition:
    """Figures of one condition."""

    late_us: list[float] = field(default_factory=list)
    missed: int = 0
    pictures_ms: list[float] = field(default_factory=list)
    load: list[float] = field(default_factory=list)
    windows: list[tuple[int, int]] = field(default_factory=list)


def be_daemon(notes: str) -> None:
    """The daemon with notes of its ticks: what follows is ``run`` and its options."""
    at = sys.argv.index("run")
    sys.argv = ["observed.py", "ticks", notes, *sys.argv[at + 1 :]]
    observed.main()


def wave() -> float:
    """Where the hand is now."""
    part = time.monotonic() / STROKE_S % 2.0
    side = 1.0 if part < 1.0 else -1.0
    return side * DEFLECTION * (1.0 - abs(2.0 * (part % 1.0) - 1.0))


class Hand(threading.Thread):
    """Drives while there is no page."""

    def __init__(self, stage: Stage) -> None:
        super().__init__(daemon=True)
        self._stage = stage
        self._end = threading.Event()
        self.resting = threading.Event()

    def run(self) -> None:
        """Send the joysticks until the end."""
        while not self._end.wait(HAND_S):
            at = 0.0 if self.resting.is_set() else wave()
            joysticks = dict.fromkeys(AXES, at)
            self._stage.with_cab(lambda cab, now_s, s=joysticks: cab.joysticks(0, s, now_s))

    def close(self) -> None:
        """Let go."""
        self._end.set()
        self.join()
        self._stage.with_cab(lambda cab, now_s: cab.leave(0, now_s))


def until(condition: Callable[[], bool], what: str) -> None:
    """Wait for something."""
    limit = time.monotonic() + 30.0
    while not condition():
        if time.monotonic() > limit:
            raise SystemExit(f"not within half a minute: {what}")
        time.sleep(0.05)


def levels(stage: Stage) -> set[str]:
    """Levels of the shaped crane's axes."""
    axes = stage.snapshot()["cranes"][SHAPED]["axes"]
    return {axis["level"] for axis in axes.values()}


def without_page(stage: Stage, seconds: float, result: Condition) -> None:
    """Measure with a hand of our own."""
    stage.with_cab(lambda cab, now_s: cab.take(0, now_s))
    hand = Hand(stage)
    hand.resting.set()
    hand.start()
    enable(stage, 0)
    hand.resting.clear()
    time.sleep(SETTLE_S)
    measured(result, lambda: time.sleep(seconds))
    hand.close()


def with_page(stage: Stage, one: Browser, url: str, seconds: float, result: Condition) -> None:
    """Measure with the page driving."""
    faults: list[str] = []
    page = opened(one, url, faults, viewport=SIZE)
    until(lambda: stage.snapshot()["driver"] not in (None, 0), "the page drives")
    enable(stage, stage.snapshot()["driver"])
    page.evaluate(WAVE % {"stroke": STROKE_S, "most": DEFLECTION})
    time.sleep(SETTLE_S)
    measured(result, lambda: result.pictures_ms.extend(page.evaluate(INTERVALS, 1000.0 * seconds)))
    page.evaluate(REST)
    page.context.close()
    if faults:
        print("the page had errors:", *faults, sep="\n  ")


def enable(stage: Stage, page: int) -> None:
    """Press enable as a page, once that of the driver before is released.

    Again, where the page was silent for a moment and lost it.
    """
    until(lambda: not stage.snapshot()["enable"], "enable released")

    def ready() -> bool:
        if not stage.snapshot()["enable"]:
            stage.with_cab(lambda cab, now_s: cab.press_enable(page, True, now_s))
        return levels(stage) == {"ready"}

    try:
        until(ready, "axes ready")
    except SystemExit as error:
        events = "\n".join(f"{e.source}: {e.text}" for e in stage.events.since(0)[-20:])
        raise SystemExit(f"{error}; last events:\n{events}") from None


def measured(result: Condition, work: Callable[[], Any]) -> None:
    """Note when some work began and ended."""
    begin = time.monotonic_ns()
    work()
    result.windows.append((begin, time.monotonic_ns()))
    result.load.append(os.getloadavg()[0])


@contextmanager
def serving(stage: Stage) -> Iterator[str]:
    """The page of a stage in a thread; its address."""
    one = listening("127.0.0.1", 0)
    port = one.getsockname()[1]
    web: uvicorn.Server = server(
        build_app(stage, Access(port), CraneParameters(), Commission(None, [], machine=False))
    )
    thread = threading.Thread(target=lambda: web.run(sockets=[one]))
    thread.start()
    try:
        yield f"http://127.0.0.1:{port}/"
    finally:
        web.should_exit = True
        thread.join()


def measure(seconds: float, rounds: int, directory: Path) -> tuple[Condition, Condition]:
    """Both conditions in turn."""
    notes = directory / "ticks"
    _, deployment = copied(CONFIG, directory)
    stage = Stage(deployment, Events())
    program = (sys.executable, __file__, "--daemon", str(notes))
    stage.drive(groups(2), directory, program=program)
    alone, shown = Condition(), Condition()
    stage.start(lambda: None)
    try:
        with serving(stage) as url, browser() as one:
            for _ in range(rounds):
                without_page(stage, seconds, alone)
                with_page(stage, one, url, seconds, shown)
    finally:
        stage.stop()
    for line in notes.read_text().splitlines():
        at, late, _, missed = map(int, line.split())
        for condition in (alone, shown):
            if any(begin <= at < end for begin, end in condition.windows):
                condition.late_us.append(late / 1e3)
                condition.missed += missed
    return alone, shown


def main() -> None:
    """Measure and print."""
    if "--daemon" in sys.argv:
        be_daemon(sys.argv[sys.argv.index("--daemon") + 1])
        return
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=20.0, help="of one window")
    parser.add_argument("--rounds", type=int, default=3, help="windows of each condition")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        try:
            alone, shown = measure(options.seconds, options.rounds, Path(name))
        except NoBrowserError as error:
            raise SystemExit(f"not measured: {error}") from None
    print(f"{conditions()}; lateness of ticks of 20 ms, us")
    rows = []
    for title, c in (("without page", alone), ("with page", shown)):
        late = [f"{quantile(c.late_us, q):.0f}" for q in (0.5, 0.99, 1.0)]
        load = f"{min(c.load):.1f} to {max(c.load):.1f}"
        rows.append(Row(title, [str(len(c.late_us)), *late, str(c.missed), load]))
    print_table(["ticks", "p50", "p99", "max", "missed", "load average"], rows)
    ratio = quantile(shown.late_us, 0.99) / quantile(alone.late_us, 0.99)
    print(f"p99 with the page is {ratio:.2f} of that without")
    intervals = shown.pictures_ms
    print(
        f"pictures: {1000.0 * len(intervals) / sum(intervals):.1f} a second,"
        f" interval p50 {quantile(intervals, 0.5):.1f} ms, p99 {quantile(intervals, 0.99):.1f} ms"
    )


if __name__ == "__main__":
    main()
