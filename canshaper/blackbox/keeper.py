"""Keeps the black box of a daemon, and writes it to a file after a trip or stop or on request.

A forked process writes the file: the fork costs the loop about a millisecond, and a slow disk costs
it no time. The file is written at once, and a second time with the records that follow the trip.
The first file stays until the second one is complete, even if the daemon is killed.
"""

import errno
import logging
import os
import signal
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, NoReturn

from canshaper.blackbox.recorder import Recorder
from canshaper.blackbox.ring import Ring, Segment
from canshaper.blackbox.state import States
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.controller.gated import GatedController
from canshaper.errors import StateError
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import State

log = logging.getLogger("canshaper")

# Time between two saved states of the controller; a replay can begin at each. To save one takes a
# millisecond after the tick. With a tick shorter than SHORT_TICK_MS it is saved only while no axis
# moves.
STATE_NS = 10_000_000_000
SHORT_TICK_MS = 5
# Time after a trip until the second file is written.
AFTER_NS = 5_000_000_000
# Trips within BETWEEN_NS go into one file. LEAST_NS is the least time between two begins of writing
# it.
BETWEEN_NS = 30_000_000_000
LEAST_NS = 250_000_000
# Time until a file that could not be written is tried again.
RETRY_NS = 5_000_000_000
NEVER_NS = 1 << 63
STOPPED = frozenset((State.TRIPPED, State.STOPPING))
NO_FOLDER = "no folder for black boxes: see canshaper run --black-box"


class Kept(NamedTuple):
    """Content of a file that is being written, or could not be written."""

    deployment: Deployment
    number: int
    why: str
    segments: tuple[Segment, ...]  # held until the file is written
    at_ns: int  # when the segments were put aside


class BlackBox:
    """The black box of a daemon.

    Args:
        folder: folder for the files, created if it is missing; None writes no files.

    Attributes:
        fault: why the last file could not be written; empty once a file is written.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._ring = Ring()
        self._recorder: Recorder | None = None
        self._deployment: Deployment | None = None
        self._states: States | None = None
        self._short = False
        self._next_ns = 0  # when the next state is due
        self._now_ns = 0
        self._number = 0  # of the newest file
        self._begun_ns = 0  # time of the first trip or request in it
        self._why = ""  # reason for the file
        self._due_ns = NEVER_NS  # when to write the file next
        self._last_ns = 0  # when to write it for the last time
        self._least_ns = 0  # earliest time to begin
        self._kept: Kept | None = None  # content that is being written, or could not be
        self._writer = 0  # process id of the writer; 0 without one
        self._done, self.fault = 0, ""
        self._logged = 0  # number of the file that was logged last
        if folder:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                if not os.access(folder, os.W_OK):
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            except OSError as error:
                self._log_fault(error.errno or 1)

    def around(
        self, gated: GatedController, controller: Controller, kind: type[Recorder] = Recorder
    ) -> Recorder:
        """Make a recorder of a class for a controller behind its gate; ``begin`` starts it.

        Records of another deployment are dropped, after a file that is due is written. If the state
        of the controller cannot be saved, nothing is recorded.
        """
        deployment = controller.deployment
        self._flush()
        self._ring.pause()
        if self._deployment and self._deployment.identity != deployment.identity:
            self._finish()
            self._ring.clear()  # a reader would decode its frames with the wrong files
        self._deployment, self._states = deployment, None
        self._short = deployment.config.tick_ms < SHORT_TICK_MS
        try:
            self._states = States(gated, controller)
        except StateError as error:  # a filter of another package cannot be saved
            log.warning("black-box=none %s", error)
        if self._folder:
            from canshaper.blackbox.write import last_number

            self._number = max(self._number, last_number(self._folder, deployment.path.stem))
        self._recorder = kind(gated, controller, self._ring)
        return self._recorder

    def begin(self, now_ns: int) -> None:
        """Begin a segment; records between the last one and it are missing."""
        self._flush()  # empties the notes of earlier calls
        self._keep_state(now_ns, follows=False)

    def after_tick(self, now_ns: int, events: Iterable[object], *, neutral: bool) -> None:
        """Pack the records of a tick, save the state if it is due, and write files that are due.

        Args:
            now_ns: time of the tick.
            events: events of the tick; a trip or a stop schedules a file.
            neutral: whether every axis is neutral; with short ticks a state is saved only then.
        """
        self._flush()
        self._now_ns = now_ns
        for event in events:
            if isinstance(event, StateEvent) and event.transition.new in STOPPED:
                self._happened(event.text, now_ns + AFTER_NS)
        if now_ns >= self._next_ns and (neutral or not self._short or self._ring.cut_off):
            self._keep_state(now_ns, follows=True)
        if self._writer:
            done, status = os.waitpid(self._writer, os.WNOHANG)
            if done:
                self._ended(status, now_ns)
        elif now_ns >= self._due_ns:
            self._start_writer(now_ns)

    def _happened(self, why: str, last_ns: int) -> None:
        """Schedule a file now and at ``last_ns``: the last one, after ``BETWEEN_NS`` a new one."""
        if not self._folder or not self._ring.segments:
            return
        now_ns = self._now_ns
        if not self._why or now_ns >= self._begun_ns + BETWEEN_NS:
            self._number += 1
            self._why, self._begun_ns = why, now_ns
        self._last_ns = last_ns
        if not (self.fault and self._kept):  # a file that failed is retried first
            self._due_ns = min(self._due_ns, max(now_ns, self._least_ns))

    def request(self) -> None:
        """Schedule a file on request of a client; none if nothing is recorded.

        Raises:
            ValueError: the daemon has no folder for files.
        """
        if self._folder is None:
            raise ValueError(NO_FOLDER)
        self._happened("requested", self._last_ns)

    def report(self) -> dict[str, object]:
        """Return attempts (``tried``), last ``fault``, ``folder``; ``waits``: a file is due."""
        waits = bool(self._writer or self._due_ns != NEVER_NS)
        return {"tried": self._done, "fault": self.fault, "folder": str(self._folder or ""),
                "waits": waits}  # fmt: skip

    def failed(self, why: str) -> None:
        """Schedule a file after a failure of the program; ``close`` writes it."""
        self._happened(why, 0)

    def close(self) -> None:
        """Write a file that is due, and end; every valve is neutral by now."""
        self._flush()
        self._finish()

    def _finish(self) -> None:
        """Wait for the writer, and write a file that is due; the loop is not running."""
        if self._writer:
            self._ended(os.waitpid(self._writer, 0)[1], NEVER_NS)
        if self._due_ns != NEVER_NS:
            self._keep()
            self._ended(self._write() << 8, NEVER_NS)
        self._kept, self._due_ns, self._why = None, NEVER_NS, ""

    def _flush(self) -> None:
        if self._recorder is not None:
            self._recorder.flush()

    def _keep_state(self, now_ns: int, *, follows: bool) -> None:
        self._next_ns = now_ns + STATE_NS
        if self._states is None:
            return
        try:
            state = self._states.save()
        except StateError as error:
            self._states = None
            self._ring.clear()
            self._due_ns = NEVER_NS
            log.warning("black-box=none %s", error)
            return
        self._ring.begin(state, now_ns, follows=follows)

    def _keep(self) -> None:
        """Put the recorded segments aside for the writer, unless older ones still wait."""
        segments = self._ring.segments
        if self._kept is None:
            assert self._deployment is not None
            if segments[0].begin_ns > self._begun_ns:  # the ring has lost what the file contains
                self._number += 1
                self._begun_ns = self._now_ns
            self._kept = Kept(self._deployment, self._number, self._why, segments, self._now_ns)
            for segment in segments:
                segment.held = True

    # -- the writer ----------------------------------------------------------------------------

    def _write(self) -> int:
        """Write what was put aside; return an error number, or 0."""
        assert self._folder is not None
        assert self._kept is not None
        from canshaper.blackbox.write import write_box

        deployment, number, why, segments, _ = self._kept
        try:
            write_box(self._folder, deployment, segments, why, number)
        except OSError as error:
            return error.errno or 1
        return 0

    def _start_writer(self, now_ns: int) -> None:
        self._keep()
        self._least_ns = now_ns + LEAST_NS
        self._due_ns = self._last_ns if now_ns < self._last_ns else NEVER_NS
        try:
            self._writer = os.fork()
        except OSError as error:
            self._ended((error.errno or 1) << 8, now_ns)
            return
        if self._writer == 0:
            self._as_writer()

    def _as_writer(self) -> NoReturn:
        status = 1
        try:
            for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
                signal.signal(number, signal.SIG_IGN)  # the daemon handles them
            with suppress(OSError):  # at the priority of the loop, it could hold up the loop
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            status = self._write()
        finally:
            os._exit(status)

    def _ended(self, status: int, now_ns: int) -> None:
        assert self._kept is not None
        self._writer = 0
        self._done += 1
        if number := os.waitstatus_to_exitcode(status):
            self._log_fault(number)
            self._due_ns = now_ns + RETRY_NS
            return
        for segment in self._kept.segments:
            segment.held = False
        if self.fault:  # write again at once, if there were trips meanwhile or the ring has more
            newer = self._last_ns - AFTER_NS > self._kept.at_ns
            more = any(newer or one.begin_ns <= self._begun_ns for one in self._ring.segments)
            self._due_ns = min(self._due_ns, now_ns) if more else NEVER_NS
        if self._kept.number != self._logged:
            self._logged = self._kept.number
            log.warning("black-box=written folder=%s %s", self._folder, self._kept.why)
        self._kept, self.fault = None, ""

    def _log_fault(self, number: int) -> None:
        """Log why a file cannot be written (error number; negative: killed), if that is news."""
        fault = os.strerror(number) if number > 0 else "killed"
        if fault != self.fault:
            log.error("black-box=not-written folder=%s %s", self._folder, fault)
        self.fault = fault
