"""A bundle has all that a replay needs, wherever it is unpacked."""

import json
import random
import re
import shutil
import zipfile
from pathlib import Path

import pytest

from canshaper.errors import LogError
from canshaper.machine.binding import load_deployment
from canshaper.recording.listen import History, HistoryEvent
from canshaper.recording.record import history_lines, pack, unpack
from tests.rigs.files import ROOT


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A deployment in a tree of its own, its DBC file next to the folder of the file."""
    (tmp_path / "here" / "config").mkdir(parents=True)
    (tmp_path / "here" / "dbc").mkdir()
    shutil.copy(ROOT / "dbc" / "forwarder.dbc", tmp_path / "here" / "dbc")
    path = tmp_path / "here" / "config" / "forwarder.yaml"
    shutil.copy(ROOT / "config" / "forwarder.yaml", path)
    return path


def packed(machine: Path, tmp_path: Path) -> Path:
    log = tmp_path / "some.log"
    log.write_text("(1.0) can0 110#00\n")
    deployment = load_deployment(machine)
    history = History(deployment)
    history.changes.append(HistoryEvent(1_763_750_000_123_000_000, "axis=slew state=READY"))
    history.counted_ns = 1_763_750_001_000_000_000
    history.counters, history.last_fault = {"MissedDeadlines": 3}, "MISSED_DEADLINE"
    bundle = tmp_path / "bundle.zip"
    pack(bundle, log, deployment, history, {"seconds": 1.5})
    return bundle


def test_a_bundle_is_unpacked_to_a_deployment_that_loads(machine: Path, tmp_path: Path) -> None:
    bundle = packed(machine, tmp_path)
    before = machine.read_text()
    shutil.rmtree(tmp_path / "here")
    log, file = unpack(bundle, tmp_path / "there")
    assert log.read_text() == "(1.0) can0 110#00\n"
    assert file.read_text() == before
    assert set(load_deployment(file).axes) == {"slew", "near_far", "lift"}
    assert not list(tmp_path.glob("*.part"))


def test_an_absolute_path_is_made_a_relative_one(machine: Path, tmp_path: Path) -> None:
    other = tmp_path / "elsewhere"
    other.mkdir()
    shutil.move(tmp_path / "here" / "dbc" / "forwarder.dbc", other)
    text = machine.read_text().replace("../dbc/forwarder.dbc", str(other / "forwarder.dbc"))
    machine.write_text(text)
    bundle = packed(machine, tmp_path)
    shutil.rmtree(other)
    _, file = unpack(bundle, tmp_path / "there")
    assert load_deployment(file).axes


@pytest.mark.parametrize("relative", [False, True])
def test_files_of_one_name_in_two_folders_stay_two(
    machine: Path, tmp_path: Path, *, relative: bool
) -> None:
    """One path is also the end of the other, and both files have the same name."""
    first = tmp_path / "d" / "forwarder.dbc"
    second = f"e{first}" if relative else f"{tmp_path / 'e'}{first}"
    for path in (first, machine.parent / second):
        path.parent.mkdir(parents=True)
    shutil.move(tmp_path / "here" / "dbc" / "forwarder.dbc", first)
    other = 'VERSION ""\nBU_: A\nBO_ 1000 Other: 8 A\n SG_ S : 0|8@1+ (1,0) [0|1] "" A\n'
    (machine.parent / second).write_text(other)
    text = machine.read_text()
    assert "dbc: [../dbc/forwarder.dbc]" in text
    machine.write_text(text.replace("../dbc/forwarder.dbc", f"{first}, {second}"))
    before = load_deployment(machine).identity.content
    _, file = unpack(packed(machine, tmp_path), tmp_path / "there")
    assert load_deployment(file).identity.content == before


def test_what_else_is_in_it(machine: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(packed(machine, tmp_path)) as bundle:
        about = json.loads(bundle.read("about.json"))
        history = bundle.read("history.txt").decode().splitlines()
    assert about["seconds"] == 1.5
    assert about["buses"] == {"crane": "socketcan vcan0"}
    assert {"canshaper", "python", "python-can", "cantools", "kernel"} <= about["versions"].keys()
    assert history == [
        "2025-11-21T18:33:20.123+00:00 axis=slew state=READY",
        "2025-11-21T18:33:21.000+00:00 counters MissedDeadlines=3 last_fault=MISSED_DEADLINE",
    ]


def test_without_status_the_history_is_empty(machine: Path) -> None:
    assert history_lines(History(load_deployment(machine))) == []


def test_what_is_no_bundle_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    path.write_bytes(b"PK no zip")
    with pytest.raises(LogError, match=r"x.zip: not a bundle: .*, got BadZipFile"):
        unpack(path, tmp_path / "there")
    with zipfile.ZipFile(path, "w") as bundle:
        bundle.writestr("readme.txt", "nothing")
    with pytest.raises(LogError, match=r"not a bundle: .*, got KeyError"):
        unpack(path, tmp_path / "there")
    for name, got in (("none.zip", "No such file or directory"), ("", "Is a directory")):
        says = f"{tmp_path / name}: expected a bundle that can be read, got {got}"
        with pytest.raises(LogError, match=f"^{re.escape(says)}$"):
            unpack(tmp_path / name, tmp_path / "there")


def damaged(bundle: Path, signature: bytes, at: int, value: bytes) -> Path:
    """The bundle with other bytes in the last header of that kind: those of history.txt."""
    content = bytearray(bundle.read_bytes())
    start = content.rindex(signature) + at
    content[start : start + len(value)] = value
    bundle.write_bytes(content)
    return bundle


@pytest.mark.parametrize(
    ("damage", "got"),
    [
        ((b"PK\x01\x02", 8, b"\x01"), "RuntimeError .* is encrypted"),
        ((b"PK\x01\x02", 10, b"\x63"), "NotImplementedError"),
        ((b"PK\x03\x04", 30 + len("history.txt"), b"\xff" * 4), "error Error -3 while"),
    ],
    ids=["encrypted", "compressed in an unknown way", "damaged"],
)
def test_a_member_that_cannot_be_read_is_reported(
    machine: Path, tmp_path: Path, damage: tuple[bytes, int, bytes], got: str
) -> None:
    bundle = damaged(packed(machine, tmp_path), *damage)
    with pytest.raises(LogError, match=f"bundle.zip: history.txt: not a bundle: .*, got {got}"):
        unpack(bundle, tmp_path / "there")


def test_a_bundle_damaged_anywhere_is_reported(machine: Path, tmp_path: Path) -> None:
    bundle = packed(machine, tmp_path)
    content, dice = bundle.read_bytes(), random.Random(1)
    for _ in range(300):
        one = bytearray(content)
        # Twice of three times in the directory at its end, where nearly every byte counts.
        where = dice.randrange(dice.choice([0, len(one) - 500, len(one) - 500]), len(one))
        one[where] = dice.randrange(256)
        bundle.write_bytes(one)
        try:
            log, file = unpack(bundle, tmp_path / "there")
        except LogError as error:
            assert str(bundle) in str(error)
        else:
            assert log.is_file()
            assert file.is_file()
        shutil.rmtree(tmp_path / "there", ignore_errors=True)


def test_a_bundle_without_its_log_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(path, "w") as bundle:
        bundle.writestr("about.json", json.dumps({"log": "a.log", "deployment": "a.yaml"}))
        bundle.writestr("a.yaml", "")
    with pytest.raises(LogError, match=r"x\.zip: not a bundle: expected a\.log in it, got none"):
        unpack(path, tmp_path / "there")


def test_a_bundle_cannot_point_out_of_itself(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(path, "w") as bundle:
        about = {"log": "../../etc/passwd", "deployment": "a.yaml"}
        bundle.writestr("about.json", json.dumps(about))
    with pytest.raises(LogError, match="a path leads out of it"):
        unpack(path, tmp_path / "there")
