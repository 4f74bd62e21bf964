"""The folder of a black box: absent, not writable, full; and a state that cannot be saved."""

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.blackbox import keeper, write
from canshaper.blackbox.state import States
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.controller.gated import GatedController
from canshaper.daemon.reporter import Reporter
from canshaper.errors import StateError
from canshaper.machine.binding import load_deployment
from canshaper.shaping.states import Reason, State, Transition
from tests.blackbox.driven import SECOND, TRIP, drive, verified
from tests.daemon.bench import Bench


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_costs_one_line(
    bench: Bench, folder: Path, log: Callable[[], list[str]]
) -> None:
    folder.touch()
    drive(bench, folder / "boxes", TRIP + 20 * SECOND)
    assert log() == [f"black-box=not-written folder={folder / 'boxes'} Not a directory"]


def test_a_folder_is_made_where_it_is_not_there_or_goes(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "some" / "boxes"
    monkeypatch.setattr(keeper.os, "WNOHANG", 0)
    happened = keeper.BlackBox._happened

    def goes(box: keeper.BlackBox, why: str, last_ns: int) -> None:
        folder.rmdir()
        happened(box, why, last_ns)

    monkeypatch.setattr(keeper.BlackBox, "_happened", goes)
    drive(bench, folder, TRIP + 6 * SECOND)
    assert [path.name for path in folder.iterdir()] == ["machine-0001.zip"]


@pytest.mark.slow
def test_a_file_that_could_not_be_written_is_tried_again_and_said_until_then(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch, log: Callable[[], list[str]]
) -> None:
    """With what there was at first, however late it is."""
    folder.touch()
    monkeypatch.setattr(keeper.os, "WNOHANG", 0)
    summaries: list[str] = []
    summary = Reporter._summary

    def noted(reporter: Reporter, trouble: list[str]) -> str:
        summaries.append(summary(reporter, trouble))
        if len(summaries) == 90:
            folder.unlink()
        return summaries[-1]

    monkeypatch.setattr(Reporter, "_summary", noted)
    drive(bench, folder, 100 * SECOND)
    said = [one.startswith("black box not written: File exists, slew") for one in summaries]
    assert said == sorted(said, reverse=True)
    assert 90 <= said.index(False) <= 96
    assert log()[0].startswith("black-box=not-written")
    assert log()[1:] == [log()[-1]]
    assert "black-box=written" in log()[-1]
    assert "reason=ENABLE_LOST" in verified(folder)


def test_on_a_full_disk_the_oldest_go(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.mkdir()
    for number in range(1, 6):
        (folder / f"machine-{number:04d}.zip").touch()
    (folder / "machine-0003.zip.part").touch()  # of a process that was killed
    fsync = os.fsync

    def full(descriptor: int) -> None:
        if stat.S_ISREG(os.fstat(descriptor).st_mode) and len(list(folder.glob("*.zip"))) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        fsync(descriptor)

    monkeypatch.setattr(write.os, "fsync", full)
    drive(bench, folder, TRIP + 10)
    names = sorted(path.name for path in folder.iterdir())
    assert names == [f"machine-{number:04d}.zip" for number in (4, 5, 6)]


def test_a_controller_that_can_no_longer_be_saved_ends_the_box_and_not_the_loop(
    bench: Bench, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It trips while a file that had failed is written, and the state of that tick is refused."""
    tripped = StateEvent("slew", Transition(State.ACTIVE, State.TRIPPED, Reason.SEND_FAILED))
    ends = [(1, errno.ENOSPC << 8), (1, 0)]
    monkeypatch.setattr(keeper.os, "fork", lambda: 1)
    monkeypatch.setattr(keeper.os, "waitpid", lambda *_: ends.pop(0))
    controller = Controller(load_deployment(bench.file))
    box = keeper.BlackBox(folder)
    box.around(GatedController(controller), controller)
    box.begin(0)
    box.after_tick(1, [tripped], neutral=False)
    box.after_tick(2, (), neutral=True)
    assert box.fault == os.strerror(errno.ENOSPC)
    box.after_tick(2 + keeper.RETRY_NS, (), neutral=True)

    def refused(states: States) -> bytes:
        raise StateError("no state")

    monkeypatch.setattr(States, "save", refused)
    box.after_tick(keeper.STATE_NS, [tripped], neutral=True)
    assert ends == []
    box.after_tick(keeper.STATE_NS + 1, (), neutral=True)
    assert (box.fault, box.report()["waits"]) == ("", False)
