"""Rehearses faults at the running machine, on the input side, in front of controller and gate.

Only a daemon whose file has ``control.rehearse_faults`` loads this module. ``fault.Demands`` says
why no axis can move by a rehearsed fault unless its joystick demands that.
"""

import logging
from collections.abc import Iterator, Mapping
from typing import Any

from canshaper.blackbox.recorder import Recorder
from canshaper.blackbox.ring import Ring
from canshaper.codec.frame import Frame
from canshaper.config.bus import REDUCED_PCT
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.controller.gated import GatedController
from canshaper.daemon.rehearsal.fault import MS, Asked, Demands, Fault, S, no_more, takes_back
from canshaper.daemon.rehearsal.faults import rehearsed_faults
from canshaper.shaping.states import State

log = logging.getLogger("canshaper")

# Longest time that a fault waits for its axis to move; time that the axis has moved by at least
# LEAST_DEMAND before the fault is made.
ARMED_NS, HELD_NS = 60 * S, S // 2
LEAST_DEMAND = 0.2
# A client that has sent no request for so long is gone.
GONE_NS = 3 * S
# Time after the end of a fault in which events are noted, in addition to the timeout of a joystick;
# longest such time while a stop is not over.
AFTER_NS, LONGEST_AFTER_NS = 300 * MS, 5 * S
MOST_EVENTS = 50
STOPS = (State.STOPPING.name, State.TRIPPED.name)
ARMED, MADE, OVER, DONE = "armed", "made", "over", "done"
NOTHING = Fault("", "", (), 0)


class Rehearsal(Recorder):
    """A recorder that makes one fault at a time on the input side; arguments as ``Recorder``."""

    def __init__(self, gated: GatedController, controller: Controller, ring: Ring) -> None:
        super().__init__(gated, controller, ring)
        deployment = controller.deployment
        self._demands, self._now_ns = Demands(deployment), 0
        self._valves = frozenset(axis.valve.message.key for axis in deployment.axes.values())
        slowest = max(one.config.timeout_ms for one in deployment.joysticks.values())
        self._after_ns = AFTER_NS + slowest * MS
        self._begin(NOTHING, DONE)

    def _begin(self, fault: Fault, phase: str = ARMED) -> None:
        self._fault, self._phase, self._why = fault, phase, ""
        # Time when the phase began, of the client's last request, when no axis of it last moved.
        self._since_ns = self._asked_ns = self._still_ns = self._now_ns
        self._made_ns: int | None = None  # when the first input was altered
        self._neutral_ms: float | None = None  # time from then until neutral
        self._tick = self._missed = 0
        self._applied: dict[str, float] = {}  # demands of frames that passed
        self._events: list[list[object]] = []
        self._spoken = False  # the real sender has sent the message of ``end``

    # -- requests of a client ---------------------------------------------------------------------

    def rehearse(self, what: object, who: str) -> Mapping[str, Any]:
        """Arm a fault by its name, end the present one, or report on it.

        Args:
            what: name of a fault, ``report``, or ``end``, which trips axes that move. A client that
                asks nothing for ``GONE_NS`` counts as gone: the fault ends in the same way.
            who: text that names the client in the log.

        Returns:
            ``phase``; ``made``: whether an input was altered; ``neutral_ms``: time from then until
            the valves of its axes are neutral, or None; ``events``: each [ms from then, axis,
            state, reason or text]; ``why`` it ended.

        Raises:
            ValueError: the fault cannot be armed; no state has changed.
        """
        if what == "end":
            self._end("ended by its client", stops=True)
        elif what != "report":
            self._arm(str(what))
            log.warning("fault=armed name=%s %s", what, who)
        self._asked_ns = self._now_ns
        return {
            "phase": self._phase,
            "made": self._made_ns is not None,
            "neutral_ms": self._neutral_ms,
            "events": self._events,
            "why": self._why,
        }

    def _arm(self, name: str) -> None:
        faults = rehearsed_faults(self._controller.deployment)
        if name not in faults:
            raise ValueError(f"expected one of {', '.join(faults)}, got {name!r}")
        if self._phase != DONE:
            raise ValueError(f"expected one fault at a time, {self._fault.name} is not over")
        for axis, control in self._controller.axes.items():
            if (fast := control.bound.config.limits.max_pct) > REDUCED_PCT:
                text = f"expected max_pct up to {REDUCED_PCT:g}, got {fast:g}"
                raise ValueError(f"axes.{axis}.limits: {text}: faults need reduced speed")
            if not control.axis.neutral:
                state = control.axis.state.name
                raise ValueError(f"expected every axis at rest, {axis} is {state}: let go first")
        self._begin(faults[name])

    def reloads(self) -> None:
        """End the fault, because a reload replaces the controller."""
        self._end("the file was read again")

    def _end(self, why: str, *, stops: bool = False) -> None:
        """End the fault: every frame now passes unchanged; ``stops``: axes that move trip."""
        if self._phase not in (ARMED, MADE):
            return
        if self._phase == MADE and self._fault.end and not self._spoken:
            super().receive(self._fault.end, self._now_ns)
        self._phase, self._since_ns, self._why = OVER, self._now_ns, why
        if stops:
            self.stalled()
        log.warning("fault=over name=%s %s", self._fault.name, why)

    # -- frames and ticks ------------------------------------------------------------------------

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Receive a frame as the fault alters it; return the frame for the other bus, or None.

        A frame that takes a demand back ends the fault; see ``Demands``.
        """
        fault = self._fault
        if self._phase == DONE:
            return super().receive(frame, now_ns)
        asked = self._demands.read(frame)
        if self._phase == MADE:
            if takes_back(asked, self._applied) or self._holds_more(asked, now_ns):
                self._end("the joystick was let go, or something was released")
            elif fault.stands and self._tick in fault.late:
                return None
        instead = self._altered(frame, asked) if self._phase == MADE else (frame,)
        passed = None
        for one in instead:
            passed = super().receive(one, now_ns if one is frame else now_ns - fault.age_ns)
        if len(instead) != 1 or instead[0] is not frame:
            self._made(now_ns)
        if all(one is not frame for one in instead):
            return passed
        self._spoken |= fault.end is not None and frame[:3] == fault.end[:3]
        self._applied.update(asked)
        if self._phase in (MADE, OVER) and (self._holds_more(asked, now_ns) or self._runs(asked)):
            log.warning("fault=over name=%s the joystick is not followed: it trips", fault.name)
            self.stalled()
        if passed is not None and self._phase == MADE and fault.unsent:
            self.send_failed(passed)  # a gateway forwards it
        return passed

    def _holds_more(self, asked: Asked, now_ns: int) -> bool:
        """Return whether the controller holds a larger demand than that of a frame."""
        return bool(asked) and takes_back(asked, self._demands.held(self._controller, now_ns))

    def _runs(self, asked: Asked) -> bool:
        """Return whether an axis, in a stop, runs out against the demand of a frame."""
        keys, axes = self._demands.keys, self._controller.axes
        stopping = {n: one.axis for n, one in axes.items() if one.axis.state is State.STOPPING}
        return any(
            axis.output.steps * asked.get(keys[name], 0.0) < 0.0 for name, axis in stopping.items()
        )

    def _altered(self, frame: Frame, asked: Asked) -> tuple[Frame, ...]:
        """Return the frames to receive instead of a frame; none demands more than it."""
        if self._fault.once and self._made_ns is not None:
            return (frame,)
        altered = self._fault.alter(frame)
        less = all(no_more(self._demands.read(one), asked) for one in altered)
        return altered if less else (frame,)

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """Run one tick unless the fault makes it late, and yield the frames to send now."""
        self._now_ns = now_ns
        if self._phase == DONE:
            yield from super().tick(now_ns, missed)
            return
        self._step(now_ns)
        fault, made = self._fault, self._phase == MADE
        late = made and self._tick in fault.late
        self._tick += made
        if late:
            self._missed += 1 + missed
            self._made(now_ns)
            return
        if self._missed and fault.stands:
            self.stalled()
        missed, self._missed = missed + self._missed, 0
        for frame in super().tick(now_ns, missed):
            yield frame
            if made and fault.unsent and frame[:3] in self._valves:
                self.send_failed(frame)
        self._look(now_ns)

    def _made(self, now_ns: int) -> None:
        """Note the time of the first altered input."""
        if self._made_ns is None:
            self._made_ns = now_ns

    def _step(self, now_ns: int) -> None:
        """Go on from armed to made, over and done if it is time."""
        lasted_ns = now_ns - self._since_ns
        if self._phase == OVER:
            stops = any(event[2] in STOPS for event in self._events)
            if lasted_ns > (LONGEST_AFTER_NS if stops and not self._neutral else self._after_ns):
                self._phase = DONE
        elif now_ns - self._asked_ns > GONE_NS:
            self._end("its client is gone", stops=True)
        elif self._phase == ARMED:
            if lasted_ns > ARMED_NS:
                self._end("its axis was not moved")
            elif self._held(now_ns):
                self._make(now_ns)
        elif lasted_ns > self._fault.lasts_ns:
            self._end("its time is over")

    def _held(self, now_ns: int) -> bool:
        """Return whether its axis moved for ``HELD_NS``; without one, whether every axis rests."""
        axes = [self._controller.axes[name].axis for name in self._fault.axes]
        if not any(one.state is State.ACTIVE and abs(one.demand) >= LEAST_DEMAND for one in axes):
            self._still_ns = now_ns
        return now_ns - self._still_ns >= HELD_NS if axes else self._controller.neutral

    def _make(self, now_ns: int) -> None:
        fault, self._phase, self._since_ns = self._fault, MADE, now_ns
        log.warning("fault=made name=%s", fault.name)
        if fault.begin:
            fault.begin(self, now_ns)
        if fault.unsent or (fault.begin and not fault.once):
            self._made(now_ns)

    def _look(self, now_ns: int) -> None:
        """Note the events of this tick after the first altered input, and when all is neutral."""
        if self._made_ns is None:
            return
        since_ms = (now_ns - self._made_ns) / MS
        for event in self._controller.events[: MOST_EVENTS - len(self._events)]:
            if isinstance(event, StateEvent):
                one = event.transition
                self._events.append([since_ms, event.axis, one.new.name, one.reason.name])
            else:
                self._events.append([since_ms, "", "", event.text])
        if self._neutral_ms is None and self._neutral:
            self._neutral_ms = since_ms

    @property
    def _neutral(self) -> bool:
        """Whether the valves of the fault's axes are neutral and stay neutral."""
        axes = [self._controller.axes[name].axis for name in self._fault.axes]
        return all(one.neutral and not one.output.steps for one in axes)
