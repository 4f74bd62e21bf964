"""Questions of ``canshaper init`` on what the grapple holds: a log makes its swing slower."""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from canshaper.cli.interview.answers import MOST_OFFERED, NONE, ask, confirmed, number, one, whole
from canshaper.cli.interview.scaling import code_meanings

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

    from canshaper.cli.interview.first import FirstAxis, FirstLoad

# Proposals: of the time of ten swings, and kg. The log of forwarder-load.yaml does so.
_SLOWER, _LOG_KG = 1.14, 600.0
_CYCLES, _CYCLE_MS = 5, 200  # of its message in its timeout; where the DBC has none


def load_of(
    axes: "Sequence[FirstAxis]", messages: "Sequence[Message]", used: Collection[str]
) -> "FirstLoad | None":
    """Ask what says that a log is gripped, or whether one response is to hold for both.

    Args:
        axes: of the machine.
        messages: of it, without those of the valves.
        used: MESSAGE.SIGNAL of what has a meaning already.
    """
    from canshaper.cli.interview.first import FirstLoad

    swinging = [axis for axis in axes if axis.swing]
    signals, likely = _possible(messages, used)
    if not swinging:
        return None
    text = "Does any message say that a log is gripped (weight, lift pressure, grapple closed,"
    text += " or a switch that the driver sets)"
    offered = [*likely, *(name for name in signals if name not in likely)][:MOST_OFFERED]
    text += f", such as {', '.join(offered)}" if offered else ""
    answer = ask(f"{text}, - for none", one([*signals, NONE]), likely[0] if likely else NONE)
    if answer == NONE:
        text = "Is one response to hold for empty grapple and log (it runs on a third longer)"
        return FirstLoad(_with_log(swinging)) if confirmed(text, default=False) else None
    message, signal = signals[answer]
    empty, log = _values(signal)
    timeout_ms = _CYCLES * (message.cycle_time or _CYCLE_MS)
    codes = code_meanings(signal)
    swings = _with_log(swinging)
    return FirstLoad(swings, message.name, signal.name, timeout_ms, empty, log, codes)


def _possible(
    messages: "Sequence[Message]", used: Collection[str]
) -> "tuple[dict[str, tuple[Message, Signal]], list[str]]":
    """Signals that can say it, and the names of those that are called so."""
    from canshaper.commissioning import suggest

    signals = {
        f"{message.name}.{signal.name}": (message, signal)
        for message, signal in suggest.loads(messages)
    }
    left = {name: one for name, one in signals.items() if name not in used}
    return left, [name for name in left if suggest.LOAD.search(name.partition(".")[2])]


def _values(signal: "Signal") -> tuple[float, float]:
    """Value of a signal with an empty grapple, and with a log."""
    from canshaper.commissioning import suggest

    if signal.length <= suggest.SWITCH_BITS:
        log = ask(f"  {signal.name}: its value while a log is gripped", whole(0, 1), "1")
        return 1.0 - log, float(log)
    low, high = suggest.reach(signal)
    text = f"  {signal.name}: its value with an empty grapple"
    empty = ask(text, number(low, high), f"{min(max(0.0, low), high):g}")
    likely = min(_LOG_KG, high) if signal.unit == "kg" else 0.5 * (empty + high)

    def other(text: str) -> float:
        if (value := number(low, high)(text)) == empty:
            raise ValueError(f"expected another value than that of an empty grapple, got {text!r}")
        return value

    return empty, ask(f"  {signal.name}: its value with a usual log", other, f"{likely:g}")


def _with_log(axes: "Sequence[FirstAxis]") -> dict[str, float]:
    """Time of ten swings with a log, by axis, s."""
    from canshaper.cli.interview.first import ten_swings_s

    times_s = {}
    for axis in axes:
        assert axis.swing is not None
        empty_s = axis.swing.ten_swings_s
        allowed = number(empty_s, ten_swings_s()[1])
        text = f"  {axis.name}: time of ten full swings with a log, s"
        times_s[axis.name] = ask(text, allowed, f"{_SLOWER * empty_s:.3g}")
    return times_s
