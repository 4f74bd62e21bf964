"""Questions of ``canshaper init`` about swing: each axis, slew with near-far, and the load."""

import re
from collections.abc import Collection, Sequence

from cantools.database.can import Message, Signal

from canshaper.cli.interview.answers import (
    MOST_OFFERED,
    NONE,
    ask,
    confirmed,
    number,
    one,
    period_ms,
    whole,
)
from canshaper.cli.interview.first import (
    PERIOD_RANGE,
    RADIUS_M,
    RADIUS_TIMEOUT_MS,
    SLEWING_RAD_S,
    TEN_SWINGS_S,
    TIP_M_S,
    FirstAxis,
    FirstLoad,
    FirstMotion,
    FirstScaling,
    FirstSensor,
    FirstSlewing,
    Stopwatch,
    ten_swings_s,
)
from canshaper.commissioning import suggest
from canshaper.config.inputs import SwaySensorSection
from canshaper.config.limits import Limits, Slewing, Sway
from canshaper.config.load import limits
from canshaper.config.schema import Scaling
from canshaper.machine.corrections import Correction, scaled
from canshaper.machine.filters import filter_fault
from canshaper.machine.named_codes import is_guess
from canshaper.machine.sway_sensor import LEAST_FUSION

# Names of axes that cause no swing, that turn the crane, and that move its tip in and out.
CALM = re.compile(r"lift|hoist|winch|rotat|turn|grip|open|close", re.IGNORECASE)
SLEW = re.compile(r"slew|swing|swivel", re.IGNORECASE)
NEAR_FAR = re.compile(r"near|far|radial|reach|crowd", re.IGNORECASE)
SENSOR_CYCLES = 4  # cycles of a sensor's message in its proposed timeout
# Fastest tip; its stopping distance is still one that the file may state.
_FASTEST_M_S = 40.0


def swing_of(axis: str, period_s: float) -> Stopwatch | None:
    """Ask about the swing that an axis causes; None if it causes none.

    Its valve is commanded every ``period_s`` seconds; a swing too quick for a filter at that period
    is not accepted.
    """
    question = f"  {axis}: does it make the grapple swing"
    if not confirmed(question, default=not CALM.search(axis)):
        return None
    seconds = ask(
        "    time of ten full swings, s", number(*_ten_swings_s(period_s)), f"{TEN_SWINGS_S:g}"
    )
    first = ask("    how far the first of them goes (any unit)", number(1e-3, 1e6), "20")
    last = ask("    and the one after the tenth", number(1e-3 * first, first), f"{first / 3:.3g}")
    allowed = number(*limits(Sway, "full_speed_m_s"))
    speed = ask("    speed of the tip at full deflection, m/s", allowed, f"{TIP_M_S:g}")
    return Stopwatch(seconds, first, last, speed)


def sensor_of(
    axis: str, swing_s: float, others: list[Message], bound: list[FirstAxis]
) -> FirstSensor | None:
    """Ask for the sway sensor of an axis; None if it has none.

    Args:
        axis: name of the axis.
        swing_s: period of its swing, seconds.
        others: messages that may carry the sensor.
        bound: axes before it, whose sensors are taken.
    """
    used = {(one.sensor.message, one.sensor.signal) for one in bound if one.sensor}
    possible = {
        f"{message.name}.{signal.name}": (message, signal)
        for message, signal in suggest.sway_sensors(others, swing_s)
        if (message.name, signal.name) not in used
    }
    if not possible:
        return None
    text = f"  {axis}: sway sensor on the tool, such as {', '.join([*possible][:MOST_OFFERED])}"
    answer = ask(f"{text}, - for none", one([*possible, NONE]), NONE)
    if answer == NONE:
        return None
    message, signal = possible[answer]
    least, most = limits(SwaySensorSection, "timeout_ms")
    timeout_ms = int(min(max(SENSOR_CYCLES * (message.cycle_time or 0), least), most))
    if (signal.unit or "").endswith("/s"):
        codes = code_meanings(signal)
        return FirstSensor(message.name, signal.name, "rate", timeout_ms, codes=codes)
    text = "    angle in the joint, or inclination against the vertical"
    kind = ask(text, one(["angle", "inclination"]), "angle")
    fusion_s = None
    if kind == "inclination":
        shortest, longest = LEAST_FUSION * swing_s, limits(SwaySensorSection, "fusion_s")[1]
        text = "    time constant with which accelerations correct its gyro, s (its data sheet)"
        fusion_s = ask(text, number(shortest, longest), f"{max(5.0, shortest):.2g}")
    codes = code_meanings(signal)
    return FirstSensor(message.name, signal.name, kind, timeout_ms, fusion_s, codes=codes)


def slewing_of(axis: str) -> FirstSlewing | None:
    """Ask how fast an axis turns the crane, and its largest radius; None if it does not turn it."""
    if not confirmed(f"  {axis}: does it turn the crane", default=bool(SLEW.search(axis))):
        return None
    allowed = number(*limits(Slewing, "full_speed_rad_s"))
    speed = ask(
        "    speed at full deflection, rad/s (a turn is 6.28)", allowed, f"{SLEWING_RAD_S:g}"
    )
    least, most = limits(Slewing, "largest_radius_m")
    allowed = number(least, min(most, _FASTEST_M_S / speed))
    return FirstSlewing(speed, ask("    largest radius of the tip, m", allowed, f"{RADIUS_M:g}"))


def _ten_swings_s(period_s: float) -> tuple[float, float]:
    """Return shortest and longest time of ten swings, s, for which a filter runs.

    The filter must also run at the shortest swing that may be set on the running machine. If no
    swing fits, the times that a file may state are returned. ``period_s``: between two commands.
    """
    low, high = ten_swings_s()
    rate = Limits().slowest_per_s
    for tenth in range(round(10.0 * low), round(10.0 * high)):
        every = [Stopwatch(part * tenth / 10.0, 1.0, 1.0, 1.0) for part in (1.0, PERIOD_RANGE[0])]
        if all(filter_fault(w.filter, w.sway, period_s, rate) is None for w in every):
            return tenth / 10.0, high
    return low, high  # no swing fits: the check of the whole file says why


def motion_of(axes: list[FirstAxis], others: list[Message]) -> FirstMotion | None:
    """Ask about slew and near-far as one motion; None without both, or if it is declined.

    ``others`` are the messages that may carry the measured radius.
    """
    slew = next((axis.name for axis in axes if axis.slewing), None)
    possible = [axis.name for axis in axes if axis.swing and not axis.slewing]
    if slew is None or not possible:
        return None
    likely = next((name for name in possible if NEAR_FAR.search(name)), NONE)
    text = f"Axis that moves the tip in and out, and is to move a little with {slew}, of"
    text += f" {', '.join(possible)}, - for none"
    near_far = ask(text, one([*possible, NONE]), likely)
    if near_far == NONE:
        return None
    radii = suggest.radii(others, RADIUS_TIMEOUT_MS)
    if not radii:
        return FirstMotion(slew, near_far)
    text = f"Measured radius of the tip, of {', '.join(radii[:MOST_OFFERED])}, - for none"
    radius = ask(text, one([*radii, NONE]), radii[0])
    if radius == NONE:
        return FirstMotion(slew, near_far)
    signals = {f"{message.name}.{s.name}": s for message in others for s in message.signals}
    return FirstMotion(slew, near_far, radius, code_meanings(signals[radius]))


# Proposals for a log: factor on the time of ten swings, and kg, as in forwarder-load.yaml.
_SLOWER, _LOG_KG = 1.14, 600.0
_CYCLES, _CYCLE_MS = 5, 200  # cycles in its timeout; its proposed cycle if the DBC has none


def load_of(
    axes: Sequence[FirstAxis], messages: Sequence[Message], used: Collection[str]
) -> FirstLoad | None:
    """Ask which signal says that a log is gripped.

    If there is none, ask whether one response is to hold for an empty grapple and a log; None if
    not, or if no axis swings.

    Args:
        axes: axes of the machine.
        messages: its messages, without those of the valves.
        used: signals that have a meaning already, as MESSAGE.SIGNAL.
    """
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
    cycle = message.cycle_time or period_ms(message.name, _CYCLE_MS)
    own = None if message.cycle_time else cycle
    codes = code_meanings(signal)
    of_signal = message.name, signal.name, _CYCLES * cycle, empty, log, codes, own
    return FirstLoad(_with_log(swinging), *of_signal)


def _possible(
    messages: Sequence[Message], used: Collection[str]
) -> tuple[dict[str, tuple[Message, Signal]], list[str]]:
    """Return the unused signals that can say that a log is gripped, and names of likely ones."""
    signals = {
        f"{message.name}.{signal.name}": (message, signal)
        for message, signal in suggest.loads(messages)
    }
    left = {name: one for name, one in signals.items() if name not in used}
    return left, [name for name in left if suggest.LOAD.search(name.partition(".")[2])]


def _values(signal: Signal) -> tuple[float, float]:
    """Ask for the values of a signal with an empty grapple and with a log; return (empty, log)."""
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


def _with_log(axes: Sequence[FirstAxis]) -> dict[str, float]:
    """Ask for the time of ten swings with a log; return it by axis, seconds."""
    times_s = {}
    for axis in axes:
        assert axis.swing is not None
        empty_s = axis.swing.ten_swings_s
        allowed = number(empty_s, ten_swings_s()[1])
        text = f"  {axis.name}: time of ten full swings with a log, s"
        times_s[axis.name] = ask(text, allowed, f"{_SLOWER * empty_s:.3g}")
    return times_s


def code_meanings(signal: Signal, scaling: FirstScaling | None = None) -> dict[str, str]:
    """Ask whether named values (VAL_) whose names leave it open are faults or measurements.

    ``scaling`` has corrections from earlier answers. Returned is "fault" or "value" by name.
    """
    if scaling:
        given = Scaling(full=scaling.full, zero=scaling.zero, invert=scaling.invert)
        signal = scaled(signal, Correction(given, bool(scaling.flags or scaling.negative)))
    kinds, meanings = ["fault", "value"], {}
    for raw, name in (signal.choices or {}).items():
        if is_guess(signal, raw, str(name)):
            text = f'  {signal.name}: {raw} is "{name}", of {", ".join(kinds)}'
            meanings[str(name)] = ask(text, one(kinds), "fault")
    return meanings
