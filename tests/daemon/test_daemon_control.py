"""The control socket of a daemon: what is set, asked for and refused."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench, at
from tests.daemon.control_client import answered, ask, clients, control


def test_a_number_is_set_and_the_log_has_it(
    bench: Bench, tmp_path: Path, log: Callable[[], list[str]]
) -> None:
    path = tmp_path / "c.sock"
    control(bench, path)
    answer = answered(bench, path, {"set": {"axes.slew.filter.a1": 0.75}})
    assert answer["adjustable"]["axes.slew.filter.a1"]["now"] == 0.75
    assert next(line for line in log() if " set " in line).startswith(
        "INFO set axes.slew.filter.a1=0.75 was=0.708 "
    )
    assert not path.exists()  # at the end it is closed


def test_the_table_is_asked_for_and_nothing_is_set(
    bench: Bench, tmp_path: Path, log: Callable[[], list[str]]
) -> None:
    path = tmp_path / "c.sock"
    control(bench, path)
    answer = answered(bench, path, {})
    assert answer["adjustable"]["axes.slew.filter.a1"]["now"] == 0.708
    assert not [line for line in log() if " set " in line or "set=" in line]


@pytest.mark.parametrize("request_", [{"get": 1}, {"set": 1}, {"set": {}, "more": 1}])
def test_a_request_that_is_none(bench: Bench, tmp_path: Path, request_: object) -> None:
    path = tmp_path / "c.sock"
    control(bench, path)
    assert "expected {} or" in answered(bench, path, request_)["error"]


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


def test_the_state_is_asked_for(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "c.sock"
    control(bench, path)
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


def rehearsing(bench: Bench, path: Path) -> None:
    """Allow faults to be rehearsed."""
    bench.text = bench.text.replace("rise_per_s: 5,", "max_pct: 40, rise_per_s: 5,")
    bench.text += f"control:\n  socket: {path}\n  rehearse_faults: true\n"
    bench.file.write_text(bench.text, encoding="utf-8")


def loaded() -> list[str]:
    return [name for name in sys.modules if name.startswith(REHEARSAL)]


def test_a_fault_is_refused_and_nothing_of_it_loaded_where_the_file_does_not_allow_it(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in loaded():
        monkeypatch.delitem(sys.modules, name)
    control(bench, tmp_path / "c.sock")
    answer = answered(bench, tmp_path / "c.sock", {"fault": "silent:left"})
    assert answer == {"error": "faults are rehearsed where the file has control.rehearse_faults"}
    assert not loaded()


def test_a_fault_is_armed_for_who_asks_and_ends_when_he_asks_no_more(
    bench: Bench, tmp_path: Path, log: Callable[[], list[str]]
) -> None:
    path = tmp_path / "c.sock"
    rehearsing(bench, path)
    asks = ask(path, {"fault": "silent:left", "by": "anna"})
    at(bench, {3: asks, 15: lambda: clients.pop().close()}, last=170)
    assert loaded()
    armed, over = [line for line in log() if " fault=" in line]
    assert armed.startswith("WARNING fault=armed name=silent:left by=anna uid=")
    assert over == "WARNING fault=over name=silent:left its client is gone"


def test_a_reload_ends_a_fault(bench: Bench, tmp_path: Path, log: Callable[[], list[str]]) -> None:
    path = tmp_path / "c.sock"
    rehearsing(bench, path)
    asks = ask(path, {"fault": "silent:left"})
    at(bench, {3: asks, 8: lambda: bench.reload("rise_per_s: 5,", "rise_per_s: 4,")})
    clients.pop().close()
    assert "WARNING fault=over name=silent:left the file was read again" in log()


def test_where_no_fault_is_there_is_none_to_end(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "c.sock"
    rehearsing(bench, path)
    report = answered(bench, path, {"fault": "end"})["fault"]
    assert (report["phase"], report["made"]) == ("done", False)
