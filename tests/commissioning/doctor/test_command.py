"""The command itself, in its own process: what it prints and writes, how it ends, what it leaves.

Times are not judged here: they are those of the machine that runs the tests.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from canshaper.commissioning.doctor.processes import load_kinds
from tests.commissioning.doctor.conftest import SHIPPED

# Only to end a test that hangs.
PATIENCE_S = 120.0
# A shell's background job, such as a build's, has Ctrl-C ignored.
WITH_CTRL_C = (
    "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL);"
    "os.execv(sys.argv[1], sys.argv[1:])"
)
TIMES = ("late_us", "joystick_us", "valve_us", "tick_us")


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "canshaper", "doctor", *map(str, arguments)]


def doctor(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )


@pytest.mark.slow
def test_the_numbers() -> None:
    """Of both runs, as JSON and nothing else."""
    done = doctor(SHIPPED, "--seconds", "1", "--json")
    data = json.loads(done.stdout)
    assert done.returncode == (0 if data["fit"] else 1)
    assert data["fit"] == all(f["level"] != "bad" for f in data["findings"])
    assert (data["tick_ms"], data["seconds"]) == (20, 1.0)
    assert list(data["runs"]) == ["idle", "under load"]
    for run in data["runs"].values():
        # All deadlines from 0 to 1 s are accounted for; the first one is no measurement.
        assert run["ticks"] + run["missed"] >= 49
        assert run["late_us"]["count"] == run["ticks"]
        assert run["tick_us"]["count"] == run["ticks"] + 1
        for name in TIMES:
            times = run[name]
            assert sum(b["count"] for b in times["histogram"]) == times["count"]
            assert 0 <= times["p50"] <= times["p99"] <= times["p99_9"] <= times["max"]
            assert times["histogram"][-1]["up_to"] >= times["max"]
        assert run["valve_us"]["max"] <= run["tick_us"]["max"]
        assert run["valve_us"]["p50"] <= run["joystick_us"]["max"]


@pytest.mark.slow
def test_what_people_read() -> None:
    done = doctor(SHIPPED, "--seconds", "1")
    out = done.stdout
    assert done.stderr == ""
    assert "Nothing was sent on any bus." in out
    for head in ("tick lateness, us", "joystick to valve, us", "p99.9", "under load"):
        assert head in out
    assert "█" in out
    levels = re.findall(r"^(ok|note|warning|bad) +\S[^:\n]*: \S", out, re.MULTILINE)
    assert len(levels) > 5
    assert done.returncode == (1 if "bad" in levels else 0)
    verdict = out.splitlines()[-1]
    assert verdict.startswith("Not fit for" if "bad" in levels else "Fit for")


@pytest.mark.slow
def test_without_load_there_is_one_run() -> None:
    done = doctor("forwarder.yaml", "--seconds", "0.5", "--no-load", "--json")
    assert done.returncode in (0, 1)
    assert list(json.loads(done.stdout)["runs"]) == ["idle"]


def test_a_wrong_deployment_is_reported_before_anything_runs(tmp_path: Path) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text("tick_ms: 0\n")
    done = doctor(file)
    assert done.returncode == 2
    assert f"{file}:1: tick_ms: expected a whole number, 1 to 50 ms, got 0" in done.stderr
    assert done.stdout == ""


# -- ends ------------------------------------------------------------------------------------------


def children_of(pid: int) -> set[int]:
    """Processes of a measurement that this process started, even if it is gone itself."""
    pids = set()
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
        except OSError:
            continue
        if len(words) > 2 and f'"parent": {pid},' in words[-2]:
            pids.add(int(entry.name))
    return pids


def wait_until_there_are(pid: int, number: int) -> None:
    until = time.monotonic() + PATIENCE_S
    while len(children_of(pid)) != number:
        assert time.monotonic() < until, f"not {number} processes: {children_of(pid)}"
        time.sleep(0.02)


@pytest.fixture
def running(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """The command in its run under load, with all its processes."""
    process = subprocess.Popen(
        [sys.executable, "-c", WITH_CTRL_C, *command(SHIPPED, "--seconds", "0.5")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    try:
        wait_until_there_are(process.pid, len(load_kinds()) + 2)
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_nothing_stays_however_it_ends(
    running: subprocess.Popen[str], tmp_path: Path, number: signal.Signals, status: int
) -> None:
    running.send_signal(number)
    out, err = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == status
    assert out == ""
    assert err == ("interrupted\n" if number == signal.SIGINT else "")
    if number == signal.SIGINT:
        assert children_of(running.pid) == set()
    wait_until_there_are(running.pid, 0)  # the kernel ends them when their parent is gone
    assert list(tmp_path.iterdir()) == []  # no file of the disk load


def test_the_daemon_does_not_import_it() -> None:
    code = (
        "import sys, canshaper.cli.app, canshaper.daemon.daemon, canshaper.cli.common;"
        "print([m for m in sys.modules if m.startswith('canshaper.commissioning.doctor')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
