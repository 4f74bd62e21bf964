"""Table of the faults that can be rehearsed at a machine."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from canshaper.codec import frame as ids
from canshaper.codec.frame import Frame, FrameFault
from canshaper.daemon.rehearsal import fault as make
from canshaper.daemon.rehearsal.fault import MS, Demands, Editor, Fault, S
from canshaper.daemon.rehearsal.joystick import joystick_faults
from canshaper.gate.cycle import longest_gap_ns
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import Bound

CLAIMED_PGN = 0xEE00
LATE_TICKS = 30  # with every second one late an overrun needs 25
# CiA 301: a generic error, and none any more.
ALARM, NO_ALARM = bytes((0x00, 0x10, 0x01, 0, 0, 0, 0, 0)), bytes(8)
RUNS = bytes((ids.NodeState.OPERATIONAL,))
ACTIVE = ids.ValveState.ACTIVE.value


def rehearsed_faults(deployment: Deployment) -> dict[str, Fault]:
    """Return every fault that can be made on the input side of this machine, by name.

    Faults after which the daemon has to be restarted are the last ones. Where ``lasts_ns`` is 0, it
    becomes ``within_ns``, plus the longest ``stop_s`` of an axis, plus 1 s.
    """
    demands, faults = Demands(deployment), list[Fault]()
    for joystick in deployment.joysticks.values():
        faults += joystick_faults(deployment, joystick, demands)
    for of in (_of_switches, _of_valves, _of_nodes, _of_buses, _of_loop):
        faults += of(deployment)
    faults.sort(key=lambda one: one.claim == "ADDRESS_LOST")
    stop_ns = round((max(a.config.limits.stop_s for a in deployment.axes.values()) + 1.0) * S)
    return {
        one.name: replace(one, lasts_ns=one.lasts_ns or one.within_ns + stop_ns) for one in faults
    }


def _of_switches(deployment: Deployment) -> Iterator[Fault]:
    tick, axes = make.tick_ns(deployment), tuple(deployment.axes)
    pressed = {one.conditions[0] for one in deployment.joysticks.values()}
    for message in deployment.switches:
        editor = Editor(message)
        for name, (signal, on) in message.switches.items():
            claim = "ENABLE_LOST" if (None, name) in pressed else "R2"
            off = make.put(editor, {signal: int(on == 0)})
            yield Fault(f"switch_off:{name}", claim, axes, tick, alter=off)
        if not any((None, name) in pressed for name in message.switches):
            silent, lost_ns = message.message.name, make.lost_ns(deployment, message)
            drop = make.dropped(editor.has)
            yield Fault(f"switch_silent:{silent}", "R2", axes, lost_ns, alter=drop)
    if stop := deployment.emergency_stop:
        editor, lost_ns = Editor(stop), make.lost_ns(deployment, stop)
        press, drop = make.put(editor, {stop.config.signal: 1}), make.dropped(editor.has)
        yield Fault("pressed:emergency_stop", "EMERGENCY_STOP", axes, tick, alter=press)
        yield Fault("silent:emergency_stop", "EMERGENCY_STOP_LOST", axes, lost_ns, alter=drop)


def _of_valves(deployment: Deployment) -> Iterator[Fault]:
    tick, sensors = make.tick_ns(deployment), set()
    for name, axis in deployment.axes.items():

        def fault(kind: str, claim: str, within_ns: int, of: str = name, **how: Any) -> Fault:
            return Fault(f"{kind}:{of}", claim, (of,), within_ns, **how)

        if not deployment.config.gateway:
            foreign = Frame(*axis.valve.message.key, bytes(axis.valve_message.length))
            yield fault("second_sender", "SECOND_SENDER", tick, begin=make.sent(foreign))
        if read := axis.feedback:
            editor, lost_ns = Editor(read), make.lost_ns(deployment, read)
            drop, long_ns = make.dropped(editor.has), lost_ns + 3 * S
            yield fault("feedback_silent", "FEEDBACK_LOST", lost_ns, alter=drop, lasts_ns=long_ns)
            zero = round(-read.signal.offset / read.signal.scale)
            still = make.put(editor, {read.signal.name: zero})
            yield fault("feedback_neutral", "NOT_FOLLOWING", 3 * S, alter=still, lasts_ns=4 * S)
        if (word := axis.status_word) and axis.config.valve.cia408:
            drop, lost_ns = make.dropped(_active(word)), make.lost_ns(deployment, word)
            rest = f"status_silent_at_rest:{name}"
            yield fault("status_silent", "VALVE_FAULT", lost_ns, alter=drop)
            yield Fault(rest, "VALVE_NOT_READY", (), lost_ns, alter=drop)
        if (sensor := axis.sway_sensor) and sensor.message.key not in sensors:
            sensors.add(sensor.message.key)
            drop = make.dropped(Editor(sensor.message).has)
            lost_ns = make.lost_ns(deployment, sensor.message)
            yield fault("sensor_silent", "R10", lost_ns, alter=drop, lasts_ns=lost_ns + S)


def _active(word: Bound[Any]) -> Callable[[Frame], bool]:
    """Return a function that recognises frames whose status word says *active*."""
    editor, signal = Editor(word), word.config.signal
    return lambda frame: editor.has(frame) and editor.raw(frame)[signal] & ACTIVE == ACTIVE


def _of_nodes(deployment: Deployment) -> Iterator[Fault]:
    config, tick = deployment.config, make.tick_ns(deployment)
    for bus, section in config.buses.items():
        if section.canopen is None:
            continue
        own = make.sent(Frame(bus, ids.HEARTBEAT + section.canopen.node, False, RUNS))
        yield Fault(f"second_node:{bus}", "R9", (), tick, begin=own, lasts_ns=S)
        for name, node in section.canopen.nodes.items():
            by_joystick, by_valve = list[str](), list[str]()
            for n, axis in config.axes.items():
                valve, joystick = axis.valve, config.joysticks[axis.command.joystick]
                of_valve = valve.cia408.node if valve.cia408 else valve.node
                by_joystick += [n] * ((joystick.bus, joystick.node) == (bus, name))
                by_valve += [n] * ((valve.bus, of_valve) == (bus, name))
            axes = tuple(by_joystick or by_valve)
            claim = "NODE_FAULT" if by_joystick else "VALVE_FAULT"
            alarm, over = (Frame(bus, ids.EMERGENCY + node.id, False, d) for d in (ALARM, NO_ALARM))
            beat = Frame(bus, ids.HEARTBEAT + node.id, False, RUNS)  # other states pass
            drop, lost_ns = make.dropped(beat.__eq__), node.heartbeat_ms * MS + tick
            if axes:
                begin = make.sent(alarm)
                yield Fault(f"emergency:{name}", claim, axes, tick, begin=begin, end=over)
                yield Fault(f"heartbeat_silent:{name}", claim, axes, lost_ns, alter=drop)


def _of_buses(deployment: Deployment) -> Iterator[Fault]:
    tick, off = make.tick_ns(deployment), FrameFault.BUS_OFF
    for name in sorted({axis.config.valve.bus for axis in deployment.axes.values()}):
        axes = tuple(n for n, a in deployment.axes.items() if a.config.valve.bus == name)
        yield Fault(f"not_sent:{name}", "SEND_FAILED", axes, tick, unsent=True)
        begin = make.reports(off, off=name)
        yield Fault(f"bus_off:{name}", off.name, axes, tick, begin=begin, unsent=True)
        for one in (FrameFault.BUS_PASSIVE, FrameFault.ERROR_FRAME):
            kind, begin = f"{one.name.lower()}:{name}", make.reports(one)
            yield Fault(kind, one.name, axes, tick, begin=begin, lasts_ns=S)
        if j1939 := deployment.config.buses[name].j1939:
            back, begin = f"bus_back:{name}", make.reports(off=name)
            yield Fault(back, "ADDRESS_NOT_CLAIMED", (), tick, begin=begin, lasts_ns=S)
            claim = ids.identifier(CLAIMED_PGN, j1939.address)
            begin = make.sent(Frame(name, claim, True, bytes(8)))  # NAME 0: the lowest
            yield Fault(f"address_taken:{name}", "ADDRESS_LOST", axes, tick, begin=begin)


def _of_loop(deployment: Deployment) -> Iterator[Fault]:
    axes, within_ns = tuple(deployment.axes), make.tick_ns(deployment, LATE_TICKS)
    stands = longest_gap_ns(deployment) // (deployment.config.tick_ms * MS) + 2

    def fault(kind: str, claim: str, within_ns: int, **how: Any) -> Fault:
        return Fault(f"{kind}:loop", claim, axes, within_ns, **how)

    yield fault("late_tick", "MISSED_DEADLINE", within_ns, late=range(1), lasts_ns=S)
    yield fault("late_ticks", "LOOP_OVERRUN", within_ns, late=range(0, LATE_TICKS, 2))
    within_ns = make.tick_ns(deployment, stands + 2)
    yield fault("standstill", "LOOP_STALLED", within_ns, late=range(stands), stands=True)
