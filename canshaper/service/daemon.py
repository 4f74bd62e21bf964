"""The daemon: buses, controller and loop together; signals; what is logged."""

import logging
import signal
import time
from collections.abc import Callable
from types import FrameType

from canshaper.can.binding import Deployment
from canshaper.can.bus import BusError, Port
from canshaper.can.frame import Frame, FrameFault
from canshaper.config.source import DeploymentError
from canshaper.service.controller import Controller
from canshaper.service.loop import run_at_deadlines

log = logging.getLogger("canshaper")

# How long the last neutral frames are tried when a queue is full: two ticks of the slowest loop.
NEUTRAL_TRIES_S = 0.1


class Daemon:
    """Runs a deployment until it is told to stop.

    Args:
        load: reads the deployment, at the start and at every SIGHUP.

    Raises:
        DeploymentError: the deployment is not valid.
        BusError: a bus cannot be opened.
    """

    def __init__(self, load: Callable[[], Deployment]) -> None:
        self._load = load
        self._stop = False
        self._reload = False
        self._logged_fault = FrameFault.NONE
        self._log_again_ns = 0
        deployment = load()
        self._ports = self._open(deployment)
        self._use(deployment)

    def run(self) -> None:
        """Run until SIGTERM or SIGINT; then every valve is told neutral and the buses close."""
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._on_signal)
        names = ",".join(self._controller.axes)
        log.info("started file=%s axes=%s", self._controller.deployment.path, names)
        try:
            while not self._stop:
                run_at_deadlines(self._tick_ns, self._body)
                if self._reload and not self._stop:
                    self._apply_reload()
        finally:
            self._send_neutral()
            self._close(self._ports)
        log.info("stopped valves=neutral")

    # -- one tick ------------------------------------------------------------------------------

    def _body(self, now_ns: int, missed: int) -> bool:
        """Take all waiting frames, tick the axes, send, then housekeeping."""
        controller = self._controller
        if missed * self._tick_ns > self._stall_ns:
            # What waits in the sockets is as old as the stall; it must not look fresh.
            for port in self._ports.values():
                for _ in port.frames():
                    pass
            controller.stalled()
        for port in self._ports.values():
            for frame in port.frames():
                controller.receive(frame, now_ns)
        for frame in controller.tick(now_ns, missed):
            if not self._ports[frame.bus].send(frame):
                controller.send_failed(frame)
        self._housekeeping(now_ns)
        return not (self._stop or (self._reload and controller.neutral))

    def _housekeeping(self, now_ns: int) -> None:
        """Tell what changed; everything that may take time comes after the frames are out."""
        controller = self._controller
        for event in controller.events:
            t = event.transition
            log.info(
                "axis=%s state=%s from=%s reason=%s",
                event.axis,
                t.new.name,
                t.old.name,
                t.reason.name,
            )
        controller.events.clear()
        fault = controller.counters.last_fault
        if fault is not self._logged_fault and now_ns >= self._log_again_ns:
            self._logged_fault = fault
            self._log_again_ns = now_ns + 1_000_000_000  # two faults in turn must not flood the log
            log.warning("fault=%s counts=%s", fault.name, controller.counters.values)

    # -- deployments ---------------------------------------------------------------------------

    def _use(self, deployment: Deployment) -> None:
        self._controller = Controller(deployment)
        self._tick_ns = deployment.config.tick_ms * 1_000_000
        shortest_ms = min(lever.config.timeout_ms for lever in deployment.levers.values())
        self._stall_ns = shortest_ms * 1_000_000

    def _open(self, deployment: Deployment) -> dict[str, Port]:
        ports: dict[str, Port] = {}
        try:
            for name, bus in deployment.config.buses.items():
                ports[name] = Port(name, bus, self._on_fault)
        except BusError:
            self._close(ports)
            raise
        return ports

    def _apply_reload(self) -> None:
        """Replace the deployment by the file as it is now, if that is valid; else go on as before.

        Called with every axis neutral and no tick running, so it may take its time.
        """
        self._reload = False
        try:
            deployment = self._load()
            same = deployment.config.buses == self._controller.deployment.config.buses
            ports = self._ports if same else self._open(deployment)
        except (DeploymentError, BusError) as error:
            for line in str(error).splitlines():
                log.error("reload=refused %s", line)
            return
        self._send_neutral()
        if not same:
            self._close(self._ports)
        self._ports = ports
        self._use(deployment)
        log.info("reload=applied file=%s", deployment.path)

    # -- ends ----------------------------------------------------------------------------------

    def _send_neutral(self) -> None:
        """Send every valve neutral, for a while again where a queue is full."""
        waiting: list[Frame] = self._controller.neutral_frames()
        until = time.monotonic() + NEUTRAL_TRIES_S
        while waiting:
            waiting = [f for f in waiting if not self._ports[f.bus].send(f)]
            if time.monotonic() > until:
                break
            if waiting:
                time.sleep(0.005)
        for frame in waiting:
            log.error("neutral=not-sent bus=%s id=%#x", frame.bus, frame.can_id)

    def _close(self, ports: dict[str, Port]) -> None:
        for port in ports.values():
            port.close()

    def _on_fault(self, fault: FrameFault) -> None:
        self._controller.counters.add(fault)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGHUP:
            self._reload = True
        else:
            self._stop = True
