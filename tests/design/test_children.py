"""Processes end with the one that started them, also where that is killed."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.campaign.jobs import square

pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(sys.platform != "linux", reason="the kernel ends them: Linux only"),
]

LIMIT_S = 60.0
# Parents that print the numbers of their processes and then wait for ever.
POOL = f"""
import multiprocessing, time
from canshaper.design.parallel import Processes
from {square.__module__} import square
results = Processes(2).run(square, range(9))
next(results)
print(*(process.pid for process in multiprocessing.active_children()), flush=True)
time.sleep(1e6)
"""
DRIVE = """
import sys, time
from pathlib import Path
from canshaper.design.processes import Crew, Transport
from canshaper.machine.binding import load_deployment
from canshaper.shipped import deployment_path
machine = load_deployment(deployment_path("forwarder.yaml"))
crew = Crew(machine, Transport("udp_multicast", "239.99.7.3", ""), Path(sys.argv[1]))
crew.start("sim")
crew.start("run")
while b"started file=" not in (Path(sys.argv[1]) / "run").read_bytes():
    time.sleep(0.01)
print(*(process.pid for process in crew._processes.values()), flush=True)
time.sleep(1e6)
"""


def state_of(pid: int) -> str:
    """Letter of proc(5); Z is one that has ended and waits for the process that adopts it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0]
    except (FileNotFoundError, ProcessLookupError):
        return "Z"


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("code", [POOL, DRIVE], ids=["pool", "drive"])
def test_they_end_with_their_parent(code: str, how: signal.Signals, tmp_path: Path) -> None:
    command = [sys.executable, "-c", code, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        try:
            assert parent.stdout is not None
            children = [int(pid) for pid in parent.stdout.readline().split()]
            assert [state_of(pid) == "Z" for pid in children] == [False, False]
        finally:
            parent.send_signal(how)
    limit = time.monotonic() + LIMIT_S
    while any(state_of(pid) != "Z" for pid in children):
        assert time.monotonic() < limit, "they outlive their parent"
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("parent", "status"), [("os.getppid()", 0), ("os.getpid()", 1)])
def test_a_process_of_a_pool_whose_parent_has_ended_before_it_began(
    parent: str, status: int
) -> None:
    code = f"import os; from canshaper.design.parallel import _begin; _begin({parent})"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == status
