"""The commands as a user calls them."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.cli.common import loader
from canshaper.recording.log import read_log
from tests.recording.daemon import Hardness, log_of

DATA = Path(__file__).parent / "data"
GOLDEN = Path(__file__).parents[1] / "golden"


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """The log of a daemon, 6 s."""
    path = tmp_path / "drive.log"
    path.write_text("".join(log_of(loader("forwarder.yaml"), 1, Hardness(), seconds=6.0)))
    return path


def called(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["replay", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return result.output


def test_a_daemons_log_is_the_same_to_the_last_bit(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    text = called(drive, "--config", "forwarder.yaml", "--verify", "--out", out)
    assert "every one the same to the last bit" in text
    assert "not the same" not in text
    data = json.loads((out / "replay.json").read_text())["forwarder"]
    assert data["compared"]["different"] == data["compared"]["service_different"] == 0
    assert data["compared"]["frames"] > 1000
    assert data["heard"] == {"crane 0x110": 349, "crane 0x111": 349}  # the last come too late
    assert data["axes"]["slew"]["stops"] == 0
    assert (out / "replay.png").read_bytes().startswith(b"\x89PNG")
    assert "axis=slew state=READY" in (out / "forwarder.events.txt").read_text()


def test_the_new_log_has_what_the_daemon_sent_and_can_be_replayed(
    drive: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    called(drive, "--config", "forwarder.yaml", "--out", out)

    def sent(path: Path) -> list[tuple[int, bytes]]:
        return [(f.can_id, f.data) for f in read_log(path) if f.can_id >= 0x200]

    assert sent(out / "forwarder.log") == sent(drive)
    again = called(
        out / "forwarder.log", "--config", "forwarder.yaml", "--verify", "--out", tmp_path / "2"
    )
    assert "not the same" not in again


def test_two_deployments_side_by_side(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    both = ("--config", "forwarder.yaml", "--config", "forwarder-robust.yaml")
    text = called(drive, *both, "--out", out, "--verify", code=1)
    assert "forwarder-robust" in text
    data = json.loads((out / "replay.json").read_text())
    peaks = [data[n]["axes"]["slew"]["replayed"]["peak_deg"] for n in data]
    straight = [data[n]["axes"]["slew"]["straight"]["peak_deg"] for n in data]
    assert len(set(peaks)) == 2
    assert max(peaks) < min(straight)
    assert (out / "forwarder-robust.log").exists()


def test_the_same_file_twice_has_two_names(drive: Path, tmp_path: Path) -> None:
    called(drive, "--config", "forwarder.yaml", "--config", "forwarder.yaml", "--out", tmp_path)
    one, two = (tmp_path / f"forwarder-{n}.log" for n in (1, 2))
    assert one.read_bytes() == two.read_bytes()


def test_a_drive_without_a_daemon_goes_through_the_controller(tmp_path: Path) -> None:
    text = called(GOLDEN / "drive.log", "--config", "forwarder-robust.yaml", "--out", tmp_path)
    assert "those of a clock (no valve frames of this deployment)" in text
    data = json.loads((tmp_path / "replay.json").read_text())["forwarder-robust"]
    assert data["compared"] is None
    assert data["seconds"] == pytest.approx(18.0, abs=0.1)
    assert data["axes"]["slew"]["trips"] > 0  # the enable switch is released in motion
    events = (tmp_path / "forwarder-robust.events.txt").read_text()
    assert "state=TRIPPED from=ACTIVE reason=ENABLE_LOST" in events


def test_part_of_a_drive(drive: Path, tmp_path: Path) -> None:
    called(drive, "--config", "forwarder.yaml", "--from", "1", "--to", "2", "--out", tmp_path)
    data = json.loads((tmp_path / "replay.json").read_text())["forwarder"]
    assert data["ticks"] == pytest.approx(300, abs=2)  # of which 50 are drawn


def test_a_bundle_is_replayed_with_its_own_deployment(tmp_path: Path) -> None:
    text = called(DATA / "stalled.zip", "--verify", "--out", tmp_path)
    assert "the log begins while the daemon runs" in text
    assert "2020 frames of valves and axes in the log, every one the same" in text


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ("", "found no data frame"),
        ("(1.0) vcan0 7FF#00\n(2.0) vcan0 7FF#00\n", "none of its joystick messages (JoystickLeft"),
        ("(1.0) can3 110#00\n(2.0) can4 110#00\n", "bus crane: found the channels 'can3', 'can4'"),
        ("(2.0) vcan0 110#00\n(1.0) vcan0 110#00\n", "found mixed clocks: a time 1.000 s before"),
        ("nothing\n", "x.log:1: found 'nothing', allowed is a line of candump -L"),
    ],
)
def test_a_log_that_cannot_be_used_is_told(tmp_path: Path, rows: str, text: str) -> None:
    log = tmp_path / "x.log"
    log.write_text(rows)
    arguments = [log, "--config", "forwarder.yaml", "--out", tmp_path / "out"]
    assert text in called(*arguments, code=2).replace("\n", " ").replace("x.log: 1", "x.log:1")


def test_options_that_cannot_be(drive: Path, tmp_path: Path) -> None:
    file = ("--config", "forwarder.yaml", "--out", tmp_path)
    assert "which deployment?" in called(drive, code=2)
    assert "found sundial" in called(drive, *file, "--ticks", "sundial", code=2)
    assert "allowed is --channel BUS=CHANNEL" in called(drive, *file, "--channel", "can0", code=2)
    assert "found the bus joy, allowed are crane" in called(
        drive, *file, "--channel", "joy=can0", code=2
    )
    golden = GOLDEN / "drive.log"
    assert "--ticks daemon: found no valve frames" in called(
        golden, *file, "--ticks", "daemon", code=2
    )
    assert "No such file" in called(tmp_path / "none.log", *file, code=2)


def test_with_the_ticks_of_a_clock_a_daemons_log_is_one_of_joysticks(
    drive: Path, tmp_path: Path
) -> None:
    text = called(drive, "--config", "forwarder.yaml", "--ticks", "clock", "--out", tmp_path)
    assert "those of a clock (as asked)" in text
    data = json.loads((tmp_path / "replay.json").read_text())["forwarder"]
    assert data["compared"] is None
    assert data["axes"]["slew"]["trips"] == 0  # what that daemon sent is no second sender
