"""Questions of ``canshaper init`` about the axes of a joystick, their valves and signals."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from cantools.database.can import Message, Signal

from canshaper.cli.common import echo
from canshaper.cli.interview.answers import (
    MOST_OFFERED,
    NONE,
    ask,
    confirmed,
    name,
    number,
    one,
    period_ms,
    whole,
)
from canshaper.cli.interview.first import VALVE_TIMEOUT_MS, FirstAxis, FirstJoystick, FirstScaling
from canshaper.cli.interview.nodes import Nodes
from canshaper.cli.interview.swing import code_meanings, sensor_of, slewing_of, swing_of
from canshaper.codec.signals import magnitude_range, symmetrical_range
from canshaper.commissioning import suggest
from canshaper.config.load import limits
from canshaper.config.schema import Valve
from canshaper.errors import UsageError
from canshaper.machine.valves import FRAMES_PER_TIMEOUT


def add_axes(
    axes: list[FirstAxis],
    joystick: FirstJoystick,
    message: Message,
    others: list[Message],
    nodes: Nodes,
) -> None:
    """Ask about the axes of a joystick and append them to ``axes``.

    ``others`` are the messages that belong to no joystick; that of a chosen valve is removed when
    no other signal of it is left for a valve. ``message`` is that of the joystick.

    Raises:
        UsageError: three periods of a valve are longer than any timeout that a file may state.
    """
    two_sided = suggest.velocities(message)
    for command in two_sided or suggest.one_sided(message):
        names = [axis.name for axis in axes]
        likely = suggest.axis_name(command.name)
        default = f"{joystick.name}_{likely}" if likely in names else likely
        text = f"Axis of {message.name}.{command.name}, - for none"
        axis = ask(text, name(names), default if two_sided else NONE)
        valve = None if axis == NONE else _valve_of(axis, command, others, axes)
        if valve is None:
            continue
        sender, signal = valve
        cycle = sender.cycle_time or period_ms(sender.name)
        scaling, of_valve = command_scaling(command, message), valve_scaling(signal)
        back = [s for s in message.signals if s.name == scaling.negative]
        codes = {n: m for s in (command, *back) for n, m in code_meanings(s, scaling).items()}
        timeout_ms, known = _timeout(axis, cycle, nodes.timer_ms(sender.name))
        cia408 = nodes.cia408(sender.name)
        status = suggest.status_of(others, axis)
        swing = swing_of(axis, cycle / 1000.0)
        slewing = slewing_of(axis) if swing else None
        sensor = sensor_of(axis, swing.period_s, others, axes) if swing else None
        if sensor:
            sensor = replace(sensor, node=nodes.supervised(sensor.message))
        axes.append(
            FirstAxis(
                name=axis,
                joystick=joystick.name,
                command_signal=command.name,
                valve=sender.name,
                signal=signal.name,
                timeout_ms=timeout_ms,
                alive_counter=suggest.counter(sender),
                status=status.name if status else None,
                swing=swing,
                slewing=slewing,
                sensor=sensor,
                scaling=scaling,
                valve_scaling=of_valve,
                cycle_ms=None if sender.cycle_time else cycle,
                cia408=cia408,
                node=None if cia408 else nodes.supervised(sender.name),
                codes=codes,
                timeout_known=known,
            )
        )


def _valve_of(
    axis: str, command: Signal, others: list[Message], axes: list[FirstAxis]
) -> tuple[Message, Signal] | None:
    """Ask for message and signal of the valve of an axis; None if the axis is left out.

    The message leaves ``others`` when no other signal of it is left to command a valve.
    """
    candidates = suggest.valves(others, command.name)
    possible = [m for m in candidates if _valve_timeouts(m.cycle_time or 0) is not None]
    taken = {(one.valve, one.signal) for one in axes}
    commands = {
        f"{m.name}.{s.name}": (m, s)
        for m in possible
        for s in suggest.valve_signals(m)
        if (m.name, s.name) not in taken
    }
    if not commands:
        echo("  no message is left that can command its valve; axis left out")
        return None
    first, *_ = commands
    alike = suggest.alike(possible[0].name, command.name)
    text = f"  {axis}: valve command, such as {', '.join([*commands][:MOST_OFFERED])}, - for none"
    answer = ask(text, one([*commands, NONE]), first if alike else NONE)
    if answer == NONE:
        return None
    message = commands[answer][0]
    if sum(one is message for one, _ in commands.values()) == 1:
        others.remove(message)
    return commands[answer]


def _valve_timeouts(cycle_ms: int) -> tuple[int, int] | None:
    """Return shortest and longest timeout of a valve with this cycle, ms; None if none fits."""
    least, most = (int(ms) for ms in limits(Valve, "timeout_ms"))
    shortest = max(least, FRAMES_PER_TIMEOUT * cycle_ms)
    return (shortest, most) if shortest <= most else None


def _timeout(axis: str, cycle_ms: int, set_ms: int) -> tuple[int, bool]:
    """Ask for the timeout of a valve; ``set_ms`` is that of its EDS, 0 for none.

    Returns:
        The timeout in ms, and whether it is known: from the EDS, or typed instead of our proposal.

    Raises:
        UsageError: three periods of the valve are longer than any timeout that a file may state.
    """
    timeouts = _valve_timeouts(cycle_ms)
    if timeouts is None:
        raise UsageError(f"{axis}: its valve has no timeout of three periods of {cycle_ms} ms")
    shortest, most = timeouts
    text = f"  {axis}: silence after which the valve closes by itself, ms (its manual)"
    likely = min(max(set_ms or VALVE_TIMEOUT_MS, shortest), most)
    answer = ask(text, whole(shortest, most), str(likely))
    return answer, bool(set_ms) or answer != likely


_LARGEST = 1e9
MIDDLE, FLAGS, SECOND = "middle", "flags", "second"


def command_scaling(signal: Signal, message: Message) -> FirstScaling:
    """Ask how a signal encodes the direction: by a middle value, flags, or a second signal.

    Nothing is asked if its DBC range is symmetrical, only full and invert if it has both signs.
    """
    if symmetrical_range(signal) is None:
        return FirstScaling()
    if suggest.two_sided(signal):
        return _around_zero(signal)
    flags = [s.name for s in suggest.switches(message)]
    rockers = [s.name for s in suggest.one_sided(message) if s.name != signal.name]
    kinds = [MIDDLE, *([FLAGS] if len(flags) > 2 else []), *([SECOND] if rockers else [])]
    guess = suggest.direction_flags(message, signal)
    text = f"  {signal.name}: direction by a middle value, flags or a second signal, of"
    kind = ask(f"{text} {', '.join(kinds)}", one(kinds), FLAGS if guess else MIDDLE)
    if kind == MIDDLE:
        return _around_middle(signal)
    full = None if magnitude_range(signal) is None else _full(signal, 0.0)
    if kind == SECOND:
        text = f"  {signal.name}: the signal of the other direction, of {', '.join(rockers)}"
        return FirstScaling(full, negative=ask(text, one(rockers), rockers[0]))
    text = f"  {signal.name}: flags of neutral, negative and positive, of {', '.join(flags)}"
    chosen = ask(text, _three(flags), " ".join(guess or flags[:3]))
    return FirstScaling(full, flags=chosen)


def valve_scaling(signal: Signal) -> FirstScaling:
    """Ask for the scaling of a valve's signal, unless its DBC range is symmetrical."""
    if symmetrical_range(signal) is None:
        return FirstScaling()
    return _around_zero(signal) if suggest.two_sided(signal) else _around_middle(signal)


def _around_zero(signal: Signal) -> FirstScaling:
    return FirstScaling(_full(signal, 0.0), invert=_inverted(signal))


def _around_middle(signal: Signal) -> FirstScaling:
    low, high = suggest.reach(signal)
    middle = suggest.likely_middle(signal)
    text = f"  {signal.name}: its value in the middle, at zero command"
    zero = ask(text, number(low, high), f"{middle:.12g}")
    return FirstScaling(_full(signal, zero), zero, _inverted(signal))


def _full(signal: Signal, zero: float) -> float:
    """Ask how far a signal's value at full command is from ``zero``, its value without command."""
    likely = suggest.likely_full(signal, zero)
    distance = f", from {zero:g}" if zero else ""
    text = f"  {signal.name}: its value at full{distance}"
    return ask(text, number(1e-6, _LARGEST), f"{likely:.12g}")


def _inverted(signal: Signal) -> bool:
    text = f"  {signal.name}: is this signal reversed (invert)"
    return confirmed(text, default=False)


def _three(allowed: Sequence[str]) -> Callable[[str], tuple[str, str, str]]:
    """Return a parser of three different words out of these, separated by spaces or commas."""

    def parse(text: str) -> tuple[str, str, str]:
        names = text.replace(",", " ").split()
        if len({*names}) != 3 or len(names) != 3 or not {*names} <= {*allowed}:
            raise ValueError(f"expected three of {', '.join(allowed)}, got {text!r}")
        return names[0], names[1], names[2]

    return parse
