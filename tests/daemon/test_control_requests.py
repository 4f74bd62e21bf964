"""Requests to the control socket of a daemon, and their lines in its log."""

import os
import stat
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from canshaper.blackbox.keeper import BlackBox
from canshaper.blackbox.recorder import Recorder
from canshaper.daemon.daemon import Daemon
from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench
from tests.daemon.control_client import answered, control


@pytest.fixture
def path(bench: Bench, tmp_path: Path) -> Path:
    """The control socket of the bench's machine."""
    control(bench, tmp_path / "c.sock")
    return tmp_path / "c.sock"


def test_the_control_socket_has_the_mode_of_the_file(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "c.sock"
    control(bench, path)
    bench.text = bench.text.replace("control:\n", 'control:\n  mode: "0620"\n')
    bench.file.write_text(bench.text, encoding="utf-8")
    modes: list[int] = []

    def script(number: int) -> None:
        modes.append(stat.S_IMODE(path.stat().st_mode))
        bench.stop()

    bench.run(script)
    assert modes == [0o620]


def test_the_control_socket_is_named_after_the_deployment(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("canshaper.config.bus.RUNTIME", tmp_path / "run")
    (tmp_path / "run" / "machine").mkdir(parents=True)
    control(bench, tmp_path)
    bench.file.write_text(bench.text.replace(f"  socket: {tmp_path}\n", ""), encoding="utf-8")
    there: list[bool] = []

    def script(number: int) -> None:
        there.append((tmp_path / "run/machine/control.sock").exists())
        bench.stop()

    bench.run(script)
    assert there == [True]


@pytest.mark.parametrize(("value", "said"), [(0.75, "was=0.708"), (2, "0.5 to 1")])
def test_the_log_says_who_set_what(
    bench: Bench, tmp_path: Path, log: Callable[[str], list[str]], value: float, said: str
) -> None:
    path = tmp_path / "c.sock"
    control(bench, path)
    answer = answered(bench, path, {"set": {"axes.slew.filter.a1": value}})
    (line,) = log("axes.slew.filter.a1")
    assert line.endswith(answer.get("error", ""))
    assert "uid=" in line
    assert "pid=" in line
    assert said in line
    assert line.startswith(("INFO set axes.", "WARNING set=refused uid="))


def test_the_log_names_the_person_who_set_it(
    bench: Bench, tmp_path: Path, log: Callable[[str], list[str]]
) -> None:
    """Whatever stands in the name, it makes no field of its own."""
    path = tmp_path / "c.sock"
    control(bench, path)
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


@pytest.fixture
def requested(monkeypatch: pytest.MonkeyPatch) -> list[BlackBox]:
    """Black boxes that were requested."""
    boxes: list[BlackBox] = []

    def request(box: BlackBox) -> None:
        boxes.append(box)

    monkeypatch.setattr(BlackBox, "request", request)
    return boxes


@pytest.mark.parametrize(("what", "asks"), [("write", 1), ("state", 0)])
def test_a_black_box_is_written_when_somebody_asks_for_it(
    bench: Bench, path: Path, requested: list[BlackBox], what: str, asks: int
) -> None:
    """Whatever else is asked of it, the answer says how many there are."""
    assert answered(bench, path, {"black_box": what})["black_box"]["tried"] == 0
    assert len(requested) == asks


def test_the_log_says_who_asked_for_a_black_box(
    bench: Bench, path: Path, requested: list[BlackBox], log: Callable[[str], list[str]]
) -> None:
    answered(bench, path, {"black_box": "write"})
    (line,) = log("lack-box=requested")
    assert line.startswith("INFO black-box=requested uid=")


def test_black_boxes_are_written_where_the_daemon_was_started_with(
    bench: Bench, tmp_path: Path
) -> None:
    daemon = Daemon(lambda: load_deployment(bench.file), tmp_path)
    assert daemon._black_box.report()["folder"] == str(tmp_path)


def test_a_request_that_is_none_is_answered_with_what_is_one(bench: Bench, path: Path) -> None:
    text = 'expected {} or {"set": {KEY: VALUE}}, {"black_box": "write"}, {"status": true}'
    text += ', {"fault": NAME}, got another object'
    assert answered(bench, path, {"get": 1}) == {"error": text}
