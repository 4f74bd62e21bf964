"""Requests to the control socket of a daemon, their answers, and their lines in its log."""

import os
import stat
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from canshaper.blackbox.keeper import BlackBox
from canshaper.blackbox.recorder import Recorder
from canshaper.daemon.daemon import Daemon
from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench, at
from tests.daemon.control_client import answered, ask, clients, control


@pytest.fixture
def path(bench: Bench, tmp_path: Path) -> Path:
    """The control socket of the bench's machine."""
    control(bench, tmp_path / "c.sock")
    return tmp_path / "c.sock"


def test_the_control_socket_has_the_mode_of_the_file(bench: Bench, path: Path) -> None:
    bench.text = bench.text.replace("control:\n", 'control:\n  mode: "0620"\n')
    bench.file.write_text(bench.text, encoding="utf-8")
    modes: list[int] = []
    at(bench, {0: lambda: modes.append(stat.S_IMODE(path.stat().st_mode))}, last=0)
    assert modes == [0o620]


def test_the_control_socket_is_named_after_the_deployment(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("canshaper.config.bus.RUNTIME", tmp_path / "run")
    (tmp_path / "run" / "machine").mkdir(parents=True)
    control(bench, tmp_path)
    bench.file.write_text(bench.text.replace(f"  socket: {tmp_path}\n", ""), encoding="utf-8")
    there: list[bool] = []
    at(bench, {0: lambda: there.append((tmp_path / "run/machine/control.sock").exists())}, last=0)
    assert there == [True]


@pytest.mark.parametrize(("value", "said"), [(0.75, "was=0.708"), (2, "0.5 to 1")])
def test_the_log_says_who_set_what(
    bench: Bench, path: Path, log: Callable[[str], list[str]], value: float, said: str
) -> None:
    answer = answered(bench, path, {"set": {"axes.slew.filter.a1": value}})
    (line,) = log("axes.slew.filter.a1")
    assert line.endswith(answer.get("error", ""))
    if value < 1:
        assert answer["adjustable"]["axes.slew.filter.a1"]["now"] == value
        assert line.startswith(f"INFO set axes.slew.filter.a1={value} was=0.708 ")
    assert not path.exists()  # at the end it is closed
    assert "uid=" in line
    assert "pid=" in line
    assert said in line
    assert line.startswith(("INFO set axes.", "WARNING set=refused uid="))


def test_the_log_names_the_person_who_set_it(
    bench: Bench, path: Path, log: Callable[[str], list[str]]
) -> None:
    """Whatever stands in the name, it makes no field of its own."""
    request = {"set": {"axes.slew.filter.a1": 0.75}, "by": "anna/page 2 uid=0\n" + 99 * "x"}
    answered(bench, path, request)
    (line,) = log("axes.slew.filter.a1")
    name = "anna/page_2_uid_0_"
    assert f" by={name}{(60 - len(name)) * 'x'} uid={os.getuid()} pid=" in line


@pytest.mark.parametrize(("value", "counts"), [(0.75, True), (2, False)])
def test_what_is_set_is_recorded_for_a_replay(
    bench: Bench, path: Path, monkeypatch: pytest.MonkeyPatch, value: float, counts: bool
) -> None:
    """Not what is refused."""
    recorded: list[Mapping[str, float]] = []
    monkeypatch.setattr(Recorder, "set", lambda _, values: recorded.append(values))
    values = {"axes.slew.filter.a1": value}
    answered(bench, path, {"set": values})
    assert recorded == [values] * counts


@pytest.mark.parametrize("what", ["write", "state"])
def test_a_black_box_is_written_when_somebody_asks_for_it(
    bench: Bench,
    path: Path,
    monkeypatch: pytest.MonkeyPatch,
    log: Callable[[str], list[str]],
    what: str,
) -> None:
    """Whatever else is asked of it, the answer says how many there are; the log says who asked."""
    requested, asks = list[BlackBox](), int(what == "write")

    def request(box: BlackBox) -> None:
        requested.append(box)

    monkeypatch.setattr(BlackBox, "request", request)
    assert answered(bench, path, {"black_box": what})["black_box"]["tried"] == 0
    assert len(requested) == asks
    said = [line.partition("uid=")[0] for line in log("lack-box=requested")]
    assert said == ["INFO black-box=requested "] * asks


def test_black_boxes_are_written_where_the_daemon_was_started_with(
    bench: Bench, tmp_path: Path
) -> None:
    daemon = Daemon(lambda: load_deployment(bench.file), tmp_path)
    assert daemon._black_box.report()["folder"] == str(tmp_path)


@pytest.mark.parametrize("request_", [{"get": 1}, {"set": 1}, {"set": {}, "more": 1}])
def test_a_request_that_is_none_is_answered_with_what_is_one(
    bench: Bench, path: Path, request_: object
) -> None:
    text = 'expected {} or {"set": {KEY: VALUE}}, {"black_box": "write"}, {"status": true}'
    text += ', {"fault": NAME}, got another object'
    assert answered(bench, path, request_) == {"error": text}


def test_the_table_is_asked_for_and_nothing_is_set(
    bench: Bench, path: Path, log: Callable[[], list[str]]
) -> None:
    answer = answered(bench, path, {})
    assert answer["adjustable"]["axes.slew.filter.a1"]["now"] == 0.708
    assert not [line for line in log() if " set " in line or "set=" in line]


def test_without_a_place_for_the_socket_the_machine_works(
    bench: Bench, tmp_path: Path, log: Callable[[], list[str]]
) -> None:
    path = tmp_path / "nowhere" / "c.sock"
    control(bench, path)
    at(bench, {})
    assert [line for line in log() if "control=none" in line] == [
        f"WARNING control=none socket={path} No such file or directory"
    ]
    assert log()[-1] == "INFO stopped valves=neutral"


def test_a_reload_opens_the_control_socket_of_the_new_file(bench: Bench, tmp_path: Path) -> None:
    first, second = tmp_path / "1.sock", tmp_path / "2.sock"
    control(bench, first)
    there: list[tuple[bool, bool]] = []
    at(
        bench,
        {
            5: lambda: bench.reload(str(first), str(second)),
            15: lambda: there.append((first.exists(), second.exists())),
        },
    )
    assert there == [(False, True)]


def test_the_state_is_asked_for(bench: Bench, path: Path) -> None:
    status = answered(bench, path, {"status": True})["status"]
    assert status["axes"]["slew"] == {
        "state": "READY",
        "reason": "JOYSTICK_NEUTRAL",
        "joystick": 0.0,
        "setpoint": 0.0,
        "sway_deg": 0.0,
        "set": 0,
    }
    assert list(status["axes"]) == ["slew", "near_far", "lift"]
    assert status["buses"] == {"crane": "up"}
    assert status["counters"]["MissedDeadlines"] == 0
    assert (status["late_s"], status["digest"]) == (
        0.0,
        load_deployment(bench.file).identity.digest,
    )


REHEARSAL = "canshaper.daemon.rehearsal"


@pytest.fixture
def rehearsing(bench: Bench, tmp_path: Path) -> Path:
    """The control socket of a machine whose file allows to rehearse faults."""
    path = tmp_path / "c.sock"
    bench.text = bench.text.replace("rise_per_s: 5,", "max_pct: 40, rise_per_s: 5,")
    bench.text += f"control:\n  socket: {path}\n  rehearse_faults: true\n"
    bench.file.write_text(bench.text, encoding="utf-8")
    return path


def loaded() -> list[str]:
    return [name for name in sys.modules if name.startswith(REHEARSAL)]


def test_a_fault_is_refused_and_nothing_of_it_loaded_where_the_file_does_not_allow_it(
    bench: Bench, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in loaded():
        monkeypatch.delitem(sys.modules, name)
    answer = answered(bench, path, {"fault": "silent:left"})
    assert answer == {"error": "faults are rehearsed where the file has control.rehearse_faults"}
    assert not loaded()


def test_a_fault_is_armed_for_who_asks_and_ends_when_he_asks_no_more(
    bench: Bench, rehearsing: Path, log: Callable[[], list[str]]
) -> None:
    asks = ask(rehearsing, {"fault": "silent:left", "by": "anna"})
    at(bench, {3: asks, 15: lambda: clients.pop().close()}, last=170)
    assert loaded()
    armed, over = [line for line in log() if " fault=" in line]
    assert armed.startswith("WARNING fault=armed name=silent:left by=anna uid=")
    assert over == "WARNING fault=over name=silent:left its client is gone"


def test_a_reload_ends_a_fault(
    bench: Bench, rehearsing: Path, log: Callable[[], list[str]]
) -> None:
    asks = ask(rehearsing, {"fault": "silent:left"})
    at(bench, {3: asks, 8: lambda: bench.reload("rise_per_s: 5,", "rise_per_s: 4,")})
    clients.pop().close()
    assert "WARNING fault=over name=silent:left the file was read again" in log()


def test_where_no_fault_is_there_is_none_to_end(bench: Bench, rehearsing: Path) -> None:
    report = answered(bench, rehearsing, {"fault": "end"})["fault"]
    assert (report["phase"], report["made"]) == ("done", False)
