"""Questions of ``canshaper init`` on the axes of a joystick and their valves."""

from dataclasses import replace
from typing import TYPE_CHECKING

from canshaper.cli.common import echo
from canshaper.cli.interview.answers import MOST_OFFERED, NONE, ask, name, one, period_ms, whole
from canshaper.cli.interview.nodes import Nodes
from canshaper.cli.interview.scaling import code_meanings, command_scaling, valve_scaling
from canshaper.cli.interview.swing import sensor_of, slewing_of, swing_of
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

    from canshaper.cli.interview.first import FirstAxis, FirstJoystick


def add_axes(
    axes: "list[FirstAxis]",
    joystick: "FirstJoystick",
    message: "Message",
    others: "list[Message]",
    nodes: Nodes,
) -> None:
    """Ask for the axes of a joystick and add them; ``others`` are the messages of no joystick."""
    from canshaper.cli.interview.first import FirstAxis
    from canshaper.commissioning import suggest

    two_sided = suggest.velocities(message)
    for command in two_sided or suggest.one_sided(message):
        names = [axis.name for axis in axes]
        likely = suggest.axis_name(command.name)
        default = f"{joystick.name}_{likely}" if likely in names else likely
        text = f"Axis of {message.name}.{command.name}, - for none"
        axis = ask(text, name(names), default if two_sided else NONE)
        valve = None if axis == NONE else _valve_of(axis, command, others)
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
                axis,
                joystick.name,
                command.name,
                sender.name,
                signal.name,
                timeout_ms,
                suggest.counter(sender),
                status.name if status else None,
                swing,
                slewing,
                sensor,
                scaling,
                of_valve,
                None if sender.cycle_time else cycle,
                cia408,
                None if cia408 else nodes.supervised(sender.name),
                codes,
                known,
            )
        )


def _valve_of(
    axis: str, command: "Signal", others: "list[Message]"
) -> "tuple[Message, Signal] | None":
    """Message and signal of the valve of an axis; it is taken from those that are left."""
    from canshaper.commissioning import suggest

    candidates = suggest.valves(others, command.name)
    possible = [m for m in candidates if _valve_timeouts(m.cycle_time or 0) is not None]
    commands = {f"{m.name}.{s.name}": (m, s) for m in possible for s in suggest.valve_signals(m)}
    if not commands:
        echo("  no message is left that can command its valve; axis left out")
        return None
    first, *_ = commands
    alike = suggest.alike(possible[0].name, command.name)
    text = f"  {axis}: valve command, such as {', '.join([*commands][:MOST_OFFERED])}, - for none"
    answer = ask(text, one([*commands, NONE]), first if alike else NONE)
    if answer == NONE:
        return None
    others.remove(commands[answer][0])
    return commands[answer]


def _valve_timeouts(cycle_ms: int) -> tuple[int, int] | None:
    """Shortest and longest of a valve that is commanded so often; None where there is none."""
    from canshaper.config.load import limits
    from canshaper.config.schema import Valve
    from canshaper.machine.valves import FRAMES_PER_TIMEOUT

    least, most = (int(ms) for ms in limits(Valve, "timeout_ms"))
    shortest = max(least, FRAMES_PER_TIMEOUT * cycle_ms)
    return (shortest, most) if shortest <= most else None


def _timeout(axis: str, cycle_ms: int, set_ms: int) -> tuple[int, bool]:
    """Ask for the timeout of a valve; ``set_ms`` is what it has by its EDS, 0 for none.

    Returns:
        The timeout in ms, and whether EDS or operator say it: else it is our proposal.
    """
    from canshaper.cli.interview.first import VALVE_TIMEOUT_MS

    timeouts = _valve_timeouts(cycle_ms)
    if timeouts is None:
        raise UsageError(f"{axis}: its valve has no timeout of three periods of {cycle_ms} ms")
    shortest, most = timeouts
    text = f"  {axis}: silence after which the valve closes by itself, ms (its manual)"
    likely = min(max(set_ms or VALVE_TIMEOUT_MS, shortest), most)
    answer = ask(text, whole(shortest, most), str(likely))
    return answer, bool(set_ms) or answer != likely
