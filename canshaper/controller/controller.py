"""The controller: frames in, frames out, without sockets and without a clock.

The same object runs in the daemon, in lock-step simulation and in replay of a log.
"""

from collections.abc import Iterator

from canshaper.codec.frame import Frame, FrameFault, MessageKey
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.couplings import Couplings
from canshaper.controller.events import FeedbackEvent, StateEvent
from canshaper.controller.machine_inputs import MachineInputs, parts
from canshaper.controller.status_messages import SensorReport, StatusMessages
from canshaper.controller.valve_messages import Counters, OverrunDetector, ValveMessages
from canshaper.inputs.input import Part, PartKey, carry_over
from canshaper.inputs.stops import EnableGate
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import Event, ForwardingRule, FrameHandler
from canshaper.protocols.registry import protocols
from canshaper.shaping.states import Reason, State, Transition

NOWHERE: frozenset[str] = frozenset()


class Controller:
    """Controls all axes of a machine: takes the frames received, and yields the frames to send.

    Attributes:
        counters: counts of the faults so far.
        joysticks: the joysticks by name.
        inputs: receiver of each message that has an exact identifier, by (bus, id, extended).
        events: events for the log since the owner last emptied the list.
        motions: the two-axis motions.
        valves: the valve messages.
        status: the status messages.
        moves: whether the frame that was handed out last is a valve's, and an axis that has run in
            this tick moves.
        not_neutral: first exception in the last ``neutral_frames``; None without one.
    """

    def __init__(self, deployment: Deployment) -> None:
        self.deployment = deployment
        self.counters = Counters()
        self.events: list[Event] = []
        self.not_neutral: Exception | None = None
        inputs = MachineInputs(deployment)
        self.joysticks, self._stop = inputs.joysticks, inputs.stop
        self._senders = {one.key: one.sender() for one in deployment.sent()}
        tick_s = deployment.config.tick_ms / 1000.0
        self.axes = {
            name: AxisControl(
                bound,
                tick_s,
                inputs.joysticks[bound.config.command.joystick],
                self._senders[bound.valve.message.key],
            )
            for name, bound in deployment.axes.items()
        }
        self.status = StatusMessages(deployment, self.axes, self._senders)
        for control in self.axes.values():
            if switches := inputs.gates.get(control.bound.config.command.joystick):
                control.stops.interlocks.append(EnableGate(switches))
            if control.bound.feedback and control.feedback:
                inputs.bound.append((control.bound.feedback, control.feedback))
        self._sensors: dict[str, SensorReport] = {}
        for name, message in inputs.sway_sensors.items():
            self.axes[name].add_sway_sensor(message)
            self._sensors[name] = SensorReport(name, self.axes[name])
        self._couplings = Couplings(deployment, self.axes, inputs, tick_s)
        self.motions = self._couplings.motions
        self.inputs = inputs.by_key()
        self._sent, self._others = deployment.routing.sent, deployment.routing.others
        self._protocols = protocols(deployment, self.axes, inputs.joysticks, inputs.bound)
        self._forwarding: dict[MessageKey, ForwardingRule] = {}
        for protocol in self._protocols:
            self.inputs |= protocol.inputs
            self._forwarding |= protocol.forwarding
        self.valves = ValveMessages(self.axes, deployment.routing.valves, self._forwarding)
        self._last = -1  # number of the last deadline
        self._overrun = OverrunDetector()
        self._stood_still = self.moves = False

    def carry_over(self, before: "Controller") -> None:
        """Continue from the state of the controller that ran before a reload.

        Trips, reports of other nodes and alive counters stay as they are. A bus that was opened
        again has missed frames, so the values last received on it no longer count.
        """
        self._overrun.copy_state(before._overrun)
        if before._stop is not None:
            for control in before.axes.values():
                control.stops.see(before._stop)
        carry_over(before._parts(), self._parts())
        open_before = before.deployment.config.buses.values()
        for name, bus in self.deployment.config.buses.items():
            if bus not in open_before:
                self._invalidate(name)
                self.on_bus_off(name)

    def _parts(self) -> dict[PartKey, Part]:
        return parts(
            self.deployment, self._senders.values(), self.inputs, self.axes, self._protocols
        )

    @property
    def neutral(self) -> bool:
        """Whether every axis is in a state in which its valve gets neutral."""
        return all(control.axis.neutral for control in self.axes.values())

    @property
    def silent_buses(self) -> frozenset[str]:
        """Buses on which only a protocol may send now, because we have no address there."""
        return NOWHERE.union(*(protocol.silent for protocol in self._protocols))

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """Take a received frame, and count its fault.

        Args:
            frame: the frame.
            arrived_ns: monotonic time of its arrival, from which its age counts; not later than
                the next tick.

        Returns:
            A frame for the other bus of a gateway, which the caller sends at once; else None.
        """
        key = frame[:3]
        if (entry := self.inputs.get(key)) is not None:
            fault = entry.receive(frame.data, arrived_ns)
        elif key in self._sent:  # a bus never hands back our own frames
            fault = FrameFault.SECOND_SENDER
            self.valves.foreign_sender(key, arrived_ns)
        elif (handler := self._handler(frame)) is not None:
            fault = handler.receive(frame, arrived_ns)
        elif key[1:] in self._others or any(one.usual(frame) for one in self._protocols):
            return None
        else:
            fault = FrameFault.UNKNOWN_ID
        if fault:
            self.counters.add(fault)
        return self._forward(frame, arrived_ns) if self._forwarding else None

    def _handler(self, frame: Frame) -> FrameHandler | None:
        """Return a protocol's handler of a frame that has no exact identifier, or None."""
        for protocol in self._protocols:
            if (handler := protocol.handler(frame)) is not None:
                return handler
        return None

    def _forward(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """Return a joystick's frame with our velocities, for the other bus, or None; set moves."""
        for rule in self._forwarding.values():
            if rule.new_frame():
                if self._stood_still:  # this frame has waited: it is never passed on
                    return None
                if (stop := self._stop) is not None:
                    for control in self.axes.values():
                        control.stops.see(stop)
                stopped = stop is not None and stop.stops(arrived_ns)
                passed = rule.forward(frame.data, arrived_ns, stopped=stopped)
                self.moves = rule.moves
                return passed
        return None

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """Run every axis that is due, and yield the frames to send.

        A valve's frame comes as soon as the last of its axes has its setpoint; all valves come
        before any status. The caller sends each frame at once, and has to take all of them.

        Args:
            now_ns: monotonic time of this tick.
            missed: deadlines missed since the last tick; the valves kept their last output.

        Yields:
            The next frame. The caller reports one that it could not send by ``send_failed``, and
            never sends it later.
        """
        last, now = self._last, self._last + 1 + missed
        self._last = now
        self.moves = False
        if self._stood_still:
            self._stood_still = False
            self._invalidate()
        overrun = self._overrun.tick(late=missed > 0) if missed or self._overrun.late else False
        changed = self._missed(last, now) if missed else []
        if self._couplings.any:
            self._couplings.step(now_ns, last, now, self.events)
        silent = self.silent_buses if self._protocols else NOWHERE
        for name, control, message, rule in self.valves.turns:
            period = control.period_ticks
            if now // period - last // period:
                transition = control.command(now_ns, self._stop, overrun)
                self.moves |= control.axis.output.steps != 0
                if rule is not None:
                    if (own := rule.own(now_ns)) is not None:
                        yield own
                elif message is not None and message.key[0] not in silent:
                    yield message.frame()
                control.axis.propagate()
                if control.feedback is not None or control.axis.sensed is not None:
                    self._report(name, control, now_ns)
                if transition is not None:
                    self._changed(name, control, transition)
                    changed.append(control)
        self.moves = False
        for frame in self.status.frames(changed, self.counters, last, now):
            if frame.bus not in silent:
                yield frame
        if self._protocols:
            yield from self._of_protocols(now_ns)

    def _changed(self, name: str, control: AxisControl, transition: Transition) -> None:
        """Report a change of state; a trip ends the velocity that a two-axis motion adds."""
        self.events.append(StateEvent(name, transition))
        if transition.new is State.TRIPPED:
            for motion in self.motions:
                motion.on_trip(control)

    def _of_protocols(self, now_ns: int) -> Iterator[Frame]:
        """Yield the protocols' own frames; count their faults, and take over their events."""
        for protocol in self._protocols:
            if fault := protocol.silence(now_ns):
                self.counters.add(fault)
            yield from protocol.frames(now_ns)
            self.events += protocol.changes()

    def _missed(self, last: int, now: int) -> list[AxisControl]:
        """Count missed deadlines; return the axes whose filters failed in them."""
        self.counters.add(FrameFault.MISSED_DEADLINE, now - last - 1)
        changed = []
        for name, control in self.axes.items():
            if (transition := control.hold(last, now)) is not None:
                self._changed(name, control, transition)
                changed.append(control)
        return changed

    def _report(self, name: str, control: AxisControl, now_ns: int) -> None:
        """Report changes of the valve's feedback and of the sway sensor."""
        sent, feedback = control.axis.output.setpoint, control.feedback
        if feedback is not None and feedback.check(sent, now_ns):
            event = FeedbackEvent(name, feedback.following, feedback.part, sent)
            self.events.append(event)
            if event.fault:
                self.counters.add(event.fault)
        if sensor := self._sensors.get(name):
            self.events += sensor.events()

    def stalled(self) -> None:
        """Invalidate every input, because the loop stood still for too long; moving axes trip.

        The frames that wait in the sockets are read before the next tick, and invalidated by it. A
        fault or a cause of a trip in one of them still counts, even if a later frame ends it.
        """
        self._stood_still = True
        for protocol in self._protocols:
            protocol.stalled()
        for control in self.axes.values():
            control.stops.invalid = True
            control.trip_in_motion(Reason.LOOP_STALLED)

    def _invalidate(self, bus: str | None = None) -> None:
        """Invalidate the inputs of one bus, or of all: only new frames count again."""
        for (where, _, _), entry in self.inputs.items():
            if bus in (None, where):
                entry.invalidate()
        for protocol in self._protocols:
            protocol.invalidate(bus)

    def on_bus_off(self, bus: str) -> None:
        """Report to the protocols that our CAN controller is bus-off and misses frames there."""
        for protocol in self._protocols:
            protocol.on_bus_off(bus)

    def send_failed(self, frame: Frame) -> None:
        """Count a frame that did not reach its bus; a valve frame trips its moving axes."""
        self.counters.add(FrameFault.SEND_FAILED)
        for protocol in self._protocols:
            protocol.send_failed(frame)
        self.valves.send_failed(frame[:3])

    def withhold(self, frame: Frame) -> bool:
        """Return whether a late frame moves a valve and must not leave; if so, reuse its count."""
        return self.valves.withhold(frame)

    def refused(self, frame: Frame) -> Frame:
        """Trip the axes of a valve frame that the gate has refused; return a neutral one for it."""
        self.counters.add(FrameFault.OUTPUT_REFUSED)
        return self.valves.refused(frame)

    def neutral_frames(self) -> list[Frame]:
        """Return neutral frames to send last: none on silent buses, of a gateway only in motion."""
        errors: list[Exception] = []
        for protocol in self._protocols:
            try:
                protocol.leave()
            except Exception as error:
                errors.append(error)
        frames = self.valves.neutral_frames(self.silent_buses, errors)
        self.not_neutral = errors[0] if errors else None
        return frames
