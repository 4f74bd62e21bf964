"""Slurm, the real one on this machine: its controller, its node, and jobs of a campaign."""

import getpass
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from canshaper.campaign.engine import Slurm
from canshaper.campaign.run import Source, run_campaign
from canshaper.campaign.store import Store
from canshaper.design.parallel import Processes
from canshaper.machine.binding import load_deployment
from tests.cli.invocation import invoke

if find_spec("dask_jobqueue") is None:
    pytest.skip("not installed: pip install 'canshaper[cluster]'", allow_module_level=True)

ROBUST = Path(__file__).resolve().parents[2] / "config" / "forwarder-robust.yaml"
LIMIT_S = 30.0
ON_SLURM = "campaign", ROBUST, "--cluster", "slurm"
TWO_JOBS = *ON_SLURM, "-n", "16", "--processes", "2"
CONFIG = """\
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/none
CredType=cred/none
SlurmUser={user}
SlurmdUser={user}
StateSaveLocation={folder}
SlurmdSpoolDir={folder}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SchedulerParameters=batch_sched_delay=0
SlurmdParameters=config_overrides
KillWait=1
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=8000 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP
"""


def says(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def until(command: list[str], expected: str) -> None:
    """Wait until a command of Slurm says this."""
    end = time.monotonic() + LIMIT_S
    while (got := says(*command)) != expected:
        assert time.monotonic() < end, f"{command}: {got}"
        time.sleep(0.1)


@pytest.fixture
def slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    if shutil.which("slurmctld") is None or shutil.which("slurmd") is None:
        pytest.skip("Slurm is not installed: apt install slurmctld slurmd slurm-client")
    folder = tmp_path / "slurm"
    folder.mkdir()
    with socket.socket() as one, socket.socket() as two:
        one.bind(("127.0.0.1", 0))
        two.bind(("127.0.0.1", 0))
        ports = one.getsockname()[1], two.getsockname()[1]
    path, host = folder / "slurm.conf", socket.gethostname().split(".")[0]
    user = getpass.getuser()
    path.write_text(CONFIG.format(host=host, ports=ports, user=user, folder=folder))
    monkeypatch.setenv("SLURM_CONF", str(path))
    monkeypatch.chdir(tmp_path)
    running = []
    for program in ("slurmctld", "slurmd"):
        with (folder / f"{program}.log").open("wb") as log:
            command = [shutil.which(program) or "", "-D", "-f", str(path)]
            running.append(subprocess.Popen(command, stdout=log, stderr=log))
    until(["sinfo", "--noheader", "-o", "%T"], "idle")
    yield
    for process in reversed(running):
        process.terminate()
        process.wait()


@pytest.mark.processes
@pytest.mark.usefixtures("slurm")
def test_a_job_that_is_cancelled_is_replaced_and_loses_no_drive(tmp_path: Path) -> None:
    deployment = load_deployment(ROBUST)
    what, seeds = Source.of(deployment, deployment.config.uncertainty), range(112)
    store = Store(tmp_path / "slurm-drives", what.about)
    done: list[int] = []
    jobs: list[list[str]] = []

    def on_progress(drives: int) -> None:
        done.append(drives)
        jobs.append(says("squeue", "--noheader", "-o", "%i").split())
        if len(done) == 3:
            subprocess.run(["scancel", jobs[-1][0]], check=True)

    run_campaign(Slurm(1), what, seeds, store, on_progress)
    assert done == [*range(0, 113, 16)]
    assert jobs[-1] != jobs[2]
    alone = Store(tmp_path / "alone", what.about)
    run_campaign(Processes(1), what, range(0, 112, 20), alone, lambda _drives: None)
    columns, expected = store.columns(), alone.columns()
    assert columns["seed"] == [*seeds]
    assert {name: column[::20] for name, column in columns.items()} == expected
    until(["squeue", "--noheader"], "")


@pytest.mark.processes
@pytest.mark.usefixtures("slurm")
def test_what_slurm_refuses_ends_the_campaign_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    import dask

    with dask.config.set({"jobqueue.slurm.queue": "night"}):
        done = invoke(*TWO_JOBS)
    assert done.exit_code == 2
    assert done.output.startswith("slurm: sbatch: error: invalid partition specified: night")
    assert says("squeue", "--noheader") == ""


def test_a_machine_without_slurm_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    for name in [name for name in sys.modules if name.startswith("dask_jobqueue")]:
        monkeypatch.delitem(sys.modules, name)
    ctrl_c = signal.getsignal(signal.SIGINT)
    done = invoke(*TWO_JOBS)
    assert done.exit_code == 2
    engine, slurm = done.output.splitlines()
    assert engine == "engine: python, for want of a C compiler"
    assert slurm.startswith("slurm: expected the command sbatch on this machine: ")
    assert signal.getsignal(signal.SIGINT) is ctrl_c  # that dask_jobqueue replaces at its import


@pytest.mark.parametrize("more", [[], ["--processes", "2", "--scheduler", "tcp://10.0.0.1:8786"]])
def test_jobs_want_a_number_and_have_a_scheduler_of_their_own(
    tmp_path: Path, more: list[str]
) -> None:
    done = invoke(*ON_SLURM, "--out", tmp_path, *more)
    expected = "--cluster: expected --processes, its jobs, and no --scheduler\n"
    assert (done.exit_code, done.output) == (2, expected)
