"""How long canshaper reads a log, next to python-can: each format, in the same run.

Both read the same file, which python-can wrote (GVRET's and the screen's ours, next to python-can's
own table and candump -L). Above 1.5 is too slow.

    python benchmarks/logs.py [--frames 100000] [--runs 5]
"""

import argparse
import tempfile
import time
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from random import Random

import can
from measure import medians_s

from canshaper.recording.log import LogFile

START_S = 1_763_750_000
FORMATS = ("log", "asc", "blf", "csv", "db", "trc", "mf4")


def messages(count: int) -> list[can.Message]:
    """Frames of a bus with 20 ids."""
    random = Random(5)
    return [
        can.Message(
            timestamp=START_S + 0.0005 * number,
            channel=1,
            arbitration_id=0x18FEF100 + number % 20 if number % 2 else 0x100 + number % 20,
            is_extended_id=bool(number % 2),
            data=random.randbytes(8),
        )
        for number in range(count)
    ]


def screen(path: Path, frames: Iterable[can.Message]) -> None:
    """As ``candump -t a`` shows it."""
    with path.open("w", encoding="ascii") as file:
        for frame in frames:
            can_id = f"{frame.arbitration_id:0{8 if frame.is_extended_id else 3}X}"
            data = frame.data.hex(" ").upper()
            file.write(f" ({frame.timestamp:.6f})  can1  {can_id}   [{frame.dlc}]  {data}\n")


def gvret(path: Path, frames: Iterable[can.Message]) -> None:
    """As SavvyCAN writes it."""
    with path.open("w", encoding="ascii") as file:
        file.write("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n")
        for frame in frames:
            wide = "true" if frame.is_extended_id else "false"
            file.write(f"{frame.timestamp * 1e6:.0f},{frame.arbitration_id:08X},{wide},Rx,1,8,")
            file.write(frame.data.hex(",").upper() + ",\n")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    frames = messages(arguments.frames)
    print(f"{arguments.frames} frames; CPU time of canshaper and of python-can, medians")
    with tempfile.TemporaryDirectory() as folder:
        files: dict[str, tuple[Path, Path]] = {}
        for suffix in FORMATS:
            path = Path(folder) / f"drive.{suffix}"
            try:
                with can.Logger(path) as writer:
                    for frame in frames:
                        writer.on_message_received(frame)
                    if suffix == "db":  # its thread leaves what it has not written after that
                        while writer.num_frames < len(frames):
                            time.sleep(0.1)
            except NotImplementedError:
                print(f"{suffix:7} needs asammdf")
                continue
            files[suffix] = path, path
        for name, write, like in (("screen", screen, "log"), ("gvret", gvret, "csv")):
            path = Path(folder) / f"{name}.{like}"
            write(path, frames)
            files[name] = path, files[like][1]
        for name, (ours, theirs) in files.items():
            works = {
                "ours": lambda path=ours: deque(LogFile(path), 0),
                "theirs": lambda path=theirs: deque(can.LogReader(path), 0),
            }
            first, second = medians_s(works, arguments.runs).values()
            print(f"{name:7} {first:6.3f} s and {second:6.3f} s: {first / second:.2f} times")


if __name__ == "__main__":
    main()
