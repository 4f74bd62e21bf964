"""Keeps the black box of a daemon, and writes it to a file after a trip or when it is asked for.

The file is written by a process of its own, begun while every axis is neutral: that costs the loop
about a millisecond, and the disk costs it nothing.
"""

import logging
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from canshaper.blackbox.recorder import Recorder
from canshaper.blackbox.ring import Ring, Segment
from canshaper.blackbox.state import States
from canshaper.blackbox.write import write_box
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.controller.guarded import Guarded
from canshaper.errors import StateError
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import State

log = logging.getLogger("canshaper")

# Time between two saved states of the controller; a replay can begin at each. To save one takes a
# millisecond after the tick: with a tick shorter than this it is done only while nothing moves.
STATE_NS = 10_000_000_000
SHORT_TICK_MS = 5
# How long after a trip the recording goes on.
AFTER_NS = 5_000_000_000
# A machine that trips again and again writes one file a minute, with all of them in it.
BETWEEN_NS = 60_000_000_000
STOPPED = frozenset((State.TRIPPED, State.STOPPING))
NO_FOLDER = "no folder for black boxes: see canshaper run --black-box"


class BlackBox:
    """The black box of a daemon.

    Args:
        folder: where files are written; None for nowhere.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._ring = Ring()
        self._recorder: Recorder | None = None
        self._deployment: Deployment | None = None
        self._states: States | None = None
        self._short = False
        self._next_ns = 0  # when the next state is due
        self._why = ""  # what happened, and is to be written
        self._due_ns = 0
        self._not_before_ns = 0
        self._frozen: tuple[Segment, ...] = ()  # to be written when every axis is neutral
        self._frozen_why = ""
        self._writer = 0  # process
        self._done, self._fault = 0, ""

    def around(self, guarded: Guarded, controller: Controller) -> Recorder:
        """Return a recorder of all calls to a controller and their results; ``begin`` starts it."""
        deployment = controller.deployment
        self._flush()
        self._ring.pause()
        if self._deployment and self._deployment.identity != deployment.identity:
            self._freeze()
            self._ring.clear()  # its frames would be read with the wrong files
        self._deployment, self._states = deployment, None
        self._short = deployment.config.tick_ms < SHORT_TICK_MS
        try:
            self._states = States(guarded, controller)
        except StateError as error:  # of a filter of another package
            log.warning("black-box=none %s", error)
        self._recorder = Recorder(guarded, controller, self._ring)
        return self._recorder

    def begin(self, now_ns: int) -> None:
        """Record everything from here on."""
        self._flush()  # what was before is not
        self._keep_state(now_ns, follows=False)

    def after_tick(self, now_ns: int, events: Iterable[object], *, neutral: bool) -> None:
        """Do what can wait until the frames are out.

        Args:
            now_ns: time of the tick.
            events: what changed in it.
            neutral: whether every axis is.
        """
        self._flush()
        for event in events:
            if isinstance(event, StateEvent) and event.transition.new in STOPPED and not self._why:
                self._why = event.text
                self._due_ns = max(now_ns + AFTER_NS, self._not_before_ns)
        if self._why and now_ns >= self._due_ns:
            self._not_before_ns = now_ns + BETWEEN_NS
            self._freeze()
            self._keep_state(now_ns, follows=True)
        elif now_ns >= self._next_ns and (neutral or not self._short or self._ring.cut_off):
            self._keep_state(now_ns, follows=True)
        if self._writer:
            self._look_after_writer()
        elif self._frozen and neutral:
            self._start_writer()

    def request(self) -> None:
        """Have a file written as soon as every axis is neutral.

        Raises:
            ValueError: there is nowhere to write one.
        """
        if self._folder is None:
            raise ValueError(NO_FOLDER)
        if not self._frozen and not self._writer:
            self._why, self._due_ns = self._why or "requested", 0

    def report(self) -> dict[str, object]:
        """How many files were tried to be written, and what was wrong with the last one."""
        waits = bool(self._frozen or self._writer or self._why)
        return {"tried": self._done, "fault": self._fault, "folder": str(self._folder or ""),
                "waits": waits}  # fmt: skip

    def failed(self, why: str) -> None:
        """Note a failure of the program: what is recorded so far is written at the end."""
        self._why = why

    def close(self) -> None:
        """End with the daemon: write now what is to be written; every valve is neutral."""
        self._flush()
        if self._writer:
            self._ended(os.waitpid(self._writer, 0)[1])
        self._freeze()
        if self._frozen:
            self._ended(_exit_status(self._write()))

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
            log.warning("black-box=none %s", error)
            return
        self._ring.begin(state, now_ns, follows=follows)

    def _freeze(self) -> None:
        """Put aside what there is, where something has happened."""
        if self._why and not self._frozen and not self._writer and self._folder:
            self._frozen_why = self._why
            self._frozen = self._ring.segments
            for segment in self._frozen:
                segment.held = True
        self._why = ""

    # -- the writer ----------------------------------------------------------------------------

    def _write(self) -> int:
        """Write what was put aside; an error number, 0 for none."""
        assert self._folder is not None
        assert self._deployment is not None
        try:
            write_box(self._folder, self._deployment, self._frozen, self._frozen_why)
        except OSError as error:
            return error.errno or 1
        return 0

    def _start_writer(self) -> None:
        try:
            self._writer = os.fork()
        except OSError as error:
            self._ended(_exit_status(error.errno or 1))
            return
        if self._writer == 0:
            self._as_writer()

    def _as_writer(self) -> NoReturn:
        status = 1
        try:
            with suppress(OSError):  # with the loop's priority it could keep it from the processor
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            status = self._write()
        finally:
            os._exit(status)

    def _look_after_writer(self) -> None:
        done, status = os.waitpid(self._writer, os.WNOHANG)
        if done:
            self._ended(status)

    def _ended(self, status: int) -> None:
        self._writer, self._frozen = 0, ()
        self._done += 1
        number = os.waitstatus_to_exitcode(status)
        self._fault = os.strerror(number) if number > 0 else "killed" if number else ""
        if self._fault:
            log.error("black-box=not-written folder=%s %s", self._folder, self._fault)
        else:
            log.warning("black-box=written folder=%s %s", self._folder, self._frozen_why)


def _exit_status(number: int) -> int:
    """The status that waitpid gives for a process that ended with this number."""
    return number << 8
