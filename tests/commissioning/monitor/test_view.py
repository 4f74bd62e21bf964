"""The view of the monitor: in 80 columns and 24 lines, and never by colour alone."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.commissioning.monitor.state import Monitor, bar, line_over_time
from canshaper.commissioning.monitor.view import HELP, Keys, screen, status_line
from canshaper.machine.deployment import Deployment
from canshaper.recording.listen import ReceivedFrame
from canshaper.shaping.states import Reason, State
from tests.rigs.files import machine_file
from tests.rigs.j1939 import bjm
from tests.rigs.reports import report
from tests.rigs.sent import status_frame

NOW = 1_763_750_000_000_000_000
MS = 1_000_000
COUNTERS = {
    "LastFault": 6,
    "MissedDeadlines": 3,
    "WrongLength": 0,
    "UnknownId": 0,
    "ErrorFrames": 0,
    "InvalidSignals": 0,
    "SendFailures": 0,
}


@pytest.fixture
def deployment() -> Deployment:
    return loader("forwarder.yaml")()


def received(frame: Frame | None, time_ns: int) -> ReceivedFrame:
    assert frame is not None
    return ReceivedFrame(time_ns, frame.bus, "vcan0", frame.can_id, frame.extended, frame.data, "")


def status_frames(
    deployment: Deployment,
    time_ns: int = NOW,
    state: State = State.ACTIVE,
    reason: Reason = Reason.JOYSTICK_MOVED,
) -> list[ReceivedFrame]:
    """Status of all axes and of the service."""
    frames = [
        received(status_frame(axis.status, report(state, reason, 0.5, -0.25, 3.4)), time_ns)
        for axis in deployment.axes.values()
        if axis.status
    ]
    assert deployment.status
    return [*frames, received(status_frame(deployment.status, COUNTERS), time_ns)]


def monitor_of(
    deployment: Deployment,
    time_ns: int = NOW,
    state: State = State.ACTIVE,
    reason: Reason = Reason.JOYSTICK_MOVED,
) -> Monitor:
    """A monitor that has received these status messages."""
    monitor = Monitor(deployment)
    for frame in status_frames(deployment, time_ns, state, reason):
        monitor.receive(frame)
    return monitor


def j1939(source: str, folder: Path) -> Deployment:
    """The machine of J1939, its left joystick with another line."""
    joystick = "    message: BJM1\n"
    file = machine_file(folder, "j1939-forwarder", (joystick, f"{joystick}{source}"))
    return loader(str(file))()


@pytest.mark.parametrize("source", ["", "    source: 0x33\n"])
def test_a_joystick_of_j1939_is_known_at_every_priority(tmp_path: Path, source: str) -> None:
    deployment = j1939(source, tmp_path)
    monitor = Monitor(deployment)
    for n, priority in enumerate((3, 6, 0)):
        monitor.receive(received(bjm("BJM1", 0x33, priority), NOW + n * MS))
    monitor.receive(received(bjm("BJM1", 0x35), NOW + 9 * MS))
    rate = monitor.messages[deployment.joysticks["left"].key]
    assert (len(rate.times), rate.last_ns) == (3, NOW + 2 * MS)


def text(monitor: Monitor, now_ns: int, width: int = 80, height: int = 24) -> list[str]:
    """The picture as a terminal without colours shows it."""
    file = io.StringIO()
    console = Console(width=width, height=height, no_color=True, record=True, file=file)
    console.print(screen(monitor, now_ns, width, height, plain=False))
    return console.export_text().splitlines()


def test_state_reason_bars_and_sway_of_an_axis(deployment: Deployment) -> None:
    monitor = monitor_of(deployment)
    lines = text(monitor, NOW + 100 * MS)
    assert lines[1].startswith(
        "slew        ACTIVE                 input ··········│█████·····  +50%"
    )
    assert lines[2].startswith(
        "            JOYSTICK_MOVED         valve ········██│··········  -25%  sway +3.4"
    )
    assert "sway" not in lines[6]  # lifting swings nothing
    assert any("missed 3" in line for line in lines)
    assert any("last fault MISSED_DEADLINE" in line for line in lines)


def test_it_fits_the_terminal(deployment: Deployment) -> None:
    monitor = Monitor(deployment)
    for i in range(300):
        reason = Reason.EMERGENCY_STOP_LOST if i % 2 else Reason.JOYSTICK_CONTRADICTORY
        for frame in status_frames(deployment, NOW + i * 100 * MS, State(i % 6), reason):
            monitor.receive(frame)
    for width, height in ((80, 24), (60, 12), (200, 60), (40, 8)):
        lines = text(monitor, NOW + 30_000 * MS, width, height)
        assert len(lines) <= height
        assert max(map(len, lines)) <= width
    assert len(text(monitor, NOW + 30_000 * MS, 80, 60)) > 50  # as many events as there is room


def test_before_anything_is_received_it_says_so(deployment: Deployment) -> None:
    lines = text(Monitor(deployment), NOW)
    assert "SILENT" in lines[0]
    assert sum("no status received" in line for line in lines) == 3
    assert any("no counters received" in line for line in lines)
    assert any("JoystickLeft 0 (50) NEVER" in line for line in lines)


def test_what_is_stale_says_stale(deployment: Deployment) -> None:
    monitor = monitor_of(deployment)
    fresh = "\n".join(text(monitor, NOW + 290 * MS))
    assert "STALE" not in fresh
    lines = text(monitor, NOW + 2_500 * MS)
    assert sum("STALE 2.5 s" in line for line in lines) == 4  # three axes and the counters
    assert any("SlewStatus 0 (10) SILENT 2.5s" in line for line in lines)
    assert "SILENT" in lines[0]
    assert "STALE 2.5s" in status_line(monitor, NOW + 2_500 * MS)


def test_rates_stand_next_to_those_of_the_dbc(deployment: Deployment) -> None:
    monitor = Monitor(deployment)
    for i in range(200):
        for can_id in (0x110, 0x111) if i % 2 else (0x110,):
            monitor.receive(received(Frame("crane", can_id, False, bytes(8)), NOW + i * 20 * MS))
    lines = "\n".join(text(monitor, NOW + 199 * 20 * MS))
    assert "JoystickLeft 50 (50)  " in lines
    assert "JoystickRight 25 (50) SLOW" in lines
    assert monitor.frames_per_s("crane", NOW + 199 * 20 * MS) == pytest.approx(75, abs=1)
    assert monitor.frames_per_s("crane", NOW + 10**10) == 0.0


def test_events_are_kept_with_their_time(deployment: Deployment) -> None:
    monitor = monitor_of(deployment, state=State.READY, reason=Reason.JOYSTICK_NEUTRAL)
    for frame in status_frames(deployment, NOW + 100 * MS, State.TRIPPED, Reason.ENABLE_LOST):
        monitor.receive(frame)
    lines = "\n".join(text(monitor, NOW + 200 * MS))
    assert "axis=slew state=TRIPPED from=READY reason=ENABLE_LOST" in lines
    assert len(monitor.events) == 6
    assert monitor.history.changes == []  # for a day there are many


def test_frames_that_are_none_of_its_messages(deployment: Deployment) -> None:
    monitor = Monitor(deployment)
    monitor.receive(ReceivedFrame(NOW, "crane", "vcan0", 0x20000080, True, bytes(8), "error"))
    for data in (b"\x01", b"\xff" * 8):  # too short, unknown numbers
        monitor.receive(received(Frame("crane", 0x300, False, data), NOW))
    for frame in status_frames(deployment)[1:]:
        monitor.receive(frame)
    lines = "\n".join(text(monitor, NOW))
    assert "1 error frames" in lines
    assert "unknown (15)" in lines
    assert "unknown (255)" in lines


def test_a_deployment_without_status_messages(deployment: Deployment) -> None:
    axes = {n: replace(axis, status=None) for n, axis in deployment.axes.items()}
    lines = text(Monitor(replace(deployment, axes=axes, status=None)), NOW)
    assert sum("it has no status message" in line for line in lines) == 3
    assert any("gives the service no status message" in line for line in lines)


def test_a_bar_shows_side_and_size() -> None:
    assert bar(0.0, plain=True) == "..........|.........."
    assert bar(100.0, plain=True) == "..........|##########"
    assert bar(-130.0, plain=True) == "##########|.........."
    assert bar(1.0, plain=True) == "..........|#........."
    assert bar(0.4, plain=True) == "..........|.........."
    assert bar(-52.0, plain=False) == "·····█████│··········"


def test_a_line_for_pipes(deployment: Deployment) -> None:
    monitor = monitor_of(deployment)
    line = status_line(monitor, NOW)
    assert "slew=ACTIVE(JOYSTICK_MOVED) raw=+50% sent=-25% sway=+3.4deg" in line
    assert "missed=3" in line
    assert "crane=2/s" in line


def drive(deployment: Deployment, monitor: Monitor) -> None:
    """Half a minute: right, rest, left, rest; its end is NOW."""
    for n in range(300):
        command = {0: 1.0, 2: -1.0}.get(n // 75, 0.0)
        for axis in deployment.axes.values():
            assert axis.status
            said = report(State.ACTIVE, Reason.JOYSTICK_MOVED, command, command, 4.0 * command)
            monitor.receive(received(status_frame(axis.status, said), NOW - (300 - n) * 100 * MS))


def test_a_wide_terminal_has_lines_over_time(deployment: Deployment) -> None:
    monitor = Monitor(deployment)
    drive(deployment, monitor)
    rows = text(monitor, NOW, width=200)
    assert max(map(len, rows)) <= 200
    first, second = rows[1], rows[2]
    assert ("to 100 %" in first, "to 4.0 deg" in second) == (True, True)
    line = first[first.index("100 %") + 5 :].strip()
    assert set(line) == {"█", "▅", "▁"}
    assert line.index("█") < line.index("▅") < line.index("▁")
    lift = rows[1 + 2 * list(deployment.axes).index("lift") + 1]
    assert "deg" not in lift  # it makes nothing swing
    assert not any("100 %" in row for row in text(monitor, NOW, width=100))


def test_a_line_over_time_keeps_short_peaks_and_leaves_out_what_did_not_come() -> None:
    at = [(NOW - 15_000 * MS, 0.0), (NOW - 14_999 * MS, -1.0), (NOW - 14_998 * MS, 0.1)]
    assert line_over_time(at, NOW, 3, plain=True) == " _ "
    assert line_over_time([(NOW - 31_000 * MS, 1.0)], NOW, 3, plain=False) == "   "
    assert line_over_time([(NOW, 9.0)], NOW, 3, plain=False) == "  █"


def test_forty_columns_lose_no_word(deployment: Deployment) -> None:
    monitor = monitor_of(deployment, state=State.TRIPPED, reason=Reason.ENABLE_LOST)
    monitor.note(NOW, "axis=slew state=TRIPPED from=ACTIVE reason=ENABLE_LOST")
    rows = text(monitor, NOW, width=40, height=60)
    assert max(map(len, rows)) <= 40
    assert "slew        TRIPPED" in rows
    assert "  ENABLE_LOST" in rows
    assert "  in +50%  valve -25%  sway +3.4" in rows
    assert "last fault" in " ".join(" ".join(rows).split())
    assert "reason=ENABLE_LOST" in " ".join(rows)


def test_keys_pause_choose_an_axis_and_end(deployment: Deployment) -> None:
    monitor, keys = monitor_of(deployment), Keys([*deployment.axes])
    monitor.note(NOW, "axis=lift state=READY from=ACTIVE reason=AT_REST")

    def shown() -> list[str]:
        picture = screen(monitor, NOW, 80, 24, plain=False, keys=keys).plain.splitlines()
        assert (len(picture), picture[-1]) == (24, HELP)
        return picture

    assert len([row for row in shown() if " valve " in row]) == len(deployment.axes)
    keys.press("xa")
    one = shown()
    assert (keys.axis, len([row for row in one if " valve " in row])) == ("slew", 1)
    assert not any("axis=lift" in row for row in one)
    keys.press("a" * len(deployment.axes))
    assert keys.axis is None
    keys.press("p")
    assert "PAUSED" in shown()[0]
    keys.press(" q")
    assert (keys.paused, keys.ended) == (False, True)
