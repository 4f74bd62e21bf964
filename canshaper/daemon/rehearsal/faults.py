"""Every fault that can be rehearsed at a machine."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.identifier import (
    EMERGENCY,
    HEARTBEAT,
    STATE_MASK,
    NodeState,
    ValveState,
    identifier,
)
from canshaper.config.schema import AxisSection
from canshaper.daemon.rehearsal.fault import LONGEST_S, MS, Editor, Fault, S, dropped, put, tick_ns
from canshaper.daemon.rehearsal.joystick import joystick_faults
from canshaper.gate.cycle import longest_gap_ns
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import Bound

CLAIMED_PGN = 0xEE00
LATE_TICKS = 30  # with every second one late an overrun needs 25


def rehearsed_faults(deployment: Deployment) -> dict[str, Fault]:
    """Every fault that can be made on the input side of a machine, by its name.

    Faults after which the daemon has to be started again are the last ones.
    """
    faults = [
        *(
            f
            for joystick in deployment.joysticks.values()
            for f in joystick_faults(deployment, joystick)
        ),
        *_of_switches(deployment),
        *_of_valves(deployment),
        *_of_nodes(deployment),
        *_of_buses(deployment),
        *_of_loop(deployment),
        *_of_addresses(deployment),
    ]
    return {one.name: _bounded(one, deployment) for one in faults}


def _bounded(fault: Fault, deployment: Deployment) -> Fault:
    """A fault with its longest time: until its reaction is over."""
    stop_s = max(axis.config.limits.stop_s for axis in deployment.axes.values())
    lasts_ns = fault.lasts_ns or fault.within_ns + round((stop_s + 1.0) * S)
    return replace(fault, lasts_ns=min(lasts_ns, round(LONGEST_S * S)))


def _of_switches(deployment: Deployment) -> Iterator[Fault]:
    tick, axes = tick_ns(deployment), tuple(deployment.axes)
    pressed = {one.conditions[0] for one in deployment.joysticks.values()}
    for message in deployment.switches:
        editor = Editor(message)
        for name, (signal, on) in message.switches.items():
            claim = "ENABLE_LOST" if (None, name) in pressed else "R2"
            off = put(editor, **{signal: int(on == 0)})
            yield Fault(f"switch_off:{name}", claim, axes, tick, alter=off)
        if not any((None, name) in pressed for name in message.switches):
            lost_ns = message.config.timeout_ms * MS + tick
            silent = f"switch_silent:{message.message.name}"
            yield Fault(silent, "R2", axes, lost_ns, alter=dropped(editor))
    if stop := deployment.emergency_stop:
        editor, lost_ns = Editor(stop), stop.config.timeout_ms * MS + tick
        press = put(editor, **{stop.config.signal: 1})
        yield Fault("pressed:emergency_stop", "EMERGENCY_STOP", axes, tick, alter=press)
        drop = dropped(editor)
        yield Fault("silent:emergency_stop", "EMERGENCY_STOP_LOST", axes, lost_ns, alter=drop)


def _of_valves(deployment: Deployment) -> Iterator[Fault]:
    tick, sensors = tick_ns(deployment), set()
    for name, axis in deployment.axes.items():
        bus, can_id, extended = axis.valve.message.key
        foreign = Frame(bus, can_id, extended, bytes(axis.valve_message.length))
        if not deployment.config.gateway:
            only = (name,)
            yield Fault(f"second_sender:{name}", "SECOND_SENDER", only, tick, begins=(foreign,))
        if axis.feedback:
            editor, signal = Editor(axis.feedback), axis.feedback.signal
            lost_ns = axis.feedback.config.timeout_ms * MS + tick
            drop, long_ns = dropped(editor), lost_ns + 3 * S
            yield Fault(f"feedback_silent:{name}", "FEEDBACK_LOST", (name,), lost_ns, alter=drop,
                        lasts_ns=long_ns)  # fmt: skip
            still = put(editor, **{signal.name: round(-signal.offset / signal.scale)})
            yield Fault(f"feedback_neutral:{name}", "NOT_FOLLOWING", (name,), 3 * S, alter=still,
                        lasts_ns=4 * S)  # fmt: skip
        if (word := axis.status_word) and axis.config.valve.cia408:
            drop = _word_lost(Editor(word), word)
            lost_ns = word.config.timeout_ms * MS + tick
            yield Fault(f"status_silent:{name}", "VALVE_FAULT", (name,), lost_ns, alter=drop)
            yield Fault(f"status_silent_at_rest:{name}", "VALVE_NOT_READY", (), lost_ns, alter=drop)
        if (sensor := axis.sway_sensor) and sensor.message.key not in sensors:
            sensors.add(sensor.message.key)
            lost_ns = sensor.message.config.timeout_ms * MS + tick
            yield Fault(f"sensor_silent:{name}", "R10", (name,), lost_ns,
                        alter=dropped(Editor(sensor.message)), lasts_ns=lost_ns + S)  # fmt: skip


def _word_lost(editor: Editor, word: Bound[Any]) -> Callable[[Frame], Frame | None]:
    """Status words that say *active* are lost; what says anything else passes."""
    signal, mask = word.config.signal, ValveState.ACTIVE.value

    def lost(frame: Frame) -> Frame | None:
        active = editor.has(frame) and int(editor.raw(frame)[signal]) & mask == ValveState.ACTIVE
        return None if active else frame

    return lost


def _of_nodes(deployment: Deployment) -> Iterator[Fault]:
    config, tick = deployment.config, tick_ns(deployment)
    joysticks = {(one.bus, one.node): name for name, one in config.joysticks.items() if one.node}
    for bus_name, bus in config.buses.items():
        if bus.canopen is None:
            continue
        own = Frame(bus_name, HEARTBEAT + bus.canopen.node, False, bytes((NodeState.OPERATIONAL,)))
        yield Fault(f"second_node:{bus_name}", "R9", (), tick, begins=(own,), lasts_ns=S)
        for name, node in bus.canopen.nodes.items():
            of = joysticks.get((bus_name, name))
            axes = tuple(
                n
                for n, a in config.axes.items()
                if (a.command.joystick == of if of else (a.valve.bus, _node(a)) == (bus_name, name))
            )
            claim = "NODE_FAULT" if of else "VALVE_FAULT"
            if not axes:
                continue
            alarm = [
                Frame(bus_name, EMERGENCY + node.id, False, bytes(data).ljust(8, b"\0"))
                for data in ((0x00, 0x10, 0x01), ())
            ]
            yield Fault(f"emergency:{name}", claim, axes, tick, begins=(alarm[0],),
                        ends=(alarm[1],))  # fmt: skip
            lost_ns = node.heartbeat_ms * MS + tick
            drop = _heartbeat_lost((bus_name, HEARTBEAT + node.id, False))
            yield Fault(f"heartbeat_silent:{name}", claim, axes, lost_ns, alter=drop)


def _node(axis: AxisSection) -> str | None:
    """Name of the node of the valve of an axis."""
    return axis.valve.cia408.node if axis.valve.cia408 else axis.valve.node


def _heartbeat_lost(key: tuple[str, int, bool]) -> Callable[[Frame], Frame | None]:
    """Heartbeats that say *operational* are lost; what says anything else passes."""

    def lost(frame: Frame) -> Frame | None:
        is_it = frame[:3] == key and len(frame.data) == 1
        return None if is_it and frame.data[0] & STATE_MASK == NodeState.OPERATIONAL else frame

    return lost


def _of_buses(deployment: Deployment) -> Iterator[Fault]:
    tick, config = tick_ns(deployment), deployment.config
    for name in sorted({axis.config.valve.bus for axis in deployment.axes.values()}):
        axes = tuple(n for n, a in deployment.axes.items() if a.config.valve.bus == name)
        yield Fault(f"not_sent:{name}", "SEND_FAILED", axes, tick, unsent=True)
        reports = FrameFault.BUS_OFF
        yield Fault(f"bus_off:{name}", "BUS_OFF", axes, tick, reports=reports, unsent=True,
                    off=name)  # fmt: skip
        for reports in (FrameFault.BUS_PASSIVE, FrameFault.ERROR_FRAME):
            kind = reports.name
            yield Fault(f"{kind.lower()}:{name}", kind, axes, tick, reports=reports, lasts_ns=S)
        if config.buses[name].j1939:
            yield Fault(f"bus_back:{name}", "ADDRESS_NOT_CLAIMED", (), tick, off=name,
                        lasts_ns=S)  # fmt: skip


def _of_loop(deployment: Deployment) -> Iterator[Fault]:
    period_ns, axes = deployment.config.tick_ms * MS, tuple(deployment.axes)
    stands = longest_gap_ns(deployment) // period_ns + 2
    within_ns = tick_ns(deployment, LATE_TICKS)
    yield Fault("late_tick:loop", "MISSED_DEADLINE", axes, within_ns, late=lambda n: n == 0,
                lasts_ns=S)  # fmt: skip
    yield Fault("late_ticks:loop", "LOOP_OVERRUN", axes, within_ns,
                late=lambda n: n < LATE_TICKS and n % 2 == 0)  # fmt: skip
    yield Fault("standstill:loop", "LOOP_STALLED", axes, tick_ns(deployment, stands + 2),
                late=lambda n: n < stands, stall=True)  # fmt: skip


def _of_addresses(deployment: Deployment) -> Iterator[Fault]:
    for name, bus in deployment.config.buses.items():
        if bus.j1939:
            axes = tuple(n for n, a in deployment.axes.items() if a.config.valve.bus == name)
            claim = identifier(CLAIMED_PGN, bus.j1939.address)
            lower = Frame(name, claim, True, bytes(8))  # NAME 0: the lowest
            yield Fault(f"address_taken:{name}", "ADDRESS_LOST", axes, tick_ns(deployment),
                        begins=(lower,))  # fmt: skip
