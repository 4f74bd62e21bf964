"""A log without ticks drives the controller at those of a clock."""

from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.cli.common import loader
from canshaper.machine.deployment import Deployment
from canshaper.recording.replay import Replay, look
from tests.golden.replay import DRIVE
from tests.rigs.files import machine_file

Load = Callable[[], Deployment]


def replayed(path: Path, load: Load | None = None) -> Replay:
    deployment = (load or loader("forwarder.yaml"))()
    replay = Replay(deployment, look(deployment, path, {}, own=False))
    for _ in replay.run(lambda _part: None):
        pass
    return replay


def drive() -> list[str]:
    """The joystick frames of the recorded drive."""
    return DRIVE.read_text(encoding="ascii").splitlines(keepends=True)


def written(tmp_path: Path, rows: list[str]) -> Path:
    path = tmp_path / "drive.log"
    path.write_text("".join(rows), encoding="ascii")
    return path


def test_one_missing_joystick_is_a_warning(tmp_path: Path) -> None:
    replay = replayed(written(tmp_path, [row for row in drive() if " 111#" not in row]))
    replay.check_joysticks()
    assert list(replay.warnings()) == [
        "no joystick frame of JoystickRight, id 0x111 on crane",
        "lift was never ready: no joystick message (JOYSTICK_TIMEOUT)",
    ]


def test_an_axis_that_was_never_ready_is_named_with_what_it_waited_for(tmp_path: Path) -> None:
    assert replayed(DRIVE).never_ready == {}
    rows = [f"({n // 50}.{n % 50 * 20:03d}000) vcan0 110#{0:016X}\n" for n in range(300)]
    replay = replayed(written(tmp_path, rows))
    said = [text for text in replay.warnings() if text.startswith(("slew", "near_far"))]
    why = "was never ready: enable is off (ENABLE_OFF)"
    assert said == [f"slew {why}", f"near_far {why}"]


def test_a_log_that_is_cut_off_is_replayed_up_to_there(tmp_path: Path) -> None:
    rows = drive()
    path = written(tmp_path, [*rows[:900], rows[900][:20]])
    (warning,) = replayed(path).warnings()
    assert f"{path}:901: the log is cut off" in warning
    assert warning.endswith("replayed up to there")


def test_a_clock_ticks_from_the_first_joystick_frame_to_the_last_frame() -> None:
    deployment = loader("forwarder.yaml")()
    replay = Replay(deployment, look(deployment, DRIVE, {}, own=False))
    ticks = list(replay.run(lambda _part: None))
    assert [tick.number for tick, _ in ticks] == list(range(len(ticks)))
    assert len(ticks) == pytest.approx(900, abs=2)
    assert replay.received["crane", 0x110, False] == sum(" 110#" in row for row in drive())
    assert any(row.applied for _, result in ticks for row in result.rows.values())
    assert replay.verdict.compared == 0


def test_what_another_daemon_has_sent_is_no_second_sender(tmp_path: Path) -> None:
    rows = drive()
    sent = [row.split()[0] + " crane 200#0000000000000000\n" for row in rows]
    both = [row for pair in zip(rows, sent, strict=True) for row in pair]
    path = written(tmp_path, both)
    deployment = loader("forwarder.yaml")()
    replay = Replay(deployment, look(deployment, path, {}, own=False))
    events = [text for _, result in replay.run(lambda _part: None) for text in result.events]
    assert events
    assert not [text for text in events if "SECOND_SENDER" in text]


@pytest.mark.parametrize("interface", ["socketcan", "slcan"])
def test_a_joystick_is_lost_by_the_stamp_of_its_last_frame_or_by_the_tick_before(
    tmp_path: Path, interface: str
) -> None:
    other = ("interface: socketcan", f"interface: {interface}")
    deployment = loader(str(machine_file(tmp_path, "forwarder", other)))()
    rows = drive()
    at = next(i for i, row in enumerate(rows) if row.startswith("(5.5"))
    until = next(i for i, row in enumerate(rows) if row.startswith("(6.5"))
    path = written(tmp_path, [*rows[:at], *rows[until:]])
    last_ns = round(float(rows[at - 1].split(")")[0].strip("(")) * 1e9)
    replay = Replay(deployment, look(deployment, path, {}, own=False))
    lost = [
        tick.now_ns
        for tick, result in replay.run(lambda _part: None)
        for event in result.events
        if "JOYSTICK_TIMEOUT" in event and "axis=slew" in event and tick.now_ns > last_ns
    ]
    limit_ns = last_ns + deployment.joysticks["left"].config.timeout_ms * 1_000_000
    tick_ns = 20_000_000
    early_ns = 0 if interface == "socketcan" else tick_ns
    assert limit_ns - early_ns < lost[0] <= limit_ns + tick_ns
