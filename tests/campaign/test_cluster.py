"""A Dask cluster: a real scheduler and real workers, one of them killed in the middle."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from canshaper.campaign.run import Source, run_campaign
from canshaper.campaign.store import Store
from canshaper.design.parallel import Processes
from canshaper.machine.binding import load_deployment
from tests.cli.invocation import invoke
from tests.rigs.files import ROOT

pytest.importorskip("distributed", reason="Dask is not installed: pip install 'canshaper[cluster]'")

from canshaper.campaign.engine import Cluster

pytestmark = pytest.mark.processes

ROBUST = ROOT / "config" / "forwarder-robust.yaml"
LIMIT_S = 60.0
REFUSED = r"worker tcp://[\d.:]+: expected the program sha256:\w{12}, got sha256:\w{12}"


class Nodes:
    """Scheduler and workers as processes of their own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.running: list[subprocess.Popen[bytes]] = []
        log = self._start("scheduler", "distributed.cli.dask_scheduler", "--port", "0")
        self.address = self._wait(log, r"Scheduler at: +(tcp://[\d.]+:\d+)")

    def worker(self, cwd: Path = ROOT) -> subprocess.Popen[bytes]:
        name = f"worker{len(self.running)}"
        arguments = self.address, "--local-directory", str(self._folder), "--nthreads", "1"
        log = self._start(name, "distributed.cli.dask_worker", *arguments, "--no-nanny", cwd=cwd)
        self._wait(log, "(Starting established connection)")
        return self.running[-1]

    def _start(self, name: str, module: str, *arguments: str, cwd: Path = ROOT) -> Path:
        log = self._folder / f"{name}.log"
        command = [sys.executable, "-m", module, *arguments]
        command += ["--no-dashboard", "--host", "127.0.0.1"]
        with log.open("wb") as file:
            self.running.append(subprocess.Popen(command, stdout=file, stderr=file, cwd=cwd))
        return log

    def _wait(self, log: Path, pattern: str) -> str:
        until = time.monotonic() + LIMIT_S
        while not (match := re.search(pattern, log.read_text())):
            assert self.running[-1].poll() is None, log.read_text()
            assert time.monotonic() < until, log.read_text()
            time.sleep(0.05)
        return match[1]

    def end(self) -> None:
        for process in reversed(self.running):
            process.kill()
            process.wait()


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Nodes]:
    made = Nodes(tmp_path)
    yield made
    made.end()


def another_version(folder: Path) -> Path:
    """A copy of the program with a line more."""
    for room in ("canshaper", "sim"):
        shutil.copytree(ROOT / room, folder / room)
    with (folder / "canshaper" / "shipped.py").open("a") as file:
        file.write("# another version\n")
    return folder


def source() -> Source:
    deployment = load_deployment(ROBUST)
    return Source.of(deployment, deployment.config.uncertainty)


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_no_drive_and_none_counts_twice(
    nodes: Nodes, tmp_path: Path
) -> None:
    victim, _ = nodes.worker(), nodes.worker()
    what, seeds = source(), range(112)
    store = Store(tmp_path / "cluster", what.about)
    done: list[int] = []

    def on_progress(drives: int) -> None:
        done.append(drives)
        if len(done) == 3:
            os.kill(victim.pid, signal.SIGKILL)

    run_campaign(Cluster(nodes.address), what, seeds, store, on_progress)
    assert victim.wait() == -signal.SIGKILL
    assert done == [*range(0, 113, 16)]
    alone = Store(tmp_path / "alone", what.about)
    run_campaign(Processes(1), what, range(0, 112, 20), alone, lambda _drives: None)
    columns, expected = store.columns(), alone.columns()
    assert columns["seed"] == [*seeds]
    assert {name: column[::20] for name, column in columns.items()} == expected


@pytest.mark.slow
def test_a_worker_of_another_version_is_reported_and_the_rest_goes_on(
    nodes: Nodes, tmp_path: Path
) -> None:
    copy = another_version(tmp_path / "other")
    nodes.worker(cwd=copy)
    nodes.worker()
    refusals: list[str] = []
    what = source()
    store = Store(tmp_path / "cluster", what.about)
    engine = Cluster(nodes.address, refusals.append)
    run_campaign(engine, what, range(48), store, lambda _drives: None)
    assert [bool(re.fullmatch(REFUSED, text)) for text in refusals] == [True]
    assert store.columns()["seed"] == [*range(48)]


@pytest.mark.slow
def test_only_workers_of_another_version_end_the_campaign(nodes: Nodes, tmp_path: Path) -> None:
    copy = another_version(tmp_path / "other")
    nodes.worker(cwd=copy)
    arguments = ["campaign", str(ROBUST), "-n", "16", "--scheduler", nodes.address]
    done = invoke(*arguments, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "every worker has another version than this program" in done.output


def test_a_scheduler_that_is_not_there_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("canshaper.campaign.engine.CONNECT_S", 0.5)
    arguments = ["campaign", str(ROBUST), "-n", "16", "--scheduler", "tcp://127.0.0.1:9"]
    arguments += ["--engine", "python"]  # said by name, or a machine without a compiler says so
    done = invoke(*arguments, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert done.output.startswith("tcp://127.0.0.1:9: no scheduler answers: ")
    assert len(done.output.splitlines()) == 1


@pytest.mark.parametrize(
    "address", ["nonsense", "tcp://host:port", "tcp://127.0.0.1", "http://x:1"]
)
def test_an_address_that_is_none_is_reported_before_anything_connects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    def connects(*_arguments: object, **_options: object) -> None:
        raise AssertionError

    monkeypatch.setattr("distributed.Client", connects)
    arguments = ["campaign", str(ROBUST), "-n", "16", "--scheduler", address]
    done = invoke(*arguments, "--out", tmp_path / "out")
    expected = f"{address}: expected the address of a scheduler, such as tcp://10.0.0.1:8786\n"
    assert (done.exit_code, done.output) == (2, expected)
