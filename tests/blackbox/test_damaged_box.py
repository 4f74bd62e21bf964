"""A black box that is damaged, changed, or of another program: replay says so."""

import pickle
import re
import zlib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.blackbox.file import HEAD, MAGIC, read_box
from canshaper.blackbox.ring import RECORD, Kind, records
from canshaper.blackbox.state import States
from canshaper.cli.app import app
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.daemon.daemon import Daemon
from canshaper.errors import BoxError, StateError
from canshaper.machine.binding import load_deployment
from tests.blackbox.driven import inside, replayed
from tests.rigs.files import ROOT


@pytest.mark.slow
def test_one_bit_that_is_not_the_same_is_reported_with_its_time(box: Path, tmp_path: Path) -> None:
    path = inside(box, tmp_path)
    data = bytearray(path.read_bytes())
    at = data.index(b"\n", len(MAGIC)) + 1
    _, _, state, size, _ = HEAD.unpack_from(data, at)
    begin = at + HEAD.size + state
    valves = [
        begin + i * RECORD.size
        for i, record in enumerate(records(bytes(data[begin : begin + size])))
        if record.kind == Kind.TX and record.number == 0x200
    ]
    data[valves[30] + RECORD.size - 8] ^= 1
    checked(data, at, begin, size)
    path.write_bytes(data)
    text = replayed(path, *options(tmp_path), "--verify", code=1)
    assert "1 not the same" in text
    assert "0.600 s: crane SlewCommand: black box" in text


def options(folder: Path) -> list[str]:
    return ["--config", str(folder / "machine.yaml"), "--out", str(folder / "out")]


def checked(data: bytearray, at: int, begin: int, size: int) -> None:
    """Give a segment the check sum of what it has now."""
    data[at + HEAD.size - 4 : at + HEAD.size] = zlib.crc32(
        bytes(data[at + HEAD.size : begin + size])
    ).to_bytes(4, "little")


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.0, 0.001, 0.02, 0.5, 0.9, 0.999])
def test_one_that_is_cut_off_is_played_up_to_there_or_reported(
    box: Path, tmp_path: Path, part: float
) -> None:
    path = inside(box, tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: round(part * len(whole))])
    result = CliRunner().invoke(app, ["replay", str(path), *options(tmp_path)])
    assert result.exit_code == (0 if part > 0.1 else 2), result.output
    assert "Traceback" not in result.output
    text = result.output.replace("\n", "")
    assert "the file is cut off" in text if part > 0.01 else "expected " in text


@pytest.mark.slow
def test_a_byte_that_is_another_is_reported(box: Path, tmp_path: Path) -> None:
    path = inside(box, tmp_path)
    whole = path.read_bytes()
    for at in range(3, len(whole), len(whole) // 40):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        result = CliRunner().invoke(app, ["replay", str(path), *options(tmp_path)])
        assert result.exit_code in (0, 2), result.output
        assert result.exception is None or isinstance(result.exception, SystemExit)


@pytest.mark.parametrize(
    ("name", "lacking"),
    [(b"canshaper.codec.message", b"canshaper.codec.gone"), (b"_releases", b"_gone")],
)
def test_one_of_another_program_that_lacks_something_says_of_which(
    box: Path, tmp_path: Path, name: bytes, lacking: bytes
) -> None:
    path = inside(box, tmp_path)
    data = bytearray(path.read_bytes().replace(b"program=sha256:", b"program=sha256:0"))
    at = data.index(b"\n", len(MAGIC)) + 1
    _, _, state, size, _ = HEAD.unpack_from(data, at)
    begin = at + HEAD.size
    held = bytes(data[begin : begin + state])
    assert name in held
    data[begin : begin + state] = held.replace(name, lacking.ljust(len(name), b"_"))
    checked(data, at, begin + state, size)
    path.write_bytes(data)
    result = CliRunner().invoke(app, ["replay", str(path), *options(tmp_path)])
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    text = result.output.replace("\n", "")
    assert re.search(
        r"segment 1: .*; it was recorded by program=.*: play it with that version", text
    )


@pytest.mark.parametrize(
    "header",
    ["[]", "1", '"a"', '{"buses": [], "identity": [], "time_ns": 1e999}', '{"buses": 1}', "{", ""],
)
def test_a_header_of_other_content_is_reported(tmp_path: Path, header: str) -> None:
    path = tmp_path / "other.blackbox"
    path.write_bytes(MAGIC + header.encode() + b"\n")
    with pytest.raises(BoxError, match=r"other\.blackbox: header: expected what canshaper writes"):
        read_box(path)


class Hostile:
    def __reduce__(self) -> tuple[object, ...]:
        return (open, ("/tmp/canshaper-hostile", "w"))


def test_a_state_can_call_nothing_of_its_own(tmp_path: Path) -> None:
    deployment = load_deployment(ROOT / "config" / "forwarder.yaml")
    controller = Controller(deployment)
    states = States(GatedController(controller), controller)
    good = states.save()
    assert type(states.load(good)[1]) is Controller
    for bad in (
        pickle.dumps(Hostile(), 5),
        b"cos\nsystem\n(S'true'\ntR.",
        pickle.dumps(Daemon, 5),
        pickle.dumps(7, 5),
        good[:-20],
        b"",
    ):
        with pytest.raises(StateError):
            states.load(bad)
