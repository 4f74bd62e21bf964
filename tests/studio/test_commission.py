"""The commissioning on a page: the real server, its real process, and the state of the terminal."""

import json
import shutil
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.applications import Starlette
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.commissioning.procedure.files import Files
from canshaper.studio.access import Access
from canshaper.studio.commission import Commission
from canshaper.studio.server import Guard, listening, server
from tests.studio.conftest import ROOT
from tests.studio.page import WAIT_S

pytestmark = pytest.mark.processes
Request = Callable[..., Any]


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    text = (ROOT / "config" / "forwarder-robust.yaml").read_text()
    shutil.copy(ROOT / "dbc" / "forwarder.dbc", tmp_path)
    (tmp_path / "machine.yaml").write_text(text.replace("../dbc/", ""))
    monkeypatch.chdir(tmp_path)
    return Path("machine.yaml")


@pytest.fixture
def served(machine: Path) -> Iterator[Callable[..., Request]]:
    """Starts a server of a commissioning; what it gives asks it."""
    ends: list[Callable[[], None]] = []

    def serve(path: Path | None = machine, *, shadow: bool = False) -> Request:
        one = listening("127.0.0.1", 0)
        host = f"127.0.0.1:{one.getsockname()[1]}"
        commission = Commission(path, [], machine=shadow)
        guarded = Guard(Starlette(routes=commission.routes()), Access(one.getsockname()[1]))
        web = server(guarded)
        thread = threading.Thread(target=lambda: web.run(sockets=[one]))
        thread.start()

        def end() -> None:
            web.should_exit = True
            thread.join(WAIT_S)
            commission.close()

        ends.append(end)

        def request(path: str, method: str = "GET", *, origin: str | None = None) -> Any:
            headers = {"Origin": origin or f"http://{host}"}
            request = urllib.request.Request(
                f"http://{host}/commission{path}", headers=headers, method=method
            )
            try:
                with urllib.request.urlopen(request, timeout=WAIT_S) as answer:
                    data = answer.read()
            except urllib.error.HTTPError as error:
                with error:
                    return error.code, error.read().decode()
            return json.loads(data) if answer.headers["Content-Type"].endswith("json") else data

        return request

    yield serve
    for end in ends:
        end()


def step(shown: Any, name: str) -> Any:
    return next(one for one in shown["steps"] if one["name"] == name)


@pytest.mark.slow
def test_page_and_terminal_have_one_state(machine: Path, served: Callable[..., Request]) -> None:
    before, request = machine.read_bytes(), served()
    assert b"<title>Commissioning" in request("")
    assert {one["status"] for one in request("/state")["steps"]} == {"open"}
    state = request("/run/check", "POST")
    assert state["error"] == ""
    assert step(state, "check")["proposed"]
    assert "+" in step(state, "check")["diff"]
    assert "max_pct: 40" in step(state, "check")["diff"]
    assert request("/files/check.png").startswith(b"\x89PNG")
    done = request("/accept/check", "POST")
    assert step(done, "check")["status"] == "done"
    assert "max_pct: 40" in Path("machine.rehearsal.yaml").read_text()
    assert machine.read_bytes() == before
    words = ["commission", "machine.yaml", "--simulated", "--step", "buses", "--yes"]
    assert CliRunner().invoke(app, words).exit_code == 0
    shown = request("/state")
    assert step(shown, "buses")["status"] == step(shown, "check")["status"] == "done"
    assert step(request("/skip/swing", "POST"), "swing")["status"] == "skipped"


@pytest.mark.slow
def test_what_cannot_be_done_is_said(machine: Path, served: Callable[..., Request]) -> None:
    request = served()
    assert request("/accept/check", "POST")["error"] == "check: nothing to accept; run it first"
    assert "--step: expected one of buses" in request("/run/nonsense", "POST")["error"]
    with Files(Path("machine.rehearsal.yaml")).locked():
        assert "another commissioning of it is under way" in request("/run/buses", "POST")["error"]
    state = request("/run/buses", "POST")
    assert step(state, "buses")["proposed"]
    copy = Path("machine.rehearsal.yaml")
    copy.write_text(copy.read_text() + "# a note of mine\n")
    assert "changed by someone else meanwhile" in request("/accept/buses", "POST")["error"]
    machine.write_text("version: 1\n")
    assert "machine.yaml" in request("/run/buses", "POST")["error"]


def test_no_other_page_and_no_other_file(machine: Path, served: Callable[..., Request]) -> None:
    request = served()
    code, text = request("/run/buses", "POST", origin="http://elsewhere.example")
    assert (code, "expected the page of this studio" in text) == (403, True)
    assert request("/delete/buses", "POST")[0] == 404
    assert request("/run/buses")[0] == 405
    for name in ("machine.yaml", "..%2Fmachine.yaml", "None", "report.html"):
        assert request(f"/files/{name}")[0] == 404
    assert not Path("machine.rehearsal.yaml").exists()


@pytest.mark.slow
def test_that_of_a_machine_is_only_shown(machine: Path, served: Callable[..., Request]) -> None:
    request = served(shadow=True)
    shown = request("/state")
    assert (shown["file"], shown["machine"]) == ("machine.yaml", True)
    assert request("/run/buses", "POST")[0] == 409
    assert not Path("machine.commission").exists()


def test_a_shipped_file_has_none(served: Callable[..., Request]) -> None:
    request = served(None)
    assert request("/state")["steps"] == []
    assert request("/run/buses", "POST")["steps"] == []
