"""Common to the real-time benchmarks: machine with virtual time, deployments, processes.

Latency is counted in virtual time: the benchmark runs in the lane of the HIL tests with
``--bench``, where one executed instruction, of the kernel too, takes one nanosecond. The figures
are repeatable on any host; they know no caches and no bus time.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from canshaper.config.schema import Bus
from canshaper.config.source import Source
from canshaper.daemon.realtime import lock_memory, refuse_huge_pages

ROOT = Path(__file__).resolve().parents[1]
PEERS = ROOT / "benchmarks" / "peers"
DBC = ROOT / "dbc" / "forwarder.dbc"
CONFIG = ROOT / "config" / "forwarder.yaml"

# That of the systemd unit. The client's differs, for at the same one latencies have two modes; it
# is the lower one, so that the client never delays a gateway that its frame has woken.
GATEWAY_FIFO = 40
CLIENT_FIFO = 30
AT_WORK_NS = 20_000_000  # CPU time of a process that has read its files and begun
START_S = 300.0  # virtual time runs ahead while a process waits for its files


# -- the machine -------------------------------------------------------------------------------


def run_in_lane(kernel: str) -> int:
    """Run this same command in the machine with virtual time; return its exit status."""
    lane = [sys.executable, "-m", "tests.lane", "--bench", "--timeout", "0"]
    lane += ["--kernel", kernel, "--", sys.executable, *sys.argv]
    return subprocess.run(lane, cwd=ROOT, check=False).returncode


def as_client() -> None:
    """Give this process, which sends what gateways answer, its priority, and all of its memory.

    Virtual time runs on while a page is read from the host, or joined to a huge one.
    """
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(CLIENT_FIFO))
    refuse_huge_pages()
    lock_memory()


# -- processes ---------------------------------------------------------------------------------


@contextmanager
def running(
    command: Sequence[str | Path], log: Path, fifo: int | None = GATEWAY_FIFO
) -> Iterator[subprocess.Popen[bytes]]:
    """A process with its output in ``log``; ended when the block is left."""
    with log.open("wb") as file:
        process = subprocess.Popen(
            [*_policy(fifo), *map(str, command)], stdout=file, stderr=file, start_new_session=True
        )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def _policy(fifo: int | None) -> list[str]:
    """Words before a command that give it a FIFO priority, or the ordinary policy."""
    return ["chrt", "-o", "0"] if fifo is None else ["chrt", "-f", str(fifo)]


def wait_for_text(process: subprocess.Popen[bytes], log: Path, text: str) -> None:
    """Wait until the process has written this."""
    until = time.monotonic() + START_S
    while text not in log.read_text(errors="replace"):
        if process.poll() is not None or time.monotonic() > until:
            raise SystemExit(f"no {text!r} from {process.args}:\n{log.read_text()}")
        time.sleep(0.05)


def cpu_ns(pid: int) -> int:
    """CPU time that all threads of a process have used, ns."""
    tasks = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(task.read_text().split()[0]) for task in tasks)


def _worked_ns(pid: int) -> int:
    """CPU time of a process and of its children that have ended, ns."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    ended = int(fields[13]) + int(fields[14])  # cutime, cstime: proc(5)
    return cpu_ns(pid) + ended * 1_000_000_000 // os.sysconf("SC_CLK_TCK")


@contextmanager
def load(directory: Path, kinds: Sequence[str]) -> Iterator[Callable[[], bool]]:
    """Other load of a machine PC, at ordinary priority.

    Args:
        directory: where the writer writes.
        kinds: of ``flood`` (cangen without a gap on vcan1, candump reading it), ``same`` (a
            foreign message on vcan0, as many as fill 250 kbit/s), ``busy`` (two loops), ``disk``
            (a writer).

    Yields:
        Whether all of it is at work; until then virtual time runs ahead.
    """
    write = f"while :; do dd if=/dev/zero of={directory}/written bs=64k count=64 conv=fsync; done"
    commands = {
        "flood": [["cangen", "vcan1", "-g", "0", "-I", "7F0"], ["candump", "vcan1"]],
        "same": [["cangen", "vcan0", "-g", "0.5", "-I", "7F0"]],  # some 1900 frames per second
        "busy": [
            ["sh", "-c", "while :; do :; done"],
            [sys.executable, "-c", "while 1: sum(range(1000))"],
        ],
        "disk": [["sh", "-c", write]],
    }
    processes = [
        subprocess.Popen(
            [*_policy(None), *command],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        for kind in kinds
        for command in commands[kind]
    ]
    try:
        yield lambda: all(_worked_ns(process.pid) > AT_WORK_NS for process in processes)
    finally:
        for process in processes:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


LOADS = ("flood", "same", "busy", "disk")


# -- deployments -------------------------------------------------------------------------------


def _cycle(dbc: str, can_id: int, cycle_ms: int) -> str:
    """The DBC with another cycle of one message."""
    old = next(
        line for line in dbc.splitlines() if line.startswith(f'BA_ "GenMsgCycleTime" BO_ {can_id} ')
    )
    return dbc.replace(old, f'BA_ "GenMsgCycleTime" BO_ {can_id} {cycle_ms};')


def shipped(directory: Path, channel: str) -> Path:
    """The shipped deployment on this SocketCAN channel."""
    return on_channel(directory, Bus(interface="socketcan", channel=channel))


def on_channel(directory: Path, bus: Bus) -> Path:
    """The shipped deployment on this bus."""
    data: dict[str, Any] = Source(CONFIG).data
    data["dbc"] = [str(DBC)]
    data["buses"]["crane"] = {"interface": bus.interface, "channel": bus.channel}
    file = directory / "shipped.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    return file


def slew_only(directory: Path, channel: str, tick_ms: int) -> Path:
    """The slew axis of the shipped deployment alone, at this tick: joystick and valve as often.

    Its rates are the quickest allowed, so that one frame shows a change at a short tick too.
    """
    data: dict[str, Any] = Source(CONFIG).data
    dbc = DBC.read_text()
    for can_id in (0x110, 0x200):
        dbc = _cycle(dbc, can_id, tick_ms)
    (directory / f"slew{tick_ms}.dbc").write_text(dbc)
    data["tick_ms"] = tick_ms
    data["dbc"] = [f"slew{tick_ms}.dbc"]
    data["buses"]["crane"]["channel"] = channel
    data["joysticks"] = {"left": data["joysticks"]["left"]}
    data["axes"] = {"slew": data["axes"]["slew"]}
    data["axes"]["slew"]["limits"] |= {"rise_per_s": 100, "fall_per_s": 100}
    file = directory / f"slew{tick_ms}.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    return file


def daemon(file: Path) -> list[str]:
    """Command that runs the daemon."""
    return [sys.executable, "-m", "canshaper", "run", str(file)]
