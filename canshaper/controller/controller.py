"""The controller: frames in, frames out, without sockets and without a clock.

The same object runs in the daemon, in lock-step simulation and in replay of a log.
"""

from collections.abc import Iterator

from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.valve import ValveMessage
from canshaper.controller.compensator import Compensator
from canshaper.controller.counters import Counters
from canshaper.controller.events import FeedbackEvent, StateEvent
from canshaper.controller.parts import parts
from canshaper.controller.runner import AxisRunner
from canshaper.inputs.carry_over import Key, Part, carry_over
from canshaper.inputs.feedback import Feedback, Following
from canshaper.inputs.input import EmergencyStopInput, Input, MessageInput
from canshaper.inputs.joystick import JoystickInput
from canshaper.inputs.radius import RadiusInput
from canshaper.inputs.value import ValueInput
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.protocols.interface import Event, ForwardingRule, FrameHandler, MessageKey
from canshaper.protocols.registry import protocols
from canshaper.shaping.states import Reason

# A late tick weighs five, a punctual one takes one away. Ten late ones soon after another, or more
# than one in six for long, are an overrun; it ends when all is paid back, after 50 punctual ticks.
LATE_WEIGHT = 5
LATE_LIMIT = 50
FAULT_OF = {
    Following.NO: FrameFault.NOT_FOLLOWING,
    Following.LOST: FrameFault.FEEDBACK_LOST,
}
NOWHERE: frozenset[str] = frozenset()


class Controller:
    """All axes of a deployment.

    Attributes:
        counters: what went wrong so far.
        joysticks: the joysticks by name.
        inputs: what receives a message that is known by its identifier.
        events: changes of state since the owner last emptied the list.
        moves: whether the frame that was handed out last is one of a valve, and any moves.
    """

    def __init__(self, deployment: Deployment) -> None:
        self.deployment = deployment
        self.counters = Counters()
        self.events: list[Event] = []
        joysticks = {
            name: JoystickInput(joystick) for name, joystick in deployment.joysticks.items()
        }
        self.joysticks = joysticks
        taken: list[tuple[BoundInput, MessageInput]] = [
            (joystick, joysticks[name]) for name, joystick in deployment.joysticks.items()
        ]
        self._stop: EmergencyStopInput | None = None
        if stop := deployment.emergency_stop:
            self._stop = EmergencyStopInput(stop, stop.config.signal)
            taken.append((stop, self._stop))
        tick_s = deployment.config.tick_ms / 1000.0
        self.axes = {
            name: AxisRunner(bound, tick_s, joysticks[bound.config.command.joystick])
            for name, bound in deployment.axes.items()
        }
        taken += self._choose()
        taken += [
            (runner.bound.feedback, runner.feedback)
            for runner in self.axes.values()
            if runner.bound.feedback and runner.feedback
        ]
        for runner in self.axes.values():
            if (radial := runner.bound.radial) is not None:
                radius = RadiusInput(radial)
                if (measured := radial.radius) is not None:
                    taken.append((measured, radius))
                target = self.axes[radial.config.axis]
                runner.add_compensator(Compensator(runner.axis, radial.config, target, radius))
        routing = deployment.routing
        handlers = {id(bound): one for bound, one in taken}
        self.inputs: dict[MessageKey, MessageInput] = {
            key: handlers[id(route.input)]
            for key, route in routing.routes.items()
            if id(route.input) in handlers
        }
        self._sent, self._others = routing.sent, routing.others
        self._by_message: dict[MessageKey, list[AxisRunner]] = {
            key: [self.axes[name] for name in names] for key, names in routing.valves.items()
        }
        # An axis that asks something of another one goes first.
        order = sorted(self.axes.items(), key=lambda item: item[1].compensator is None)
        self._protocols = protocols(deployment, self.axes, joysticks, taken)
        self._forwarding: dict[MessageKey, ForwardingRule] = {}
        for protocol in self._protocols:
            self.inputs |= protocol.inputs
            self._forwarding |= protocol.forwarding
        self._turns = [self._turn(name, runner) for name, runner in order]
        self._last = -1  # number of the last deadline
        self._late = 0
        self._overrun = False
        self._stood_still = False
        self.moves = False

    def carry_over(self, before: "Controller") -> None:
        """Continue where the controller that ran before a reload has ended.

        What is latched, what other nodes reported and every alive counter stay as they are. A bus
        that was opened again was not listened to: nothing good that is known of it counts.
        """
        self._late, self._overrun = before._late, before._overrun
        if before._stop is not None:
            for runner in before.axes.values():
                runner.see(before._stop)
        carry_over(before._parts(), self._parts())
        open_before = before.deployment.config.buses.values()
        for name, bus in self.deployment.config.buses.items():
            if bus not in open_before:
                self._forget(name)
                self.on_bus_off(name)

    def _parts(self) -> dict[Key, Part]:
        return parts(self.deployment, self.inputs, self.axes, self._protocols)

    @property
    def neutral(self) -> bool:
        """Whether no axis can move without the operator."""
        return all(runner.axis.neutral for runner in self.axes.values())

    @property
    def silent_buses(self) -> frozenset[str]:
        """Buses on which we have no address yet, or no longer."""
        return NOWHERE.union(*(protocol.silent for protocol in self._protocols))

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """Take a frame from a bus.

        Args:
            frame: the frame.
            arrived_ns: time of its arrival, from which its age counts; not after the tick that
                follows.

        Returns:
            What it leaves as on the other bus of a gateway, to be sent at once.
        """
        key = frame[:3]
        entry = self.inputs.get(key)
        if entry is not None:
            fault = entry.receive(frame.data, arrived_ns)
        elif key in self._sent:  # a bus never hands back what was sent by us
            fault = FrameFault.SECOND_SENDER
            for runner in self._by_message.get(key, ()):
                runner.foreign_sender(arrived_ns)
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
        """What receives a frame that is known by more than its identifier."""
        for protocol in self._protocols:
            if (handler := protocol.handler(frame)) is not None:
                return handler
        return None

    def _forward(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """What a frame leaves as on the other bus of a gateway, if its joystick received it."""
        for rule in self._forwarding.values():
            if rule.new_frame():
                if self._stood_still:  # what has waited is not passed on later either
                    return None
                stopped = self._stop is not None and self._stop.stops(arrived_ns)
                passed = rule.forward(frame.data, arrived_ns, stopped=stopped)
                self.moves = rule.moves
                return passed
        return None

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """Run every axis that is due.

        The frames come one by one, each valve's as soon as its axis has moved and all of them
        before any status, to be sent at once; all have to be taken.

        Args:
            now_ns: monotonic time of this tick.
            missed: deadlines missed since the last tick; the last output was held meanwhile.

        Yields:
            The frames to send now. One that could not be sent is to be told to ``send_failed``,
            and never sent later.
        """
        last, now = self._last, self._last + 1 + missed
        self._last = now
        self.moves = False
        if self._stood_still:
            self._stood_still = False
            self._forget()
        overrun = self._overruns(missed) if missed or self._late else False
        changed = []
        silent = self.silent_buses if self._protocols else NOWHERE
        for name, runner, message, rule in self._turns:
            period = runner.period_ticks
            if passed := now // period - last // period:
                if passed > 1:
                    runner.axis.hold(passed - 1)
                transition = runner.tick(now_ns, self._stop, overrun)
                self.moves |= runner.axis.raw != 0
                if rule is not None:
                    if (frame := rule.own(now_ns)) is not None:
                        yield frame
                elif message is not None and message.bus not in silent:
                    yield message.frame()
                runner.post_step(now_ns)
                if runner.feedback is not None:
                    self._compare(name, runner, runner.feedback, now_ns)
                if transition is not None:
                    self.events.append(StateEvent(name, transition))
                    changed.append(runner)
        self.moves = False
        yield from self._statuses(changed, last, now, silent)
        for protocol in self._protocols:
            if fault := protocol.silence(now_ns):
                self.counters.add(fault)
            yield from protocol.frames(now_ns)
            self.events += protocol.changes()

    def _turn(
        self, name: str, runner: AxisRunner
    ) -> tuple[str, AxisRunner, ValveMessage | None, ForwardingRule | None]:
        """An axis, and the message that goes out when it has moved: the last one of the message."""
        message = runner.bound.valve.message
        if self._by_message[message.sender.key][-1] is not runner:
            return name, runner, None, None
        return name, runner, message, self._forwarding.get(message.sender.key)

    def _choose(self) -> list[tuple[BoundInput, Input]]:
        """Let load state and operator choose sway data and filter of axes that have a choice."""
        bound = self.deployment.load_state, self.deployment.profile
        load_state, profile = (ValueInput(one, one.config.signal) if one else None for one in bound)
        codes = self.deployment.config.profile.codes if self.deployment.config.profile else {}
        for runner in self.axes.values():
            if runner.bound.config.gain_schedule or runner.bound.config.profiles:
                runner.add_chooser(load_state, profile, codes)
        return [(b, one) for b, one in zip(bound, (load_state, profile), strict=True) if b and one]

    def _compare(self, name: str, runner: AxisRunner, feedback: Feedback, now_ns: int) -> None:
        """Tell when the valve no longer does what it is told, and when it does again."""
        sent = runner.axis.sent
        if feedback.check(sent, now_ns):
            self.events.append(FeedbackEvent(name, feedback.following, feedback.part, sent))
            if fault := FAULT_OF.get(feedback.following):
                self.counters.add(fault)

    def _statuses(
        self, changed: list[AxisRunner], last: int, now: int, silent: frozenset[str]
    ) -> Iterator[Frame]:
        """Status of the axes that changed and of all that are due, and of the service."""
        for runner in self.axes.values():
            if runner in changed or _passed(last, now, runner.bound.status_ticks):
                frame = runner.status_frame()
                if frame and frame.bus not in silent:
                    yield frame
        service = self.deployment.status
        if service and _passed(last, now, self.deployment.status_ticks):
            frame = service.frame(self.counters.status())
            if frame.bus not in silent:
                yield frame

    def _overruns(self, missed: int) -> bool:
        """Whether so many ticks came late that the filter no longer does what it was tuned for.

        Asked while that is not paid back, and when a tick was late.
        """
        if missed:
            self.counters.add(FrameFault.MISSED_DEADLINE, missed)
            self._late = min(self._late + LATE_WEIGHT, LATE_LIMIT)
            self._overrun |= self._late == LATE_LIMIT
        else:
            self._late -= 1
            self._overrun &= self._late > 0
        return self._overrun

    def stalled(self) -> None:
        """The loop stood still for longer than any input may be old: nothing good still holds.

        Nor does what comes before the next tick, which has waited in the sockets: that tick forgets
        it. Bad news among it counts like any other, though it may be over by now.
        """
        self._stood_still = True
        for protocol in self._protocols:
            protocol.stalled()
        for runner in self.axes.values():
            runner.invalidate()
            runner.trip_in_motion(Reason.LOOP_STALLED)

    def _forget(self, bus: str | None = None) -> None:
        """Every input has to come again before it counts: those of one bus, or all."""
        for (where, _, _), entry in self.inputs.items():
            if bus in (None, where):
                entry.forget()
        for protocol in self._protocols:
            protocol.forget(bus)

    def on_bus_off(self, bus: str) -> None:
        """We are not on a bus now: frames are missed there."""
        for protocol in self._protocols:
            protocol.on_bus_off(bus)

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus; the axes of a valve frame trip."""
        self.counters.add(FrameFault.SEND_FAILED)
        for protocol in self._protocols:
            protocol.send_failed(frame)
        for runner in self._by_message.get((frame.bus, frame.can_id, frame.extended), ()):
            runner.trip_in_motion(Reason.SEND_FAILED)

    def withhold(self, frame: Frame) -> bool:
        """A valve frame comes too late: whether it moves one, and so must not leave.

        Its receiver will see no gap in the counter.
        """
        runners = self._by_message[frame[:3]]
        if not any(runner.axis.raw for runner in runners):
            return False
        runners[-1].bound.valve.message.sender.protector.take_back()
        return True

    def refused(self, frame: Frame) -> Frame:
        """The output guard has refused a valve frame: its axes trip.

        Returns:
            The same frame with neutral commands, to be sent in its place.
        """
        self.counters.add(FrameFault.OUTPUT_REFUSED)
        runners = self._by_message[frame[:3]]
        for runner in runners:
            runner.trip(Reason.OUTPUT_REFUSED)
            runner.bound.valve.put(0)
        return runners[0].bound.valve.message.instead(frame)

    def neutral_frames(self) -> list[Frame]:
        """A neutral frame for every valve: the last thing sent."""
        for runner in self.axes.values():
            runner.bound.valve.put(0)
        for protocol in self._protocols:
            protocol.leave()
        frames, silent = [], self.silent_buses
        for key, runners in self._by_message.items():
            if (rule := self._forwarding.get(key)) is not None:
                frames += rule.last()
            elif key[0] not in silent:
                frames.append(runners[-1].bound.valve.message.frame())
        return frames


def _passed(last: int, now: int, period: int) -> int:
    """How many multiples of the period lie after deadline ``last``, up to ``now``."""
    return now // period - last // period if period else 0
