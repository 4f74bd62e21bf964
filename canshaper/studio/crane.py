"""One simulated crane behind a real daemon: the processes, their bus, and their reports."""

import contextlib
import json
import math
import os
import re
import signal
import socket
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from canshaper.bus.port import Port
from canshaper.codec.frame import Frame
from canshaper.commissioning.doctor.processes import JOYSTICKS_PRIORITY, LOOP_PRIORITY
from canshaper.config.load import load_config
from canshaper.design.processes import Transport, canshaper_command, end
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.studio.numbers import adjustable, sliders
from canshaper.studio.view import CraneView, Report
from canshaper_sim.axes import ON_ROPE, ROTATOR
from canshaper_sim.crane import CraneParameters
from canshaper_sim.hand import Hand, Held
from canshaper_sim.joints import JointBoom
from canshaper_sim.machines import AXES_OF, build_machine, machine_for

if TYPE_CHECKING:
    from canshaper.studio.in_process import InProcessCrane

# From the end of a process to its restart: a Ctrl-C, which every process gets, is over by then.
RESTART_S = 1.0
_LATE = re.compile(r"\blate (\d+) us")
CANSHAPER = tuple(canshaper_command())


def copied(path: Path, directory: Path) -> tuple[Path, Deployment]:
    """Write a copy of a file whose numbers the sliders may change; return path and deployment.

    Args:
        path: the file.
        directory: folder for the copy.

    Raises:
        ConfigError: the file is not valid.
    """
    load_deployment(path)  # problems of the file itself, with its lines
    config, source = load_config(path)
    data = dict(source.data)
    data["dbc"] = [str(path.resolve().parent / name) for name in config.dbc]
    ranges = adjustable(sliders(config))
    if config.control:
        ranges |= config.control.adjustable
    if ranges:
        data["control"] = {"socket": str(directory / "control.sock"), "adjustable": ranges}
    copy = directory / path.name
    copy.write_text(json.dumps(data, indent=1), encoding="utf-8")  # JSON is YAML
    return copy, load_deployment(copy)


@dataclass
class Child:
    """A process and its log; without ``process`` it starts at ``start_at_s`` (monotonic, s)."""

    command: list[str]
    log: Path
    process: subprocess.Popen[bytes] | None = None
    start_at_s: float = 0.0


class Crane:
    """``canshaper sim`` and ``canshaper run`` on a bus of their own; ``check`` (re)starts them.

    Args:
        name: name of the crane, for logs and sockets.
        file: the deployment file.
        transport: the bus.
        directory: folder for logs and sockets; it must outlive this object.
        report: called with each event of the processes.
        changes: parameters of the crane, NAME=VALUE.
        program: command that starts the daemon; a benchmark gives a wrapper.

    Attributes:
        control: control socket of the daemon.
        starts: number of starts of the daemon so far.
    """

    def __init__(
        self,
        name: str,
        file: Path,
        transport: Transport,
        directory: Path,
        *,
        report: Report,
        changes: Sequence[str] = (),
        program: Sequence[str] = CANSHAPER,
    ) -> None:
        self.control = directory / f"{name}.sock"
        self._report = report
        self._stopping = False
        self.starts = 0
        bus = ["--interface", transport.interface, "--channel", transport.channel]
        run = ["run", str(file), *bus]
        if load_config(file)[0].control:
            run += ["--control", str(self.control)]
        sim = ["sim", str(file), *bus, *(word for c in changes for word in ("--set", c))]
        self._children = {
            "sim": Child([*CANSHAPER, *sim], directory / f"{name}-sim.log"),
            "run": Child([*program, *run], directory / f"{name}-run.log"),
        }
        # The daemon's report to its service manager once a second.
        self._status = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._status_path = directory / f"{name}-notify.sock"
        self._status.bind(str(self._status_path))

    def check(self, now_s: float) -> None:
        """Start processes that do not run; report an end, and start again ``RESTART_S`` later."""
        for verb, child in self._children.items():
            if child.process is None:
                if now_s >= child.start_at_s and not self._stopping:
                    self._start(verb, child, now_s)
            elif (status := child.process.poll()) is not None:
                child.process, child.start_at_s = None, now_s + RESTART_S
                if not self._stopping:
                    last = _last_line(child.log)
                    text = f"canshaper {verb} ended with status {status}; it starts again. {last}"
                    self._report(text.strip(), "bad")

    def _start(self, verb: str, child: Child, now_s: float) -> None:
        environment = {**os.environ, "NOTIFY_SOCKET": str(self._status_path)}
        if verb != "run":
            del environment["NOTIFY_SOCKET"]
        try:
            with child.log.open("wb") as log:
                child.process = subprocess.Popen(
                    child.command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment
                )
        except OSError as error:
            child.start_at_s = now_s + RESTART_S
            self._report(f"canshaper {verb} cannot start: {error.strerror}; tried again", "bad")
            return
        self.starts += verb == "run"
        # The daemon as its unit does it, the crane as little delayed as the joysticks: where that
        # is permitted. A browser that draws without a graphics card takes every processor.
        priority = LOOP_PRIORITY if verb == "run" else JOYSTICKS_PRIORITY
        with contextlib.suppress(OSError):
            os.sched_setscheduler(child.process.pid, os.SCHED_FIFO, os.sched_param(priority))

    def reload(self) -> None:
        """Make the daemon read its file again, by SIGHUP; do nothing if it does not run."""
        if (process := self._children["run"].process) is not None:
            process.send_signal(signal.SIGHUP)

    def late_us(self) -> int | None:
        """Return the daemon's last report of its largest lateness, us; None if none is new."""
        late = None
        with contextlib.suppress(BlockingIOError):
            while True:
                text = self._status.recv(4096).decode(errors="replace")
                if match := _LATE.search(text):
                    late = int(match[1])
        return late

    def stop(self) -> None:
        """End both processes for good, the daemon first: it leaves the valves neutral."""
        self._stopping = True
        for verb in ("run", "sim"):
            if (process := self._children[verb].process) is not None:
                end(process)
        self._status.close()


def _last_line(log: Path) -> str:
    lines = log.read_text(errors="replace").strip().splitlines()
    return lines[-1][:200] if lines else ""


def groups(count: int) -> list[Transport]:
    """Return ``count`` multicast groups, chosen by process id: two studios do not meet."""
    pid = os.getpid()  # at most 2 ** 22
    first = 100 + count * (pid // 65536) % 128
    names = [f"239.{first + i}.{pid // 256 % 256}.{pid % 256}" for i in range(count)]
    return [Transport("udp_multicast", name, "udp_multicast (python-can)") for name in names]


class SimulatedPose:
    """Pose and sway for buses without them, from a simulated crane behind the valve frames.

    The simulated crane begins in its start pose, wherever the machine stood.

    Args:
        view: gives the valve commands, and gets pose and sway.
        deployment: the machine of the axes.
        parameters: the crane.
    """

    def __init__(
        self, view: CraneView, deployment: Deployment, parameters: CraneParameters
    ) -> None:
        self._view = view
        moves = deployment.coordinates
        self._axes = {moves.get(name, name): name for name in deployment.axes if name != ROTATOR}
        self._machine = build_machine(machine_for(deployment.coordinates.values()), parameters)

    @staticmethod
    def fits(deployment: Deployment) -> bool:
        """Return whether a crane without a rope has all axes of a deployment but the rotator."""
        moves = deployment.coordinates
        axes = {moves.get(name, name) for name in deployment.axes.keys() - {ROTATOR}}
        kind = machine_for(moves.values())
        return kind not in ON_ROPE and axes <= {*AXES_OF[kind]}

    def advance(self, dt_s: float, now_s: float) -> None:
        """Move the crane by the view's valve commands for dt_s seconds; give the view its pose."""
        view, crane = self._view, self._machine.crane
        self._machine.step(
            dt_s, {moved: view.axes[name].opening for moved, name in self._axes.items()}
        )
        state = crane.state
        heading = math.degrees(math.remainder(state.theta1_rad, 2.0 * math.pi))
        joints = None
        if isinstance(crane.boom, JointBoom):
            _, lift, knuckle, extension = crane.boom.joints
            joints = (math.degrees(lift), math.degrees(knuckle), extension)
        sway = (math.degrees(state.theta5_rad), math.degrees(state.theta6_rad))
        view.simulate((heading, state.radius_m, state.height_m), joints, sway, now_s)


@dataclass
class CraneSession:
    """A crane on the page, with its ports by bus and, if simulated, its processes or ``here``.

    ``hand`` sends joystick frames on the ports. Unless ``shaped``, anti-sway stays off.
    """

    view: CraneView
    ports: Mapping[str, Port]
    hand: Hand | None = None
    crane: Crane | None = None
    shaped: bool = True
    here: "InProcessCrane | None" = None

    def exchange(self, time_ms: int, held: Held, now_s: float, passed_ms: int) -> None:
        """Give the view all waiting frames, or those of ``here`` in passed_ms; call its ``check``.

        With a hand, also send the joystick frames that are due at time_ms.
        """
        frames: list[Frame] = []
        for port in self.ports.values():
            frames += port.frames()
        switched = held if self.shaped else replace(held, anti_sway=False)
        if self.here:
            frames = self.here.frames(switched, passed_ms)
        for frame in frames + self.move_joysticks(time_ms, switched):
            self.view.receive(frame, now_s)
        self.view.check(now_s)

    def move_joysticks(self, time_ms: int, held: Held) -> list[Frame]:
        """Send the joystick frames that are due at time_ms; return them (none without a hand)."""
        frames = list(self.hand.frames(time_ms, held)) if self.hand else []
        for frame in frames:
            self.ports[frame.bus].send(frame)
        return frames
