"""How long canshaper writes and reads frames as MCAP and MF4, next to the libraries' own readers.

Processor time. Reading is compared in the same run with mcap's reader and with python-can's of MF4
(by asammdf); above 1.5 is too slow, and so is below 100 000 frames written a second.

    python benchmarks/exports.py [--frames 1000000] [--runs 1]
"""

import argparse
import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import can
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from measure import medians_s

from canshaper.recording.form import Writer
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.log import LogFile
from canshaper.recording.mcap_write import McapWriter

START_NS = 1_763_750_000_000_000_000


def frames(count: int) -> list[ReceivedFrame]:
    """Frames of a bus with 20 ids."""
    random = Random(5)
    return [
        ReceivedFrame(
            START_NS + 500_123 * number,
            "crane",
            "can0",
            0x18FEF100 + number % 20 if number % 2 else 0x100 + number % 20,
            bool(number % 2),
            random.randbytes(8),
            "",
        )
        for number in range(count)
    ]


def write(make: Callable[[], Writer], made: list[ReceivedFrame]) -> None:
    """Write all of them."""
    writer = make()
    for frame in made:
        writer.frame(frame)
    writer.close()


def by_mcap(path: Path) -> Iterator[object]:
    """Messages in the order of their times, as mcap hands them out by itself."""
    with path.open("rb") as file:
        yield from make_reader(file).iter_messages()


def by_mcap_in_order(path: Path) -> Iterator[object]:
    """Frames in the order of the file."""
    with path.open("rb") as file:
        yield from StreamReader(file).records


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=1)
    arguments = parser.parse_args()
    made, runs = frames(arguments.frames), arguments.runs
    print(f"{len(made)} frames; processor time")
    with tempfile.TemporaryDirectory() as folder:
        mcap, mf4 = Path(folder) / "drive.mcap", Path(folder) / "drive.mf4"
        formats: dict[Path, tuple[Callable[[], Writer], dict[str, Callable[[], Iterator[object]]]]]
        formats = {
            mcap: (
                lambda: McapWriter(mcap),
                {"by time": lambda: by_mcap(mcap), "as written": lambda: by_mcap_in_order(mcap)},
            )
        }
        try:
            from canshaper.recording.mf4_write import Mf4Writer  # noqa: PLC0415

            own = {"python-can": lambda: iter(can.MF4Reader(mf4))}
            formats[mf4] = lambda: Mf4Writer(mf4, ["crane"]), own
        except ModuleNotFoundError as error:
            print(f"mf4 needs {error.name}")
        for path, (make, readers) in formats.items():
            (written_s,) = medians_s({"": lambda make=make: write(make, made)}, runs).values()
            size = path.stat().st_size / len(made)
            speed = len(made) / written_s
            print(f"{path.suffix}: written {speed:9.0f} frames/s, {size:.1f} bytes a frame")
            works = {"ours": lambda path=path: deque(LogFile(path), 0)}
            works |= {n: lambda reader=reader: deque(reader(), 0) for n, reader in readers.items()}
            ours, *others = medians_s(works, runs).items()
            for name, seconds in others:
                print(
                    f"  read {len(made) / ours[1]:.0f} frames/s, {name} {len(made) / seconds:.0f}:"
                    f" {ours[1] / seconds:.2f} times"
                )


if __name__ == "__main__":
    main()
