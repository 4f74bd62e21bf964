"""Faults rehearsed at the running machine: made on the input side, in front of controller and gate.

Loaded by a daemon whose file has ``control.rehearse_faults`` only. Why nothing can move by it that
the joystick did not ask for: see ``fault.Demands``.
"""

import logging
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from canshaper.blackbox.recorder import Recorder
from canshaper.codec.frame import Frame
from canshaper.config.bus import REDUCED_PCT
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.daemon.rehearsal.fault import MS, Demands, Fault, S
from canshaper.daemon.rehearsal.faults import rehearsed_faults
from canshaper.shaping.states import State

log = logging.getLogger("canshaper")

# How long a fault waits for its axis to move, and the axis has moved when it is made.
ARMED_NS, HELD_NS = 60 * S, S // 2
LEAST_DEMAND = 0.2
# How long is looked at after it is over, where the reaction is not over by then.
AFTER_NS, LONGEST_AFTER_NS = 300 * MS, 5 * S
MOST_EVENTS = 50
STOPS = (State.STOPPING.name, State.TRIPPED.name)
ARMED, MADE, OVER, DONE = "armed", "made", "over", "done"


class Rehearsal:
    """A recorder, with at most one fault in front of it.

    Args:
        recorder: who gets the frames.
        controller: the controller behind it.

    Attributes:
        connected: whether a client is still there.
    """

    connected: Callable[[str], bool]

    def __init__(self, recorder: Recorder, controller: Controller) -> None:
        self._recorder, self._controller = recorder, controller
        self.neutral_frames, self.on_bus_off = recorder.neutral_frames, recorder.on_bus_off
        self.withhold, self.send_failed = recorder.withhold, recorder.send_failed
        self.fault, self.set, self.stalled = recorder.fault, recorder.set, recorder.stalled
        deployment = controller.deployment
        self._demands = Demands(deployment)
        self._valves = frozenset(axis.valve.message.key for axis in deployment.axes.values())
        self._names = list(rehearsed_faults(deployment))
        self._told: dict[str, float] = {}  # what the controller was told last
        self._now_ns = 0
        self._begin(None, "")
        self._phase = DONE

    def _begin(self, fault: Fault | None, peer: str) -> None:
        self._fault, self._peer, self._phase = fault, peer, ARMED
        self._since_ns: int | None = None  # of this phase
        self._held_ns: int | None = None  # since when its axis moves
        self._made_ns: int | None = None  # when the first frame was another one
        self._neutral_ns: int | None = None
        self._tick = self._missed = 0
        self._waiting: list[tuple[Frame, int]] = []
        self._events: list[list[object]] = []
        self._spoken = False  # the sender of what ends it has sent the same message itself
        self._why = ""

    # -- what a client asks ----------------------------------------------------------------------

    def answer(self, what: object, peer: str, who: str) -> Mapping[str, Any]:
        """Begin a fault by its name, or say what has become of it.

        Args:
            what: name of a fault, ``report`` or ``end``.
            peer: who asks, as the socket knows him.
            who: the same for the log.

        Raises:
            ValueError: why it cannot be; nothing has changed.
        """
        if what == "end":
            self.end("ended by its client", stops=True)
        elif what != "report":
            self._arm(str(what), peer)
            log.warning("fault=armed name=%s %s", what, who)
        return self._report()

    def _arm(self, name: str, peer: str) -> None:
        controller = self._controller
        if name not in self._names:
            raise ValueError(f"expected one of {', '.join(self._names)}, got {name!r}")
        if self._phase != DONE:
            raise ValueError(f"expected one fault at a time, {self._named} is not over")
        for axis, runner in controller.axes.items():
            if (fast := runner.bound.config.limits.max_pct) > REDUCED_PCT:
                text = f"expected max_pct up to {REDUCED_PCT:g}, got {fast:g}"
                raise ValueError(f"axes.{axis}.limits: {text}: faults need reduced speed")
            if not runner.axis.neutral:
                state = runner.axis.state.name
                raise ValueError(f"expected every axis at rest, {axis} is {state}: let go first")
        self._begin(rehearsed_faults(controller.deployment)[name], peer)

    @property
    def _named(self) -> str:
        return self._fault.name if self._fault else ""

    def _report(self) -> dict[str, Any]:
        def ms(at_ns: int | None) -> float | None:
            return None if at_ns is None or self._made_ns is None else (at_ns - self._made_ns) / MS

        return {
            "name": self._named,
            "phase": self._phase,
            "made": self._made_ns is not None,
            "neutral_ms": ms(self._neutral_ns),
            "events": self._events,
            "why": self._why,
        }

    def end(self, why: str, *, stops: bool = False) -> None:
        """End what is rehearsed: from now on every frame passes as it is.

        Args:
            why: for the log.
            stops: as behind a standstill, what moves trips.
        """
        if self._phase in (ARMED, MADE):
            made, self._phase, self._since_ns = self._phase == MADE, OVER, None
            self._why = why
            assert self._fault is not None
            if made and not self._spoken:
                for frame in self._fault.ends:
                    self._recorder.receive(frame, self._now_ns)
            self._catch_up()
            if stops:
                self._recorder.stalled()
            log.warning("fault=over name=%s %s", self._named, why)

    # -- frames and ticks ------------------------------------------------------------------------

    @property
    def moves(self) -> bool:
        """Whether the frame that was handed out last may move a valve."""
        return self._recorder.moves

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Take a frame from a bus, see ``Guarded``."""
        asked = self._demands.read(frame)
        if self._phase == MADE and self._demands.takes_back(asked, self._told):
            self.end("the joystick was let go, or something was released")
        if self._phase == MADE:
            assert self._fault is not None
            if self._fault.stall and (self._waiting or self._fault.late(self._tick)):
                self._waiting.append((frame, now_ns))
                return None
            altered = self._altered(self._fault, frame, asked)
            if altered is not frame:
                self._made(now_ns)
                if altered is None:
                    return None
                return self._recorder.receive(altered, now_ns - self._fault.age_ns)
            if (copy := self._fault.copy(frame)) is not None:
                self._made(now_ns)
                self._recorder.receive(copy, now_ns)
        if self._fault is not None and frame[:3] in [one[:3] for one in self._fault.ends]:
            self._spoken = True
        self._told.update(asked)
        passed = self._recorder.receive(frame, now_ns)
        if passed is not None and self._phase == MADE and self._fault and self._fault.unsent:
            self._made(now_ns)  # of a gateway
            self._recorder.send_failed(passed)
        return passed

    def _altered(self, fault: Fault, frame: Frame, asked: Mapping[str, float]) -> Frame | None:
        """What is received in place of a frame: never one that asks for more than it does."""
        if fault.once and self._made_ns is not None:
            return frame
        altered = fault.alter(frame)
        if altered is None or altered is frame:
            return altered
        return altered if self._demands.no_more(self._demands.read(altered), asked) else frame

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """Run one tick, and yield the frames to send now; see ``Controller``."""
        if self._phase == DONE:
            yield from self._recorder.tick(now_ns, missed)
            return
        self._now_ns = now_ns
        self._step(now_ns)
        fault = self._fault
        assert fault is not None
        made = self._phase == MADE
        if made and fault.late(self._tick):
            self._tick += 1
            self._missed += 1 + missed
            self._made(now_ns)
            return
        self._tick += made
        self._catch_up()
        missed, self._missed = missed + self._missed, 0
        for frame in self._recorder.tick(now_ns, missed):
            yield frame
            if made and fault.unsent and frame[:3] in self._valves:
                self._made(now_ns)
                self._recorder.send_failed(frame)
        self._note(now_ns)

    def _catch_up(self) -> None:
        """What was held in a standstill that was made comes in as behind a real one."""
        if self._waiting:
            self._recorder.stalled()
            waiting, self._waiting = self._waiting, []
            for frame, at_ns in waiting:
                self._told.update(self._demands.read(frame))
                self._recorder.receive(frame, at_ns)

    def _made(self, now_ns: int) -> None:
        """Note when something was first other than on the bus."""
        if self._made_ns is None:
            self._made_ns = now_ns

    def _step(self, now_ns: int) -> None:
        """Go on to the next phase, where it is time."""
        fault = self._fault
        assert fault is not None
        if self._since_ns is None:
            self._since_ns = now_ns
        lasted_ns = now_ns - self._since_ns
        if self._phase == OVER:
            stops = any(event[2] in STOPS for event in self._events)
            over = self._neutral or not stops
            if lasted_ns > (AFTER_NS if over else LONGEST_AFTER_NS):
                self._phase = DONE
        elif not self.connected(self._peer):
            self.end("its client is gone", stops=True)
        elif self._phase == ARMED:
            if lasted_ns > ARMED_NS:
                self.end("its axis was not moved")
            elif self._held(fault, now_ns):
                self._make(fault, now_ns)
        elif lasted_ns > fault.lasts_ns:
            self.end("its time is over")

    def _held(self, fault: Fault, now_ns: int) -> bool:
        """Whether it is to be made now: its axis moves as announced, or all are at rest."""
        axes = [self._controller.axes[name].axis for name in fault.axes]
        if not axes:
            return self._controller.neutral
        if any(one.state is State.ACTIVE and abs(one.command) >= LEAST_DEMAND for one in axes):
            self._held_ns = now_ns if self._held_ns is None else self._held_ns
            return now_ns - self._held_ns >= HELD_NS
        self._held_ns = None
        return False

    def _make(self, fault: Fault, now_ns: int) -> None:
        self._phase, self._since_ns = MADE, now_ns
        log.warning("fault=made name=%s", fault.name)
        if fault.begins or fault.off or (fault.reports is not None and not fault.unsent):
            self._made(now_ns)
        if fault.reports is not None:
            self._recorder.fault(fault.reports)
        if fault.off:
            self._recorder.on_bus_off(fault.off)
        for frame in fault.begins:
            self._recorder.receive(frame, now_ns)

    def _note(self, now_ns: int) -> None:
        """Note what has changed since the fault was made, and when its valves are neutral."""
        if self._made_ns is None:
            return
        since_ms = (now_ns - self._made_ns) / MS
        for event in self._controller.events[: MOST_EVENTS - len(self._events)]:
            if isinstance(event, StateEvent):
                one = event.transition
                self._events.append([since_ms, event.axis, one.new.name, one.reason.name])
            else:
                self._events.append([since_ms, "", "", event.text])
        if self._neutral_ns is None and self._neutral:
            self._neutral_ns = now_ns

    @property
    def _neutral(self) -> bool:
        """Whether the valves of its axes are neutral, and stay so."""
        axes = [
            self._controller.axes[name].axis for name in (self._fault.axes if self._fault else ())
        ]
        return all(one.neutral and not one.raw for one in axes)
