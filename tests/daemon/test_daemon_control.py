"""The control socket of a daemon: what is set, asked for and refused."""

from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench, at
from tests.daemon.control_client import answered, control


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


def test_a_number_that_is_refused_is_in_the_log(
    bench: Bench, tmp_path: Path, log: Callable[[], list[str]]
) -> None:
    path = tmp_path / "c.sock"
    control(bench, path)
    answer = answered(bench, path, {"set": {"axes.slew.filter.a1": 2}})
    assert "0.5 to 1" in answer["error"]
    refused = [line for line in log() if "set=refused" in line]
    assert len(refused) == 1
    assert refused[0].startswith("WARNING set=refused uid=")
    assert refused[0].endswith(answer["error"])


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
