"""The black box of a daemon: what a trip leaves behind, and what replay makes of it."""

import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.blackbox import keeper, write
from canshaper.blackbox.file import read_box
from canshaper.codec.frame import BusState
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper.recording.log import LogFile
from canshaper.shaping.shapers.gff import Gff
from tests.blackbox.driven import SECOND, TRIP, drive, inside, replayed, verified
from tests.daemon.bench import Bench, FakePort


def test_a_trip_leaves_a_file_that_is_played_the_same(box: Path, tmp_path: Path) -> None:
    assert box.name == "machine-0001.zip"
    out, export = tmp_path / "out", tmp_path / "drive.mcap"
    text = replayed(box, "--verify", "--out", out, "--export", export)
    exported, log = (list(LogFile(path)) for path in (export, out / "machine.log"))
    assert [frame[2:] for frame in exported] == [frame[2:] for frame in log]
    assert "the ticks are those of the daemon that the black box is of" in text
    assert "frames sent, every one the same to the last bit" in text
    assert "state=TRIPPED from=ACTIVE reason=ENABLE_LOST" in text
    data = json.loads((out / "replay.json").read_text())["machine"]
    # From the first tick until five seconds after the trip, or until its first writer has ended.
    assert TRIP + 5 * SECOND + 1 <= data["ticks"] <= TRIP + 8 * SECOND + 1
    assert data["compared"]["frames"] > 3 * data["ticks"]
    about = json.loads(zipfile.ZipFile(box).read("about.json"))
    assert about["why"].startswith("axis=slew state=TRIPPED")
    assert about["identity"] == load_deployment(tmp_path / "machine.yaml").identity.lines()


@pytest.mark.slow
def test_the_error_of_a_filter_is_in_log_and_file(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    step = Gff.step

    def fails(self: Gff, command: float) -> float:
        if command > 0.6:
            raise ZeroDivisionError("line 7")
        return step(self, command)

    monkeypatch.setattr(Gff, "step", fails)
    drive(bench, folder, TRIP, trips=())
    line = fails.__code__.co_firstlineno + 2
    text = "axis=slew state=TRIPPED from=ACTIVE reason=OUTPUT_INVALID"
    text += f" error=ZeroDivisionError: line 7 ({__file__}:{line})"
    assert text in [record.getMessage() for record in caplog.records]
    about = zipfile.ZipFile(folder / "machine-0001.zip").read("about.json")
    assert json.loads(about)["why"] == text
    assert text.partition(":")[0].removeprefix("axis=slew ") in verified(folder)


@pytest.mark.slow
def test_with_other_files_its_joysticks_drive_them(box: Path, tmp_path: Path) -> None:
    other, out = ("--config", "forwarder-robust.yaml"), tmp_path / "out"
    text = replayed(box, *other, "--out", out)
    assert "those of a clock: the black box is of other files" in text
    assert "reason=ENABLE_LOST" in text
    refused = replayed(box, *other, "--verify", "--out", out, code=2)
    assert "expected a black box of these files, without --config" in refused
    same = replayed(box, "--config", tmp_path / "machine.yaml", "--out", out)
    assert "every one the same to the last bit" in same


@pytest.mark.slow
def test_without_a_trip_or_a_folder_nothing_is_written(
    bench: Bench, folder: Path, log: Callable[[], list[str]]
) -> None:
    drive(bench, folder, TRIP, trips=())
    drive(bench, None, TRIP + 6 * SECOND)
    assert list(folder.iterdir()) == []
    assert log() == []


def test_it_is_written_at_once_whatever_the_other_axes_do(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the tick of the trip, and again when five seconds are over."""
    forks: list[int] = []
    fork = os.fork

    def forked() -> int:
        forks.append(bench.now_ns)
        return fork()

    monkeypatch.setattr(keeper.os, "fork", forked)
    monkeypatch.setattr(keeper.os, "WNOHANG", 0)
    monkeypatch.setattr(Controller, "neutral", False)
    drive(bench, folder, TRIP + 6 * SECOND)
    first, last = forks
    assert last - first == keeper.AFTER_NS
    assert first - bench.now_ns + 6 * 10**9 <= 20_000_000


@pytest.mark.slow
def test_the_copies_are_those_that_were_loaded(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not what is on the disk by then; a copy that was edited later is refused."""
    before = bench.file.read_bytes()
    happened = keeper.BlackBox._happened

    def edited(box: keeper.BlackBox, why: str, last_ns: int) -> None:
        bench.file.write_text(bench.text.replace("max_pct", "min_pct") + "\nnonsense: 1\n")
        happened(box, why, last_ns)

    monkeypatch.setattr(keeper.BlackBox, "_happened", edited)
    drive(bench, folder, TRIP + 10)
    path = folder / "machine-0001.zip"
    with zipfile.ZipFile(path) as bundle:
        members = {name: bundle.read(name) for name in bundle.namelist()}
    copy = next(name for name in members if name.endswith("machine.yaml"))
    absolute = [line for line in before.splitlines() if b"/" in line and b".dbc" in line]
    same = [line for line in members[copy].splitlines() if b".dbc" not in line]
    assert absolute
    assert same == [line for line in before.splitlines() if b".dbc" not in line]
    assert "same to the last bit" in replayed(path, "--verify", "--out", folder.parent / "out")
    for name in (copy, next(name for name in members if name.endswith(".dbc"))):
        with zipfile.ZipFile(path, "w") as bundle:
            for member, content in members.items():
                bundle.writestr(member, content + b"\n" * (member == name))
        text = replayed(path, "--out", folder.parent / "out", code=2)
        assert "expected the files that its daemon had loaded" in text.replace("\n", " ")


@pytest.mark.slow
def test_many_trips_make_a_file_a_minute_and_the_oldest_go(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch, log: Callable[[], list[str]]
) -> None:
    monkeypatch.setattr(write, "MOST_FILES", 2)
    monkeypatch.setattr(keeper, "BETWEEN_NS", 20 * 10**9)
    monkeypatch.setattr(keeper.os, "WNOHANG", 0)  # time passes quicker here than a file is written
    folder.mkdir()
    (folder / "another-0007.zip").touch()
    drive(bench, folder, 70 * SECOND, trips=tuple(range(TRIP, 69 * SECOND, 2 * SECOND)))
    assert len(log()) == 4  # at 3, 23, 43 and 63 s
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["another-0007.zip", "machine-0003.zip", "machine-0004.zip"]
    for name in names[1:]:
        verified(folder, name)


@pytest.mark.slow
def test_it_reaches_a_minute_back_and_not_much_further(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trip = 95 * SECOND
    drive(bench, folder, trip + 6 * SECOND, trips=(trip,))
    verified(folder)
    data = json.loads((folder.parent / "out" / "replay.json").read_text())["machine"]
    assert 60 * SECOND <= data["ticks"] <= 75 * SECOND + 1
    assert data["axes"]["slew"]["trips"] == 1


@pytest.mark.slow
def test_a_reload_of_the_same_files_is_played_through(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    joysticks, numbers = bench.joysticks, iter(range(10_000))

    def before(**raw: int) -> None:
        if next(numbers) in (10, TRIP + 30):
            bench.reload()
        joysticks(**raw)

    monkeypatch.setattr(bench, "joysticks", before)
    drive(bench, folder, TRIP + 6 * SECOND)
    box = read_box(inside(folder / "machine-0001.zip", folder.parent))
    assert [segment.follows for segment in box.segments].count(False) == 3
    verified(folder)


@pytest.mark.slow
def test_frames_that_were_not_sent_are_not_sent_again(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The axis trips in the replay as it did then; a bus that is off, and its faults, count too."""
    off: list[str] = []
    on_bus_off = Controller.on_bus_off

    def counted(controller: Controller, bus: str) -> None:
        off.append(bus)
        on_bus_off(controller, bus)

    monkeypatch.setattr(Controller, "on_bus_off", counted)
    send, joysticks, numbers = FakePort.send, bench.joysticks, iter(range(10_000))

    def before(**raw: int) -> None:
        number = next(numbers)
        bench.ports[0].state = BusState.BUS_OFF if 60 <= number < 70 else BusState.UP
        joysticks(**raw)

    monkeypatch.setattr(bench, "joysticks", before)
    monkeypatch.setattr(
        FakePort, "send", lambda port, frame: port.state is BusState.UP and send(port, frame)
    )
    drive(bench, folder, 8 * SECOND, trips=())
    assert len(off) == 10
    assert "state=TRIPPED from=ACTIVE reason=SEND_FAILED" in verified(folder)
    assert len(off) == 20
