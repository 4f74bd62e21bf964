"""The daemon: it connects buses, controller and loop, and handles signals."""

import logging
import os
import signal
from collections.abc import Callable, Iterable
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from canshaper.blackbox.keeper import BlackBox
from canshaper.blackbox.recorder import Recorder
from canshaper.bus.interface import AWAY
from canshaper.bus.port import Port
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.events import RefusalEvent
from canshaper.controller.gated import GatedController
from canshaper.daemon.notify import ServiceManager
from canshaper.daemon.ports import (
    close_ports,
    new_ports,
    open_ports,
    opened_line,
    opened_ports,
    seen_sent,
    send_neutral,
    taken_over,
)
from canshaper.daemon.realtime import Collector, lock_memory, refuse_huge_pages
from canshaper.daemon.reloads import Reloads
from canshaper.daemon.reporter import Reporter, flush
from canshaper.errors import BusError, InternalError, raised
from canshaper.gate.cycle import Standstill, boottime_ns, io_cycle, run_at_deadlines
from canshaper.machine.deployment import Deployment
from canshaper.machine.identity import program_sha256

if TYPE_CHECKING:
    from canshaper.daemon.control import Control
    from canshaper.daemon.follow import TickFollower

log = logging.getLogger("canshaper")

INTERNAL_ERROR = "INTERNAL_ERROR"
# States of a bus on which no node receives our frames, or we receive none.
OFF_BUS = AWAY | {BusState.BUS_OFF, BusState.NOT_CONFIRMED}


class Daemon:
    """Runs a deployment until a signal stops it.

    Args:
        load: reads the deployment, at the start and, in a forked process, at every SIGHUP. The
            daemon sends no valve frame for a deployment that only listens.
        folder: folder for the files of the black box; None writes none.

    Raises:
        ConfigError: the deployment is not valid.
        BusError: a bus cannot be opened, or a gateway's socket; for a bus a service waits instead.
    """

    def __init__(self, load: Callable[[], Deployment], folder: Path | None = None) -> None:
        self._stop = False
        self._manager = ServiceManager()
        self._collector = Collector()
        self._reporter = Reporter(self._manager)
        self._reloads = Reloads(load, self._reporter.refused)
        self._black_box = BlackBox(folder)
        deployment = load()
        program_sha256()  # cached from now on: to read the program takes longer than a tick
        self._ports = opened_ports(deployment, self._on_fault, self._manager)
        self._line = opened_line(deployment, self._on_fault)
        self._standstill = Standstill(deployment)
        self._recorder: Recorder
        self._use(deployment)

    def run(self) -> None:
        """Run until a signal, then send neutral and close; a second signal ends at once.

        Raises:
            InternalError: a part of the program raised an exception; the end was the same.
        """
        failure = ""
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._on_signal)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # if ignored, ``waitpid`` fails
        names = ",".join(self._controller.axes)
        if self._controller.deployment.listen_only:
            log.warning("listen-only=yes valves=none: nothing is sent but status")
        refuse_huge_pages()
        log.info("memory=%s", f"not-locked ({why})" if (why := lock_memory()) else "locked")
        self._collector.freeze()
        # Most valves accept other commands only after a neutral one.
        valves = self._send_neutral(wait=True)
        self._black_box.begin(boottime_ns())
        file = self._controller.deployment.path
        log.info("started file=%s axes=%s valves=%s", file, names, valves)
        self._reporter.identity()
        self._manager.ready(f"started, axes {names}")
        try:
            while not self._stop:
                wait = self._wait if self._line else None
                run_at_deadlines(self._tick_ns, self._body, wait, self._follower)
        except Exception as error:
            failure = f"reason={INTERNAL_ERROR} {raised(error)}"
        finally:
            self._manager.stopping()
            try:
                valves = self._send_neutral(wait=True)
            except Exception as error:  # the first failure is reported
                valves, failure = "not-sent", failure or f"reason={INTERNAL_ERROR} {raised(error)}"
            if failure:
                log.critical("failed %s", failure)
                self._black_box.failed(failure)
            close_ports(self._ports.values())
            if self._line:
                self._line.close()
            self._reloads.end()
            if self._control:
                self._control.close()
            self._black_box.close()
        log.info("stopped valves=%s", valves)
        if failure:
            raise InternalError(failure)

    # -- one tick ------------------------------------------------------------------------------

    def _body(self, now_ns: int, missed: int, late_ns: int) -> bool:
        """Run one tick; return False to end the loop, for good or for a new deployment."""
        io_cycle(self._recorder, self._ports, now_ns, missed, self._standstill)
        if self._line:
            self._line.pass_others()
        self._reporter.late(late_ns)
        self._housekeeping(now_ns)
        # A reload takes time, refused or not; the next tick counts it as lateness.
        ready = self._reloads.ready if self._controller.neutral else None
        applied = ready and not self._stop and self._apply(ready)
        return not (self._stop or applied)

    def _wait(self, seconds: float) -> None:
        """Pass frames of a gateway on until the next deadline, in ``seconds``."""
        assert self._line is not None  # called for a gateway only
        self._line.wait(seconds, self._recorder, self._ports, self._standstill)

    def _housekeeping(self, now_ns: int) -> None:
        """Report changes, and do all work that may take time, after the frames are sent."""
        controller = self._controller
        self._manager.ping(now_ns)
        self._reporter.events()
        self._black_box.after_tick(now_ns, controller.events, neutral=controller.neutral)
        controller.events.clear()
        for name, port in self._ports.items():
            if port.state in OFF_BUS:
                self._recorder.on_bus_off(name)
        self._reporter.buses(now_ns)
        if self._follower and (news := self._follower.news()):
            log.warning("%s", news)
        self._reporter.faults(now_ns)
        self._reloads.step(neutral=controller.neutral)
        if self._line:
            self._line.check(now_ns, neutral=controller.neutral)
        if self._control:
            self._control.serve(now_ns)
        if self._reporter.status(now_ns, self._trouble):
            self._send_identity()
            flush()  # a slow reader of the log may read again
        self._collector.pause(now_ns)

    def _trouble(self) -> list[str]:
        """Return the entries with which the status line of the service begins."""
        trouble = [f"black box not written: {fault}"] if (fault := self._black_box.fault) else []
        return trouble + ["tick plain"] * bool(self._follower and not self._follower.follows)

    # -- deployments ---------------------------------------------------------------------------

    def _use(self, deployment: Deployment, before: Controller | None = None) -> None:
        if before:
            self._recorder.reloads()
        self._controller = Controller(deployment)
        gated = GatedController(self._controller)
        if before:
            self._controller.carry_over(before)
            gated.carry_over(self._gated)
        self._gated: GatedController = gated
        kind, control = Recorder, deployment.config.control
        if control and control.rehearse_faults:
            from canshaper.daemon.rehearsal.rehearsal import Rehearsal

            kind = Rehearsal
        self._recorder = self._black_box.around(gated, self._controller, kind)
        self._reporter.use(self._controller, self._ports)
        self._control: Control | None = None
        if control:
            from canshaper.daemon.control import open_control

            parts = self._controller, self._recorder, self._black_box, self._reporter
            self._control = open_control(deployment, *parts)
        self._tick_ns = deployment.config.tick_ms * 1_000_000
        self._follower: TickFollower | None = None
        if deployment.config.tick:
            from canshaper.daemon.follow import tick_follower

            self._follower = tick_follower(deployment, self._controller)

    def _apply(self, deployment: Deployment) -> bool:
        """Replace the deployment if its buses can be opened; return whether it was replaced.

        Every axis is neutral and the tick is over, so to open a bus may take time.
        """
        self._manager.reloading()
        self._reloads.ready = None
        config = self._controller.deployment.config
        opened = {bus: self._ports[name] for name, bus in config.buses.items()}
        ports: dict[str, Port] = {}
        try:
            ports = open_ports(deployment, opened, self._on_fault)
            line = opened_line(deployment, self._on_fault)
        except BusError as error:
            close_ports(new_ports(ports, opened))
            self._manager.ready("as before")
            self._reporter.refused(str(error))
            return False
        self._send_neutral()
        waited = taken_over(ports, opened, deployment, self._read)
        self._ports = ports
        if self._line:
            self._line.close()
        self._line = line
        if self._control:
            self._control.close()
        self._use(deployment, before=self._controller)
        if waited is not None:
            self._read(waited)
        self._black_box.begin(boottime_ns())
        self._standstill = Standstill(deployment, before=self._standstill)
        log.info("reload=applied file=%s", deployment.path)
        self._reporter.identity()
        self._manager.ready("reload applied")
        self._reporter.hold_status()
        self._collector.freeze()
        return True

    def _read(self, waited: Iterable[Frame]) -> None:
        """Receive frames that waited during a reload; they are too old to move an axis."""
        self._gated.stalled()
        now_ns = boottime_ns()
        for frame in waited:
            self._gated.receive(frame, now_ns)

    # -- ends ----------------------------------------------------------------------------------

    def _send_neutral(self, *, wait: bool = False) -> str:
        """Send every valve neutral; ``wait``: return what ``seen_sent`` says after a moment.

        Returns:
            ``not-sent`` if a frame was refused or not sent, or we only listen; else ``sent``.

        Raises:
            Exception: a neutral frame could not be made; all others were sent first.
        """
        sent = send_neutral(self._ports, self._recorder.neutral_frames())
        events = self._controller.events
        refused = any(isinstance(one, RefusalEvent) for one in events)
        self._reporter.events()
        events.clear()
        if error := self._controller.not_neutral:
            raise error
        if refused or not sent or self._controller.deployment.listen_only:
            return "not-sent"
        if not wait:
            return "sent"
        recorder = self._recorder
        return seen_sent(self._ports.values(), lambda one: recorder.receive(one, boottime_ns()))

    def _send_identity(self) -> None:
        """Send the digest of program and deployment, if the file has a message for it."""
        frame = self._controller.status.identity(self._controller.silent_buses)
        passes = frame and self._gated.passes(frame, boottime_ns())
        if frame and passes and not self._ports[frame.bus].send(frame):
            self._recorder.send_failed(frame)

    def _on_fault(self, fault: FrameFault) -> None:
        self._recorder.fault(fault)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGHUP:
            self._reloads.request()
        elif self._stop:
            self._leave_at_once(number)
        else:
            self._stop = True

    def _leave_at_once(self, number: int) -> NoReturn:
        """End at the second signal: send every valve neutral once more, and exit without a wait."""
        for frame in self._recorder.neutral_frames():
            self._ports[frame.bus].send(frame)
        self._reporter.events()
        log.warning("stopped at-once signal=%s", signal.Signals(number).name)
        flush()
        os._exit(128 + number)
