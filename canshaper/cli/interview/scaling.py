"""Questions of ``canshaper init`` on what a signal means, where the DBC does not say it."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from canshaper.cli.interview.answers import ask, confirmed, number, one

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

    from canshaper.cli.interview.first import FirstScaling

_LARGEST = 1e9
MIDDLE, FLAGS, SECOND = "middle", "flags", "second"


def command_scaling(signal: "Signal", message: "Message") -> "FirstScaling":
    """Ask how a joystick signal gives a command: around a value, with flags, or by two signals."""
    from canshaper.cli.interview.first import FirstScaling
    from canshaper.codec.signals import magnitude_range, symmetrical_range
    from canshaper.commissioning import suggest

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


def valve_scaling(signal: "Signal") -> "FirstScaling":
    """Ask for the scaling of a valve's signal."""
    from canshaper.cli.interview.first import FirstScaling
    from canshaper.codec.signals import symmetrical_range
    from canshaper.commissioning import suggest

    if symmetrical_range(signal) is None:
        return FirstScaling()
    return _around_zero(signal) if suggest.two_sided(signal) else _around_middle(signal)


def code_meanings(signal: "Signal", scaling: "FirstScaling | None" = None) -> dict[str, str]:
    """Which values of a signal that the DBC names are measurements, where it does not say it."""
    from canshaper.config.schema import Scaling
    from canshaper.machine.corrections import Correction, scaled
    from canshaper.machine.named_codes import is_guess

    if scaling:
        given = Scaling(full=scaling.full, zero=scaling.zero, invert=scaling.invert)
        signal = scaled(signal, Correction(given, bool(scaling.flags or scaling.negative)))
    kinds, meanings = ["fault", "value"], {}
    for raw, name in (signal.choices or {}).items():
        if is_guess(signal, raw, str(name)):
            text = f'  {signal.name}: {raw} is "{name}", of {", ".join(kinds)}'
            meanings[str(name)] = ask(text, one(kinds), "fault")
    return meanings


def _around_zero(signal: "Signal") -> "FirstScaling":
    from canshaper.cli.interview.first import FirstScaling

    return FirstScaling(_full(signal, 0.0), invert=_inverted(signal))


def _around_middle(signal: "Signal") -> "FirstScaling":
    from canshaper.cli.interview.first import FirstScaling
    from canshaper.commissioning import suggest

    low, high = suggest.reach(signal)
    middle = suggest.likely_middle(signal)
    text = f"  {signal.name}: its value in the middle, at zero command"
    zero = ask(text, number(low, high), f"{middle:.12g}")
    return FirstScaling(_full(signal, zero), zero, _inverted(signal))


def _full(signal: "Signal", zero: float) -> float:
    """Ask for the value from zero to full command."""
    from canshaper.commissioning import suggest

    likely = suggest.likely_full(signal, zero)
    distance = f", from {zero:g}" if zero else ""
    text = f"  {signal.name}: its value at full{distance}"
    return ask(text, number(1e-6, _LARGEST), f"{likely:.12g}")


def _inverted(signal: "Signal") -> bool:
    text = f"  {signal.name}: does it count the other way round (invert)"
    return confirmed(text, default=False)


def _three(allowed: Sequence[str]) -> Callable[[str], tuple[str, str, str]]:
    """Takes three different ones of these, with spaces or commas between."""

    def parse(text: str) -> tuple[str, str, str]:
        names = text.replace(",", " ").split()
        if len({*names}) != 3 or len(names) != 3 or not {*names} <= {*allowed}:
            raise ValueError(f"expected three of {', '.join(allowed)}, got {text!r}")
        return names[0], names[1], names[2]

    return parse
