"""Questions of ``canshaper init`` about the machine: its bus, joysticks and switches."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from cantools.database.can import Message, Signal

from canshaper.cli.common import echo
from canshaper.cli.interview.answers import (
    MOST_LISTED,
    MOST_OFFERED,
    NONE,
    ask,
    channel,
    one,
    period_ms,
    several,
    whole,
)
from canshaper.cli.interview.axes import add_axes
from canshaper.cli.interview.first import FirstAxis, FirstJoystick, FirstMachine, FirstMotion
from canshaper.cli.interview.nodes import Nodes, uses_of
from canshaper.cli.interview.swing import load_of, motion_of
from canshaper.codec.layout import is_fd
from canshaper.codec.status import IDENTITY, SERVICE_STATUS, required_names
from canshaper.commissioning import suggest
from canshaper.config.bus import Bus
from canshaper.config.inputs import Protected
from canshaper.config.load import limits
from canshaper.config.schema import Joystick
from canshaper.errors import UsageError
from canshaper.machine.corrections import corrected, multiplexor

FEWEST_CYCLES = 5  # cycles of a joystick's message in its proposed timeout
FIRST_DATA_BITRATE = 2_000_000  # bit/s, as on most CAN FD buses


def machine_of(
    messages: list[Message], dbc: Sequence[str], interface: str, nodes: Nodes
) -> FirstMachine:
    """Ask all questions about a machine, and return the answers.

    Args:
        messages: messages of its DBC files and of its CANopen nodes.
        dbc: the DBC files, as the deployment file will name them.
        interface: interface of python-can.
        nodes: its CANopen nodes.

    Raises:
        UsageError: the messages have no joystick, no axis is left, or no timeout fits a valve.
        ConfigError: an answer of a file is invalid.
    """
    possible = suggest.joysticks(messages)
    if not messages:
        raise UsageError("no message of these files can be used")
    if not possible:
        raise UsageError(
            "no message has a signal of more than two bits, which could be a joystick;"
            " see docs/deployment.md"
        )
    channel_name = ask("CAN interface", channel, "can0")
    bitrate = ask("Bit rate, bit/s", whole(*limits(Bus, "bitrate")), "250000")
    joysticks: list[tuple[FirstJoystick, Message]] = []
    chosen = _chosen(messages)
    for message in (message for message in possible if message.name in chosen):
        joysticks.append(_joystick(message, messages, [one for one, _ in joysticks], nodes))
    used = {*chosen, *(joystick.switch for joystick, _ in joysticks)}
    others = [message for message in messages if message.name not in used]
    axes: list[FirstAxis] = []
    for joystick, message in joysticks:
        add_axes(axes, joystick, message, others, nodes)
    if not axes:
        raise UsageError("no axis has a valve command; nothing is written")
    motion = motion_of(axes, others)
    valves = {axis.valve for axis in axes}
    left = [message for message in messages if message.name not in valves]
    load = load_of(axes, left, _meanings([joystick for joystick, _ in joysticks], axes, motion))
    status = suggest.with_signals(required_names(SERVICE_STATUS), messages)
    identity = suggest.with_signals(required_names(IDENTITY), messages)
    machine = FirstMachine(
        channel=channel_name,
        bitrate=bitrate,
        dbc=dbc,
        joysticks=[joystick for joystick, _ in joysticks],
        axes=axes,
        status=status.name if status else None,
        identity=identity.name if identity else None,
        motion=motion,
        interface=interface,
        load=load,
    )
    uses = uses_of(machine, messages)
    used |= {*uses, machine.status, machine.identity, *(axis.status for axis in axes)}
    used.add(((motion and motion.radius) or "").partition(".")[0])
    machine = replace(machine, data_bitrate=_data_bitrate(messages, used, bitrate))
    if not nodes.named:
        return machine
    return replace(machine, canopen=nodes.canopen(uses))


def _meanings(
    joysticks: Sequence[FirstJoystick], axes: Sequence[FirstAxis], motion: FirstMotion | None
) -> set[str]:
    """Return, as MESSAGE.SIGNAL, the signals of switches, commands, sway sensors and the radius."""
    used = {f"{one.switch or one.message}.{one.enable}" for one in joysticks}
    used |= {
        f"{one.message}.{name}" for one in joysticks for name in (one.reset, one.anti_sway_off)
    }
    messages = {one.name: one.message for one in joysticks}
    used |= {f"{messages[axis.joystick]}.{axis.command_signal}" for axis in axes}
    used |= {f"{axis.sensor.message}.{axis.sensor.signal}" for axis in axes if axis.sensor}
    return used | ({motion.radius} if motion and motion.radius else set())


def _data_bitrate(
    messages: list[Message], used: Collection[str | None], bitrate: int
) -> int | None:
    """Ask for the data bit rate, bit/s, if a used message is one of CAN FD; else return None."""
    if not any(is_fd(message) for message in messages if message.name in used):
        return None
    most = limits(Bus, "data_bitrate")[1]
    text = "CAN FD: bit rate of the data, bit/s"
    return ask(text, whole(bitrate, most), str(FIRST_DATA_BITRATE))


def _chosen(messages: list[Message]) -> list[str]:
    """Ask which messages are those of joysticks; return their names."""
    possible, likely = suggest.joysticks(messages), suggest.likely_joysticks(messages)
    enabled = [m.name for m in likely if suggest.named(suggest.switches(m), suggest.ENABLE)]
    offered = [message.name for message in likely]
    text = f"Messages of the joysticks, such as {', '.join(offered[:MOST_OFFERED])}"
    names = [message.name for message in possible]
    return ask(text, several(names), " ".join(enabled or offered[:1]))


def _page(message: Message) -> tuple[Message, int | None]:
    """Ask for the multiplexor value of a joystick; return its message at that value, and the value.

    A message without a multiplexor, or with several, is returned as it is, with None.
    """
    signal = multiplexor(message)
    if signal is None:
        return message, None
    values = sorted({i for s in message.signals for i in s.multiplexer_ids or ()})
    text = f"{message.name}: value of {signal.name} with which it is meant, of"
    allowed = [str(value) for value in values]
    answer = int(ask(f"{text} {', '.join(allowed)}", one(allowed), allowed[0]))
    page = corrected(message, Protected(bus="", message=message.name, multiplexor=answer), {})
    return (message if isinstance(page, str) else page), answer


def _joystick(
    whole_message: Message,
    messages: list[Message],
    before: Sequence[FirstJoystick],
    nodes: Nodes,
) -> tuple[FirstJoystick, Message]:
    """Ask about a joystick; return it and its message. ``before`` are the joysticks so far."""
    message, page = _page(whole_message)
    whole = suggest.switches(message)
    left = [*whole, *suggest.switch_parts(message)]  # signals that are no switch yet

    def switch(text: str, default: str | None) -> str | None:
        allowed = [*(signal.name for signal in left), NONE]
        listed = ", ".join([*allowed[: min(MOST_LISTED, len(left))], NONE])
        likely = NONE if default is None else default
        answer = ask(f"{message.name}: {text}, of {listed}", one(allowed), likely)
        gone = {
            answer,
            answer.partition("/")[0],
        }  # the signal, and the signal of a bit or the bits of a signal
        left[:] = [s for s in left if s.name not in gone and s.name.partition("/")[0] != answer]
        return None if answer == NONE else answer

    timeout_ms, cycle_ms = _times_ms(message, before)
    of = other = code = None
    likely = suggest.enabling(left) or (whole[0].name if len(whole) == 1 else None)
    enable = switch("enable switch", likely or ("" if whole else NONE)) if left else None
    if enable is None:
        of, enable, other, code = _switch_elsewhere(message, messages, before)
    own = next((_times_ms(one, before) for one in messages if one.name == of), (0, None))
    reset = switch("switch that resets a trip", suggest.named(left, suggest.RESET))
    off = switch("switch for anti-sway off", suggest.named(left, suggest.ANTI_SWAY_OFF))
    counter = suggest.counter(message)
    joystick = FirstJoystick(
        name=suggest.axis_name(nodes.name_of(message.name) or message.name),
        message=message.name,
        timeout_ms=timeout_ms,
        enable=enable,
        reset=reset,
        anti_sway_off=off,
        alive_counter=None if counter in (enable, reset, off) else counter,
        cycle_ms=cycle_ms,
        switch=of,
        switch_ms=own,
        node=nodes.supervised(message.name),
        enable_of=other,
        multiplexor=page,
        code=code,
    )
    return joystick, message


def _times_ms(message: Message, before: Sequence[FirstJoystick]) -> tuple[int, int | None]:
    """Return the timeout of a message, and its cycle if the DBC states none, asked once; in ms."""
    known = {one.switch: one.switch_ms[1] for one in before}
    known |= {one.message: one.cycle_ms for one in before}
    cycle = message.cycle_time or known.get(message.name) or period_ms(message.name)
    least, most = limits(Joystick, "timeout_ms")
    timeout_ms = int(min(max(FEWEST_CYCLES * cycle, least), most))
    return timeout_ms, None if message.cycle_time else cycle


def _switch_elsewhere(
    message: Message, messages: list[Message], before: Sequence[FirstJoystick]
) -> tuple[str | None, str | None, str | None, int | None]:
    """Ask for the enable switch of a joystick that has none in its own message.

    Returns:
        (message, signal, joystick, code). Either message and signal of the switch are given, with
        the enabling value if the DBC names its values and it has more than two bits, or the
        joystick that shares its switch. All are None without a switch.
    """
    others = [one for one in messages if one.name != message.name]
    joysticks = [joystick.name for joystick in before]
    signals = {f"{m.name}.{s.name}": s for m in others for s in suggest.switches(m)}
    parts = {f"{m.name}.{s.name}": s for m in others for s in suggest.switch_parts(m)}
    modes = {f"{m.name}.{s.name}": s for m in others for s in suggest.modes(m)}
    names = [*joysticks, *signals, *modes, *parts]
    if not names:
        echo(f"  {message.name}: no message has a signal that could be its enable switch")
        return None, None, None, None
    fine = {n for n, s in signals.items() if suggest.enabling([s])}
    named = (n for n in names if suggest.ENABLE.search(n) and (n not in signals or n in fine))
    likely = names[0] if joysticks else next(named, "")
    offered = ", ".join(names[:MOST_OFFERED])
    text = f"{message.name}: enable switch, such as {offered}, - for none"
    answer = ask(text, one([*names, NONE]), likely)
    if answer in (*joysticks, NONE):
        return None, None, answer if answer in joysticks else None, None
    of, _, signal = answer.partition(".")
    return of, signal, None, _code(modes[answer]) if answer in modes else None


def _code(signal: Signal) -> int:
    """Ask which value of a signal enables."""
    choices: Mapping[int, object] = signal.choices or {}
    text = f"{signal.name}: value that enables, of "
    text += ", ".join(f"{code} {name}" for code, name in choices.items())
    likely = suggest.enabling_code(signal)
    return int(
        ask(text, one([str(code) for code in choices]), "" if likely is None else str(likely))
    )
