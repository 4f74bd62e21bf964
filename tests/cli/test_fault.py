"""``canshaper fault``: its list, its questions, its table, and what it says when it cannot."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from canshaper.cli.app import app
from canshaper.commissioning.procedure.files import Files
from canshaper.commissioning.procedure.rehearsed import kept
from canshaper.commissioning.procedure.state import State
from canshaper.commissioning.procedure.steps.check import document
from canshaper.daemon.control_server import ControlServer
from canshaper.machine.binding import load_deployment
from tests.faults.rehearsed import slow_file

OVER = {"phase": "done", "made": True, "neutral_ms": 18.0, "why": "its time is over"}
TRIPPED = {**OVER, "events": [[18.0, "slew", "TRIPPED", "ENABLE_LOST"]]}
WENT_ON = {**OVER, "neutral_ms": None, "events": []}
Answer = Callable[[Mapping[str, Any], str], Mapping[str, Any]]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "machine.yaml"
    text = slow_file("forwarder").read_text(encoding="utf-8")
    path.write_text(text.replace("control:\n", f"control:\n  socket: {tmp_path}/c.sock\n"), "utf-8")
    return path


@contextmanager
def daemon(file: Path, answer: Answer) -> Iterator[list[Any]]:
    """The daemon's end of the socket; what it was asked."""
    asked: list[Any] = []
    server, over = ControlServer(file.with_name("c.sock"), 0o600), threading.Event()

    def noted(request: Mapping[str, Any], peer: str) -> Mapping[str, Any]:
        asked.append(request.get("fault"))
        return answer(request, peer)

    def serve() -> None:
        while not over.wait(0.001):
            server.serve(noted, time.monotonic_ns())

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield asked
    finally:
        over.set()
        thread.join()
        server.close()


def canshaper(file: Path, *words: str, yes: str = "y\n") -> Result:
    return CliRunner().invoke(app, ["fault", str(file), *words], input=yes)


def said(report: Mapping[str, Any]) -> Answer:
    return lambda *_: {"fault": report}


def test_the_list_has_every_fault_and_what_is_none(file: Path) -> None:
    shown = canshaper(file, "--list").stdout
    for words in ("silent:left", "JOYSTICK_TIMEOUT", "shaped stop", "not rehearsed: fill the disk"):
        assert words in shown


@pytest.mark.parametrize(
    ("report", "code", "verdict"), [(TRIPPED, 0, "as expected"), (WENT_ON, 1, "NOT as expected")]
)
def test_a_fault_is_judged_shown_and_kept(
    file: Path, report: Mapping[str, Any], code: int, verdict: str
) -> None:
    with daemon(file, said(report)) as asked:
        done = canshaper(file, "--only", "enable_off:left")
    assert (done.exit_code, asked) == (code, ["enable_off:left"])
    assert "move slew or near_far to about half and hold it" in done.stdout
    (row,) = kept(Files(file).folder)
    assert row["verdict"] == verdict


def test_rows_of_before_stay_and_the_same_fault_has_one(file: Path) -> None:
    with daemon(file, said(TRIPPED)):
        for name in ("enable_off:left", "enable_off:right", "enable_off:left"):
            canshaper(file, "--only", name)
    rows = kept(Files(file).folder)
    assert [row["fault"] for row in rows] == ["enable_off:right", "enable_off:left"]


@pytest.mark.parametrize(
    ("report", "happened"),
    [
        ({**WENT_ON, "why": "the joystick was let go"}, "the joystick was let go"),
        ({**WENT_ON, "made": False, "why": ""}, "the daemon has begun again"),
    ],
)
def test_what_was_cut_short_is_not_done(
    file: Path, report: Mapping[str, Any], happened: str
) -> None:
    with daemon(file, said(report)):
        canshaper(file, "--only", "enable_off:left")
    (row,) = kept(Files(file).folder)
    assert (row["happened"], row["verdict"]) == (happened, "not done")


@pytest.mark.parametrize(("report", "verdict"), [(TRIPPED, "Fit to sign"), (WENT_ON, "NOT FIT")])
def test_the_report_of_the_day_has_the_table(
    file: Path, report: Mapping[str, Any], verdict: str
) -> None:
    with daemon(file, said(report)):
        canshaper(file, "--only", "enable_off:left")
    shown = document(load_deployment(file), State(), {}, Files(file).folder)
    assert verdict in shown.split("<table")[0]
    assert "Rehearsed faults" in shown
    assert "enable_off:left" in shown


def test_nothing_is_made_without_a_yes(file: Path) -> None:
    with daemon(file, said(TRIPPED)) as asked:
        assert canshaper(file, "--only", "ENABLE_LOST", yes="n\nn\n").exit_code == 0
    assert not asked


def test_ctrl_c_ends_the_fault(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def pressed(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", pressed)
    with daemon(file, said({**TRIPPED, "phase": "made"})) as asked:
        assert canshaper(file, "--only", "enable_off:left").exit_code == 130
    assert asked == ["enable_off:left", "end"]


def refuses(text: str) -> Answer:
    def answer(*_: object) -> Mapping[str, Any]:
        raise ValueError(text)

    return answer


def test_what_the_daemon_refuses_is_one_line(file: Path) -> None:
    line = "expected every axis at rest, slew is ACTIVE: let go first"
    with daemon(file, refuses(line)):
        done = canshaper(file, "--only", "enable_off:left")
    assert (done.exit_code, done.stderr.strip()) == (1, line)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("nonsense", "--only: expected a name of --list, got 'nonsense'"),
        ("R15", "R15 cannot be rehearsed: fill the disk"),
        ("VALVE_FAULT", "VALVE_FAULT cannot be rehearsed: no part of this machine can have it"),
    ],
)
def test_what_cannot_be_made_is_refused_by_name(file: Path, name: str, line: str) -> None:
    done = canshaper(file, "--only", name)
    assert (done.exit_code, done.stderr.strip()) == (2, line)


def test_a_file_without_the_right_is_refused(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    rows = "adjustable: { axes.slew.limits.max_pct: [20, 40] }"
    file.write_text(text.replace("rehearse_faults: true", rows), encoding="utf-8")
    done = canshaper(file)
    assert done.exit_code == 2
    assert done.stderr.endswith(
        "expected control.rehearse_faults: true, and reduced speed, got none\n"
    )


def test_no_daemon_is_one_line(file: Path) -> None:
    done = canshaper(file, "--only", "enable_off:left")
    assert done.exit_code == 1
    assert "No such file or directory: no daemon with a control section?" in done.stderr
