"""The life of an instance: start, priority, crash, hang, reload, stop."""

import re
import subprocess
import time
from functools import partial
from pathlib import Path

import can

from tests.hil.machine import (
    VALVES,
    Joysticks,
    candump,
    drive,
    logged,
    message_name,
    open_bus,
    wait_for,
)
from tests.systemd.unit import ANSWER_S, Unit, add_vcan, run

MOST_EXPOSURE = 1.5


def test_started_means_that_the_valves_get_neutral(installed: None, tmp_path: Path) -> None:
    unit = Unit("forwarder")
    with candump(tmp_path / "start.log", "vcan0"):
        unit.systemctl("start")
    reported = {message_name(m): m.data[0] for m in logged(tmp_path / "start.log")}
    assert {name: reported.get(name) for name in VALVES} == dict.fromkeys(VALVES, 0)
    assert re.search("started file=/etc/canshaper/forwarder.yaml", unit.text())


def test_process_is_real_time_locked_and_no_one(forwarder: Unit) -> None:
    process = Path("/proc") / forwarder.show("MainPID")
    scheduling = run("chrt", "--pid", process.name).stdout
    assert "SCHED_FIFO" in scheduling
    assert scheduling.endswith("priority: 40\n")
    fields = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
    assert int(fields["VmLck"].split()[0]) >= int(fields["VmRSS"].split()[0]) // 2 > 0
    assert fields["THP_enabled"].strip() == "0"  # no huge pages
    assert "0" not in fields["Uid"].split()
    assert (fields["CapEff"].strip("\t0"), fields["CapBnd"].strip("\t0")) == ("", "")
    assert fields["NoNewPrivs"].strip() == "1"
    assert (process / "oom_score_adj").read_text() == "-900\n"
    user = run("getent", "passwd", fields["Uid"].split()[0]).stdout
    assert user.startswith("canshaper:")


def lock_of_ours(held: bool) -> str:
    """The lock of logind that holds off a suspend, once it is held or is not."""
    until = time.monotonic() + ANSWER_S
    while True:
        listed = run("systemd-inhibit", "--list", "--no-pager", "--no-legend").stdout.splitlines()
        ours = [line for line in listed if line.startswith("canshaper")]
        if bool(ours) == held:
            return "".join(ours)
        assert time.monotonic() < until, run("journalctl", "-u", "canshaper-awake").stdout
        time.sleep(0.2)


def test_no_suspend_while_an_instance_runs(forwarder: Unit) -> None:
    lock = lock_of_ours(held=True)
    assert "sleep" in lock
    assert "handle-lid-switch" in lock
    assert lock.rstrip().endswith("block")
    forwarder.systemctl("stop")
    assert lock_of_ours(held=False) == ""


def test_exposure_of_the_loaded_unit(forwarder: Unit) -> None:
    verdict = run("systemd-analyze", "security", "--no-pager", forwarder.name).stdout
    exposure = re.search(r"Overall exposure level for \S+: ([0-9.]+)", verdict)
    assert exposure, verdict
    assert float(exposure[1]) <= MOST_EXPOSURE


def test_joystick_moves_the_valve_and_the_status_reports(
    forwarder: Unit, bus: can.BusABC, joysticks: Joysticks
) -> None:
    forwarder.wait(partial(drive, bus, joysticks), StatusText=".*slew ACTIVE.*")


def test_killed_in_motion_it_comes_back_and_waits_for_neutral(
    forwarder: Unit, bus: can.BusABC, joysticks: Joysticks, tmp_path: Path
) -> None:
    drive(bus, joysticks)
    before = forwarder.number("NRestarts")
    forwarder.systemctl("kill", "--signal=KILL")
    forwarder.wait(ActiveState="(?!active).*")  # from here on every frame is the next process's
    with open_bus("vcan0") as later, candump(tmp_path / "after.log", "vcan0"):
        forwarder.wait_restart(before)
        status = wait_for(later, "SlewStatus", lambda s: str(s["Reason"]) == "JOYSTICK_NOT_NEUTRAL")
        assert str(status["State"]) == "NEUTRAL_WAIT"
    slew = [m.data[0] for m in logged(tmp_path / "after.log") if message_name(m) == "SlewCommand"]
    assert set(slew) == {0}
    with open_bus("vcan0") as later:
        drive(later, joysticks)


def test_hang_is_ended_by_the_watchdog_and_the_journal_reports_where(forwarder: Unit) -> None:
    assert forwarder.show("WatchdogUSec") == "1s"  # the unit's own
    before, cursor = forwarder.number("NRestarts"), forwarder.cursor()
    forwarder.systemctl("kill", "--signal=STOP")
    forwarder.wait_restart(before)
    text = forwarder.text(cursor)
    assert "Watchdog timeout" in text
    assert "in run_at_deadlines" in text
    assert forwarder.priority("in run_at_deadlines", cursor) == {"3"}


def test_interface_gone_and_back_without_a_restart(forwarder: Unit) -> None:
    pid, cursor = forwarder.show("MainPID"), forwarder.cursor()
    subprocess.run(["ip", "link", "del", "vcan0"], check=True)
    try:
        forwarder.wait_journal("bus=crane state=gone", cursor)
    finally:
        add_vcan("vcan0")
    with open_bus("vcan0") as bus:
        wait_for(bus, "SlewCommand", lambda v: v["Velocity"] == 0)
    assert forwarder.show("MainPID") == pid


def test_interface_missing_at_start_is_waited_for_without_priority(forwarder: Unit) -> None:
    forwarder.systemctl("stop")
    subprocess.run(["ip", "link", "del", "vcan0"], check=True)
    cursor = forwarder.cursor()
    try:
        forwarder.systemctl("start")
        why = "bus crane: cannot open socketcan channel vcan0: No such device"
        forwarder.wait(StatusText=f"waiting: {why}")
        assert forwarder.priority(why, cursor) == {"3"}
        pid = forwarder.show("MainPID")
        assert "SCHED_OTHER" in run("chrt", "--pid", pid).stdout
    finally:
        add_vcan("vcan0")
    with open_bus("vcan0") as bus:
        wait_for(bus, "SlewCommand", lambda v: v["Velocity"] == 0)
    assert forwarder.show("MainPID") == pid
    assert "SCHED_FIFO" in run("chrt", "--pid", pid).stdout


def test_wrong_file_at_start_fails_once_and_says_where(installed: None) -> None:
    unit = Unit("broken")
    unit.file.write_text("tick_ms: 20\nnonsense: 1\n")
    unit.systemctl("start", status=None)
    assert unit.show("Result") == "exit-code"
    assert unit.show("ExecMainStatus") == "2"
    assert unit.show("ActiveState") == "failed"  # not "activating": nothing tries again
    assert unit.priority("/etc/canshaper/broken.yaml:2: nonsense") == {"3"}
    unit.systemctl("reset-failed")
    unit.file.unlink()


def test_reload_applies_a_good_file(forwarder: Unit, bus: can.BusABC, joysticks: Joysticks) -> None:
    pid, cursor, text = forwarder.show("MainPID"), forwarder.cursor(), forwarder.file.read_text()
    forwarder.file.write_text(text.replace("limits: {", "limits: { max_pct: 24,"))
    try:
        forwarder.systemctl("reload")
        forwarder.wait_journal("reload=applied", cursor)
    finally:
        forwarder.file.write_text(text)
    assert drive(bus, joysticks, faster_than=23.0) == 24.0
    assert forwarder.show("MainPID") == pid
    joysticks.values["Slew"] = 0.0
    wait_for(bus, "SlewStatus", lambda s: str(s["State"]) == "READY")
    forwarder.systemctl("restart")


def test_reload_in_motion_is_one_only_when_it_is_applied(
    forwarder: Unit, bus: can.BusABC, joysticks: Joysticks
) -> None:
    """systemd ends a reload after TimeoutStartSec; a crane may move for longer."""
    cursor = forwarder.cursor()
    drive(bus, joysticks)
    forwarder.systemctl("reload")
    forwarder.wait_journal("reload=waiting until every axis is neutral", cursor)
    forwarder.wait(StatusText=".*slew ACTIVE.*", ActiveState="active", SubState="running")
    assert "reload=applied" not in forwarder.text(cursor)
    joysticks.values["Slew"] = 0.0
    forwarder.wait_journal("reload=applied", cursor)
    forwarder.wait(ActiveState="active", StatusText=".*slew (READY|NEUTRAL_WAIT).*")
    drive(bus, joysticks)


def test_reload_of_a_wrong_file_fails_and_changes_nothing(
    forwarder: Unit, bus: can.BusABC, joysticks: Joysticks
) -> None:
    pid, cursor, text = forwarder.show("MainPID"), forwarder.cursor(), forwarder.file.read_text()
    forwarder.file.write_text(text + "nonsense: 1\n")
    line = text.count("\n") + 1
    try:
        forwarder.systemctl("reload", status=None)
        assert forwarder.priority(f"forwarder.yaml:{line}: nonsense", cursor) == {"3"}
        assert "reload=" not in forwarder.text(cursor)  # the daemon has not even received it
        cursor = forwarder.cursor()
        forwarder.systemctl("kill", "--signal=HUP")  # past the check: the daemon's own one
        forwarder.wait_journal(rf"reload=refused .*forwarder.yaml:{line}: nonsense", cursor)
    finally:
        forwarder.file.write_text(text)
    drive(bus, joysticks)
    assert forwarder.show("MainPID") == pid


def test_stop_in_motion_ends_neutral(
    forwarder: Unit, bus: can.BusABC, joysticks: Joysticks, tmp_path: Path
) -> None:
    drive(bus, joysticks)
    with candump(tmp_path / "end.log", "vcan0"):
        forwarder.systemctl("stop")
    last = {message_name(m): m.data[0] for m in logged(tmp_path / "end.log")}
    assert {name: last[name] for name in VALVES} == dict.fromkeys(VALVES, 0)
    assert forwarder.show("Result") == "success"


def test_journal_is_one_plain_line_for_each_event(forwarder: Unit) -> None:
    entries = [e for e in forwarder.journal() if e.get("_COMM") == "canshaper"]
    events = [e for e in entries if re.match("(axis|bus|reload|memory)=", str(e["MESSAGE"]))]
    assert {"6", "4", "3"} >= {e["PRIORITY"] for e in events} >= {"6"}
    for entry in entries:
        assert isinstance(entry["MESSAGE"], str)  # a list: bytes that are no text
        assert entry["MESSAGE"].isprintable(), entry["MESSAGE"]
        assert not re.match(r"\d{4}-\d\d-\d\d", entry["MESSAGE"])  # the journal has its own time
