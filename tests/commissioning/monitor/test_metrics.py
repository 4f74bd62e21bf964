"""``canshaper metrics``: what Prometheus reads of a daemon, and of none; its dashboard."""

import json
import re
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.daemon.control_server import ControlServer
from tests.daemon.bench import Bench, at
from tests.daemon.control_client import ask, clients, control
from tests.daemon.test_live import Daemon

parser = pytest.importorskip("prometheus_client.parser")
exposition = pytest.importorskip("prometheus_client.exposition")

ANSWER_S = 60.0  # only to end a test that hangs
Samples = dict[tuple[str, tuple[tuple[str, str], ...]], float]
NAME = re.compile(r"canshaper_[a-z_]+")
DASHBOARD = ["metrics", "machine.yaml", "--dashboard"]


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


@contextmanager
def serving(path: Path, answer: dict[str, Any]) -> Iterator[None]:
    """A control socket that answers what a daemon has answered, until the block ends."""
    server, ended = ControlServer(path, 0o600), threading.Event()

    def serve() -> None:
        while not ended.is_set():
            server.serve(lambda _request, _peer: answer, time.monotonic_ns())

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        server.close()


def samples(text: str) -> tuple[dict[str, str], Samples]:
    """Kinds by name, and the value of each series, by the parser of prometheus_client."""
    families = list(parser.text_string_to_metric_families(text))
    assert all(one.documentation for one in families)
    values = {
        (one.name, tuple(sorted(one.labels.items()))): one.value
        for family in families
        for one in family.samples
    }
    return {one.name: one.type for one in families}, values


def scraped(path: Path) -> tuple[dict[str, str], Samples]:
    from canshaper.commissioning.metrics import registry_of

    return samples(exposition.generate_latest(registry_of(path)).decode())


def moving(bench: Bench, path: Path) -> dict[str, Any]:
    """The answer of a daemon whose slew axis moves, and that missed something."""
    control(bench, path)
    joysticks = bench.joysticks
    slew = chain([0] * 8, repeat(800))
    bench.joysticks = lambda **_raw: joysticks(Slew=next(slew))  # type: ignore[method-assign]
    replies: list[bytes] = []
    asks = ask(path, {"status": True})
    at(bench, {20: asks, 32: lambda: replies.append(clients[0].recv(65536))}, last=40)
    clients[0].close()
    answer: dict[str, Any] = json.loads(replies[0])
    answer["status"]["counters"]["MissedDeadlines"] = 3
    return answer


@pytest.mark.processes
def test_each_number_of_the_daemon_is_a_metric(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "c.sock"
    answer = moving(bench, path)
    slew = answer["status"]["axes"]["slew"]
    assert (slew["state"], slew["joystick"]) == ("ACTIVE", 0.8)
    with serving(path, answer):
        kinds, values = scraped(path)
    axis = ("axis", "slew")
    assert values["canshaper_up", ()] == 1
    assert values["canshaper_axis_state", (axis, ("state", "ACTIVE"))] == 1
    states = [
        v for (name, labels), v in values.items() if name.endswith("s_state") and labels[0] == axis
    ]
    assert sorted(states) == [0] * 5 + [1]
    assert values["canshaper_axis_reason", (axis, ("reason", "JOYSTICK_MOVED"))] == 1
    assert values["canshaper_axis_joystick_ratio", (axis,)] == 0.8
    assert values["canshaper_axis_setpoint_ratio", (axis,)] == slew["setpoint"] > 0
    assert values["canshaper_axis_sway_degrees", (axis,)] == slew["sway_deg"] > 0
    assert values["canshaper_bus_state", (("bus", "crane"), ("state", "up"))] == 1
    assert values["canshaper_faults_total", (("kind", "missed_deadlines"),)] == 3
    assert values["canshaper_tick_lateness_seconds", ()] == 0
    assert kinds["canshaper_faults"] == "counter"
    assert all(NAME.fullmatch(name) for name, _ in values)


@pytest.mark.processes
def test_a_daemon_that_has_gone_leaves_no_old_values(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "c.sock"
    with serving(path, moving(bench, path)):
        assert scraped(path)[1]["canshaper_up", ()] == 1
    assert scraped(path)[1] == {("canshaper_up", ()): 0}
    with serving(path, {"error": "expected {}"}):  # one that does not know the question
        assert scraped(path)[1] == {("canshaper_up", ()): 0}


@pytest.mark.processes
def test_the_dashboard_asks_for_metrics_that_there_are(bench: Bench, tmp_path: Path) -> None:
    printed = CliRunner().invoke(app, DASHBOARD)
    assert printed.exit_code == 0
    dashboard = json.loads(printed.stdout)
    queries = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
    queries += [one["query"]["query"] for one in dashboard["templating"]["list"][1:]]
    path = tmp_path / "c.sock"
    with serving(path, moving(bench, path)):
        there = {name for name, _ in scraped(path)[1]}
    asked = {name for query in queries for name in NAME.findall(query)}
    assert asked == there


@pytest.mark.slow
@pytest.mark.processes
def test_a_real_daemon_is_served_on_the_loopback_until_it_ends(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path)
    daemon.logged("started file=")
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = str(one.getsockname()[1])
    command = [sys.executable, "-m", "canshaper", "metrics", str(daemon.file), "--port", port]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as served:
        try:
            assert served.stderr
            url = served.stderr.readline().strip()
            assert url == f"http://127.0.0.1:{port}/metrics"

            def scrape() -> Samples:
                with urllib.request.urlopen(url, timeout=ANSWER_S) as reply:
                    return samples(reply.read().decode())[1]

            values = scrape()
            waits = (("axis", "slew"), ("state", "NEUTRAL_WAIT"))
            assert values["canshaper_up", ()] == values["canshaper_axis_state", waits] == 1
            taken = CliRunner().invoke(app, ["metrics", str(daemon.file), "--port", port])
            assert (taken.exit_code, taken.stderr.count("\n")) == (2, 1)
            assert f"--port: expected a free one, got {port}: Address already" in taken.stderr
            assert daemon.end() == 0
            assert scrape() == {("canshaper_up", ()): 0}
        finally:
            served.terminate()
        assert served.wait(ANSWER_S) == 0


def test_a_file_without_a_control_section_is_refused() -> None:
    result = CliRunner().invoke(app, ["metrics", "forwarder.yaml"])
    assert (result.exit_code, "has no control section" in result.stderr) == (2, True)
