"""How many times faster than real time a log is replayed, next to python-can only reading it.

The log is a drive of the closed loop as a daemon's own bus carries it: joysticks, valves, status
and what the simulated crane reports, some 410 frames a second. Replayed as the black box of that
daemon, every frame compared, and as a log at the ticks of a clock; without table and picture.

    python benchmarks/replay.py [--minutes 10] [--runs 3] [--config forwarder.yaml]
"""

import argparse
import resource
import tempfile
from collections.abc import Callable
from itertools import count
from pathlib import Path

import can
from measure import Figure, medians_s, publish

from canshaper.blackbox.file import SUFFIX, chunks
from canshaper.blackbox.recorder import Recorder
from canshaper.blackbox.ring import Ring
from canshaper.blackbox.state import States
from canshaper.blackbox.write import header_of
from canshaper.cli.common import loader
from canshaper.cli.verbs.replay import _without_collector
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.recording.log import LogFile
from canshaper.recording.replay import Replay, look
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import script_named
from canshaper_sim.plant import PlantNode

TICK_NS = 20_000_000
PEER = "python-can reads its log"
BOX = "replay of the black box"
FIGURES = (Figure("replay of a minute, s", PEER),)
START_NS = 1_763_750_000_000_000_000


def write_drive(path: Path, box: Path, seconds: float, config: str) -> int:
    """Log and black box of a drive of so many seconds; how many lines the log has."""
    load = loader(config)
    deployment = load()
    controller, ring = Controller(deployment), Ring(most_blocks=10_000)
    gated = GatedController(controller)
    state = States(gated, controller).save()
    recorder = Recorder(gated, controller, ring)
    ring.begin(state, 0, follows=False)
    plant = PlantNode(load())
    lines = 0
    with path.open("w", encoding="ascii") as file:

        def log(time_ns: int, frame: Frame) -> None:
            nonlocal lines
            lines += 1
            second, ns = divmod(START_NS + time_ns, 10**9)
            text = f"({second}.{ns // 1000:06d}) vcan0 {frame.can_id:03X}#"
            file.write(f"{text}{frame.data.hex().upper()}\n")

        for frame in recorder.neutral_frames():
            log(0, frame)
        joysticks: JoystickNode | None = None
        ends_ms, seed = 0, count(1)
        for number in range(round(seconds * 1e9) // TICK_NS):
            now_ns = number * TICK_NS
            if number * 20 >= ends_ms:
                script = script_named(f"random-{next(seed)}", list(deployment.axes))
                joysticks, begin_ms = JoystickNode(deployment, script), number * 20
                ends_ms += round(script.duration_s * 1000)
            assert joysticks is not None
            for frame in joysticks.frames(number * 20 - begin_ms):
                log(now_ns + 1_000, frame)
                recorder.receive(frame, now_ns)
            for i, frame in enumerate(recorder.tick(now_ns)):
                log(now_ns + 100_000 + 30_000 * i, frame)
                plant.receive(frame)
            recorder.flush()
            plant.advance(0.02)
            for i, frame in enumerate(plant.feedback()):
                log(now_ns + 10_000_000 + 100_000 * i, frame)
                recorder.receive(frame, now_ns)
    box.write_bytes(b"".join(chunks(header_of(deployment, "benchmark"), ring.segments)))
    return lines


def replay(path: Path, config: str) -> None:
    """Replay all of it; of a black box every frame has to be the same."""
    deployment = loader(config)()
    one = Replay(deployment, look(deployment, path, {}, own=path.suffix == SUFFIX))
    with _without_collector():
        for _ in one.run(lambda _part: None):
            pass
    assert not one.verdict.different, one.verdict
    assert one.exact == bool(one.verdict.compared)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--config", default="forwarder-robust.yaml")
    arguments = parser.parse_args()
    config = arguments.config
    seconds = 60.0 * arguments.minutes
    with tempfile.TemporaryDirectory() as folder:
        path, box = Path(folder) / "drive.log", Path(folder) / f"drive{SUFFIX}"
        lines = write_drive(path, box, seconds, config)
        print(f"{arguments.minutes:g} minutes, {lines} frames, {path.stat().st_size / 1e6:.1f} MB")
        before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        works: dict[str, Callable[[], object]] = {
            PEER: lambda: sum(1 for _ in can.LogReader(path)),
            "canshaper reads it": lambda: sum(1 for _ in LogFile(path)),
            BOX: lambda: replay(box, config),
            "replay, ticks of a clock": lambda: replay(path, config),
        }
        times = medians_s(works, arguments.runs)
        for title, time_s in times.items():
            print(f"{title:33} {time_s:6.2f} s, {seconds / time_s:6.0f} x real time")
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb
        print(f"memory grown by {grown / 1024:.1f} MiB")
    minute_s = {title: time_s / arguments.minutes for title, time_s in times.items()}
    publish(FIGURES, [(minute_s[BOX], minute_s[PEER])])


if __name__ == "__main__":
    main()
