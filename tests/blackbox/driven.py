"""A drive of a daemon with trips, after which it leaves black boxes."""

import zipfile
from pathlib import Path

from typer.testing import CliRunner

from canshaper.blackbox import write
from canshaper.cli.app import app
from canshaper.daemon.daemon import Daemon
from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench

SECOND = 50  # ticks
TRIP = 3 * SECOND


def drive(bench: Bench, folder: Path | None, ticks: int, trips: tuple[int, ...] = (TRIP,)) -> None:
    """A drive in which the driver lets go of the enable switch, for a tenth of a second each."""

    def script(number: int) -> None:
        held = all(not trip <= number < trip + 5 for trip in trips)
        reset = any(trip + 20 <= number < trip + 25 for trip in trips)
        centred = any(trip <= number < trip + 40 for trip in trips) or number < 10
        bench.joysticks(
            Slew=0 if centred else 500 + number % 300, Enable=int(held), Reset=int(reset)
        )
        if number == ticks:
            bench.stop()

    bench.script = script
    Daemon(lambda: load_deployment(bench.file), folder).run()


def replayed(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["replay", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return result.output


def inside(box: Path, folder: Path) -> Path:
    """The black box in a bundle, by itself."""
    path = folder / write.BOX
    path.write_bytes(zipfile.ZipFile(box).read(write.BOX))
    return path


def verified(folder: Path, name: str = "machine-0001.zip") -> str:
    """Verify a box of the folder by replay; return what the command prints."""
    return replayed(folder / name, "--verify", "--out", folder.parent / "out")
