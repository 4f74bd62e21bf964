"""Operator, daemon and plant as processes on a bus; the processes end with their parent."""

import ctypes
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from canshaper.bus.port import Port
from canshaper.codec.frame import Frame
from canshaper.errors import BusError, DriveError
from canshaper.machine.deployment import Deployment
from canshaper_sim.cranes import cranes
from canshaper_sim.operator import Script
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.realtime import open_ports
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import Recording

PR_SET_PDEATHSIG = 1  # linux/prctl.h

_CODE = f"""
import os, signal, sys
from {__name__} import end_with_parent
end_with_parent(signal.SIGTERM)
if os.getppid() != int(sys.argv.pop(1)):
    sys.exit(1)
from canshaper.__main__ import main
main()
"""


def end_with_parent(how: signal.Signals) -> None:
    """Have the kernel send this process the signal ``how`` when its parent ends (prctl(2)).

    The kernel does not signal a parent that ended before the call: the caller checks for it
    afterwards. On systems other than Linux the function does nothing.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, how)


def canshaper_command(*words: str) -> list[str]:
    """Return the command line that runs ``canshaper`` as a child of this process.

    If this process ends first, the child gets SIGTERM: a daemon then leaves the valves neutral.

    Args:
        words: the verb, its arguments and options.
    """
    return [sys.executable, "-c", _CODE, str(os.getpid()), *words]


__all__ = ["BusDrive", "Crew", "DriveError", "Transport", "choose_transport", "drive_on_bus"]

# Processes import and open their buses; slow virtual machines take many times as long as a PC.
START_LIMIT_S = 60.0
STOP_LIMIT_S = 10.0
# Period of the checks of the children while nothing is on the buses, s.
LISTEN_STEP_S = 0.1


@dataclass(frozen=True)
class Transport:
    """The bus that connects the processes, as options of python-can, and in words for the user."""

    interface: str
    channel: str
    description: str


@dataclass(frozen=True)
class BusDrive:
    """A drive on a bus, and the number of deadlines that the daemon missed in it."""

    recording: Recording
    missed_deadlines: int


def choose_transport(request: str, deployment: Deployment) -> Transport:
    """Return the transport for a request: a SocketCAN channel, "udp_multicast" or "auto".

    "auto" takes vcan0 if it opens, otherwise multicast.

    Raises:
        DriveError: the deployment has several buses or cranes, or the requested transport does not
            open.
    """
    if len(deployment.config.buses) > 1 or cranes(deployment):
        raise DriveError("this deployment has several buses or cranes; drive it with --lockstep")
    # A group of this process alone: two demos on one machine must not receive from each other.
    group = f"239.{1 + os.getpid() // 65536 % 250}.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
    multicast = Transport("udp_multicast", group, "udp_multicast (python-can)")
    channel = "vcan0" if request == "auto" else request
    socketcan = Transport("socketcan", channel, f"{channel} (SocketCAN)")
    if request == "udp_multicast":
        return multicast
    try:
        for port in open_ports(on_transport(deployment, socketcan)).values():
            port.close()
    except BusError as error:
        if request == "auto":
            return multicast
        raise DriveError(str(error)) from None
    return socketcan


def on_transport(deployment: Deployment, transport: Transport) -> Deployment:
    """Return the deployment with its bus on this transport."""
    change = {
        "interface": transport.interface,
        "channel": transport.channel,
        "network": False,  # whatever the machine's own bus is
    }
    buses = {n: b.model_copy(update=change) for n, b in deployment.config.buses.items()}
    return replace(deployment, config=deployment.config.model_copy(update={"buses": buses}))


def drive_on_bus(
    deployment: Deployment,
    transport: Transport,
    script: Script,
    changes: list[str],
    *,
    bypass: bool,
    on_progress: Callable[[float], None],
    on_frame: Callable[[Frame, float], object] | None = None,
) -> BusDrive:
    """Drive a script with three processes; record the frames received on the bus.

    Args:
        script: the strokes of the operator.
        changes: parameters of the crane, NAME=VALUE, as for ``canshaper sim --set``.
        bypass: drive with anti-sway switched off.
        on_progress: called with the driven time in s.
        on_frame: called with every frame from the operator's start on, and its monotonic time in s.

    Raises:
        BusError: the transport does not open.
        DriveError: a process ended early or does not answer.
    """
    recorder = Recorder(deployment, changed_parameters(changes, deployment))
    valves = {axis.valve_message.name for axis in deployment.axes.values()}
    sets = [word for change in changes for word in ("--set", change)]
    with tempfile.TemporaryDirectory() as logs:
        ports = open_ports(on_transport(deployment, transport))
        crew = Crew(deployment, transport, Path(logs))
        try:
            crew.start("sim", *sets)
            crew.start("run")
            _listen(ports, recorder, crew, lambda: recorder.seen >= {*valves, "GrappleSway"})
            begin = time.monotonic()
            crew.start("operator", "--script", script.name, *(["--bypass"] if bypass else []))
            _listen(
                ports,
                recorder,
                crew,
                lambda: crew.ended("operator"),
                lambda: on_progress(min(time.monotonic() - begin, script.duration_s)),
                on_frame=on_frame,
            )
        finally:
            crew.stop()
            for port in ports.values():
                port.close()
    return BusDrive(recorder.recording(), recorder.missed_deadlines)


def _listen(
    ports: dict[str, Port],
    recorder: Recorder,
    crew: "Crew",
    done: Callable[[], bool],
    report: Callable[[], None] | None = None,
    *,
    on_frame: Callable[[Frame, float], object] | None = None,
) -> None:
    """Record frames from the bus until ``done``; without ``report`` raise after the start limit."""
    limit = time.monotonic() + START_LIMIT_S
    files = [port.fileno() for port in ports.values()]
    while not done():
        select.select(files, [], [], LISTEN_STEP_S)
        for port in ports.values():
            for frame in port.frames():
                now_s = time.monotonic()
                recorder.receive(frame, now_s)
                if on_frame:
                    on_frame(frame, now_s)
        crew.check()
        if report:
            report()
        elif time.monotonic() > limit:
            raise DriveError(f"no frames within {START_LIMIT_S:g} s; received {recorder.seen}")


class Crew:
    """The child processes of one drive; ``stop`` ends all of them."""

    def __init__(self, deployment: Deployment, transport: Transport, logs: Path) -> None:
        self._file = str(deployment.path)
        self._options = ["--interface", transport.interface, "--channel", transport.channel]
        self._logs = logs
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, verb: str, *options: str) -> None:
        """Start ``canshaper VERB FILE`` on the transport."""
        command = canshaper_command(verb, self._file, *self._options, *options)
        with (self._logs / verb).open("wb") as log:
            self._processes[verb] = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    def ended(self, verb: str) -> bool:
        """Return whether the process of this verb has ended."""
        return self._processes[verb].poll() is not None

    def check(self) -> None:
        """Raise DriveError if a process has failed; only the operator may end, with status 0."""
        for verb, process in self._processes.items():
            status = process.poll()
            if status is not None and not (verb == "operator" and status == 0):
                text = (self._logs / verb).read_text(errors="replace").strip()
                raise DriveError(f"canshaper {verb} ended with status {status}:\n{text}")

    def stop(self) -> None:
        """End all processes, the daemon first: it leaves the valves neutral."""
        for verb in ("run", "operator", "sim"):
            if (process := self._processes.get(verb)) is not None:
                end(process)


def end(process: "subprocess.Popen[bytes]") -> None:
    """End a process by SIGTERM, so that a daemon leaves the valves neutral; kill it after 10 s."""
    process.terminate()
    try:
        process.wait(STOP_LIMIT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
