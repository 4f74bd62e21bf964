"""``python -m tests.soak --minutes 30``, where vcan0 is (``make soak`` makes such a place)."""

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from tests.hil.hand import hand_on
from tests.hil.machine import open_bus, service
from tests.soak.drive import Soak
from tests.soak.sensor import relay, write_files
from tests.soak.witness import WrongMove, count_frames


def main() -> int:
    """Run for so long, print every count; status 1 with a wrong move."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="canshaper-soak-"))
    file, plant = write_files(folder)
    log = folder / "bus.log"
    wrong: list[str] = []
    begin = reported = time.monotonic()
    with (
        log.open("wb") as written,
        candump_into(written),
        service(folder / "daemon.log", "run", str(file)) as daemon,
        service(folder / "plant.log", "sim", str(plant)),
        open_bus("vcan0") as bus,
        hand_on("vcan0", folder / "protected.dbc") as hand,
        relay() as sensor,
    ):
        daemon.wait_log("started file=")
        memory = [_memory_kib(daemon.process.pid)]
        soak = Soak(daemon, hand, bus, log, relay=sensor, seed=options.seed)
        while time.monotonic() - begin < options.minutes * 60.0:
            try:
                soak.sequence()
            except WrongMove as error:
                wrong.append(str(error))
                print("WRONG", error, flush=True)
            if time.monotonic() - reported > 60.0:
                reported = time.monotonic()
                memory.append(_memory_kib(daemon.process.pid))
                minutes = (reported - begin) / 60.0
                print(
                    f"{minutes:.0f} min, {soak.counts['sequences']} sequences, "
                    f"{soak.counts['sequences with faults of the sensor']} of the sensor, "
                    f"{len(wrong)} wrong moves",
                    flush=True,
                )
        alive = daemon.process.poll() is None
        text = daemon.text()
    _report(soak.counts, count_frames(log), memory, text)
    print(f"wrong moves {len(wrong)}, the daemon {'ran on' if alive else 'ENDED'}")
    return 1 if wrong or not alive else 0


@contextmanager
def candump_into(file: IO[bytes]) -> Iterator[None]:
    """An independent log that goes on when the interface is down."""
    with subprocess.Popen(["candump", "-D", "-L", "vcan0"], stdout=file) as process:
        try:
            yield
        finally:
            process.terminate()


def _memory_kib(pid: int) -> int:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def _report(counts: Counter[str], frames: Counter[str], memory: list[int], log: str) -> None:
    for title, table in (("counted", counts), ("frames on the bus", frames)):
        print(f"\n{title}")
        for name, number in sorted(table.items(), key=lambda item: -item[1]):
            print(f"  {number:8d}  {name}")
    reasons = Counter(
        word.removeprefix("reason=") for word in log.split() if word.startswith("reason=")
    )
    print("\nreasons in the daemon's log")
    for name, number in reasons.most_common():
        print(f"  {number:8d}  {name}")
    print(f"\nmemory of the daemon, KiB: first {memory[0]}, last {memory[-1]}, most {max(memory)}")


if __name__ == "__main__":
    sys.exit(main())
