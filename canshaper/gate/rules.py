"""The ten rules: each a function of what was received, what left before, and now.

Rules 1 and 2 decide whether an axis has to stop, 3 to 7 whether a velocity may leave, 8 and 9
whether a frame may leave, 10 whether an identifier may leave. Each rule from 3 on returns the
reason for its refusal; an empty text means that it refuses nothing.
"""

from canshaper.gate.axis import FOREIGN_NS, ROUNDING, UP, AxisState, ValveState
from canshaper.gate.fields import EPSILON, Word
from canshaper.gate.received import SwitchState
from canshaper.gate.record import Key, Record

OTHERS = 8
"""Most frames in a tick of one message that is no valve's: we may answer several nodes at once."""


def stop_at_once(axis: AxisState, stop: SwitchState | None, now_ns: int) -> tuple[str, bool, bool]:
    """Rule 1: enable, emergency stop, second sender; no limit: a reason seen once is enough.

    Returns the reason, or empty; whether it latches at rest too, in motion it always does; and
    whether it is still there.
    """
    why, latches, lasts = axis.hard, axis.latches, axis.joystick.gone != ""
    if stop is not None and stop.off(now_ns):
        why, latches, lasts = "emergency stop", latches or stop.released, True
    if now_ns - axis.foreign_ns <= FOREIGN_NS:
        why, latches, lasts = "second sender", True, True
    return why or axis.joystick.gone, latches, lasts


def demand_of(axis: AxisState, now_ns: int) -> float | None:
    """Rule 2: the demand; None for silence, error codes, a frozen joystick; limit: the timeout."""
    demand, joystick = axis.demand, axis.joystick
    if demand is None or axis.lost or not joystick.valid:
        return None
    if now_ns - axis.changed_ns > joystick.of.stuck_ns and abs(demand) > axis.of.stick.band:
        return None
    if axis.ramp is not None:  # a measurement: a touch of the joystick ends it; it begins armed
        if abs(demand) > axis.of.stick.band:
            return None
        return axis.ramp if axis.armed else demand
    return demand


def neutral_first(axis: AxisState) -> str:
    """Rule 3: an axis moves only while armed, or in its shaped stop; limit: ``stop_s``."""
    if axis.hard or not (axis.armed or axis.stop_left):
        return f"limit=stopped why={axis.hard or axis.why}"
    return ""


def bounds(axis: AxisState) -> tuple[float, float]:
    """Rule 4: return the velocities that may leave; limits: demand within the tail, ``max_pct``.

    Against a joystick that is held, the output may run on for ``reversal_s`` only, except in a
    shaped stop. Beyond the demand, only what a partner may add may leave.
    """
    of, now = axis.of, axis.now
    least, most = -axis.back.most, axis.forth.most
    if of.faster:
        least, most = (-1.0 if least else 0.0), (1.0 if most else 0.0)
    if of.reverse:
        least, most = min(least, -most), max(most, -least)
    elif axis.held >= of.reversal:
        if now > 0.0:
            least = 0.0
        elif now < 0.0:
            most = 0.0
    if of.added and axis.armed and axis.asked:
        added = 0.0 if now else of.added
        if now <= 0.0:
            least = min(least, -axis.back.before, -added)
        if now >= 0.0:
            most = max(most, axis.forth.before, added)
    return max(least, -of.maximum), min(most, of.maximum)


def direction_and_size(axis: AxisState, velocity: float, fallen: float) -> str:
    """Rule 4: a velocity is within ``bounds``, or on its way back there, lower with each frame."""
    size = abs(velocity)
    reach = axis.most if velocity > 0.0 else 0.0 - axis.least
    if size > reach + EPSILON and size > fallen + EPSILON:
        return f"limit=asked allowed={max(reach, fallen):.3f}"
    return ""


def rise(axis: AxisState, velocity: float, ticks: int) -> str:
    """Rule 5: the output rises no faster than ``rise_per_s``, one period a frame, and rounding."""
    highest = axis.risen(velocity, ticks) + UP * axis.of.step
    return "" if abs(velocity) <= highest + EPSILON else f"limit=rise allowed={highest:.3f}"


def fall(axis: AxisState, velocity: float, ticks: int, made: int) -> str:
    """Rule 6: the output falls no faster than ``fall_per_s`` and rounding, except to neutral."""
    of, size = axis.of, abs(velocity) if velocity * axis.last >= 0.0 else 0.0
    least = abs(axis.last) - of.fall * max(ticks, 1) - ROUNDING * of.step - EPSILON
    if size < least and size < least - axis.dropped(made):
        return f"limit=fall allowed={least:.3f}"
    return ""


def distance(axis: AxisState, velocity: float) -> str:
    """Rule 7: the axis runs no farther than the demanded distance it has left; limit: the slack.

    Beyond the demand the axis runs no farther than ``stop_distance_m``. Without a demand within the
    tail only a partner moves it: limits are path and time of the added velocity.
    """
    of, asked = axis.of, axis.forth if velocity > 0.0 else axis.back
    size = abs(velocity)
    if axis.ran > of.run_on and size - axis.held_at(velocity) - of.added > EPSILON:
        return f"limit=stop_distance_m allowed={of.run_on:.3f}"
    if asked.most:
        ahead = asked.remaining + of.slack + of.path
        if size * of.period_s > ahead:
            return f"limit=distance allowed={ahead:.3f}"
    elif of.added:
        if axis.alone > of.most_periods + 1:
            return "limit=time of added velocity"
        way = axis.way + velocity * of.period_s
        # A tenth more, and .01 s of full speed.
        if of.path and abs(way) > 1.1 * of.path + 0.01 and way * velocity > 0.0:
            return "limit=path of added velocity"
    return ""


def velocity_refused(axis: AxisState, velocity: float, made: int) -> str:
    """Return why a velocity (full speeds, not 0) may not leave, by rules 3 to 7; empty: it may."""
    ticks = axis.ticks if axis.of.forwarded else 1
    fallen = axis.fallen(velocity, min(ticks, 1))
    why = (
        neutral_first(axis)
        or direction_and_size(axis, velocity, fallen)
        or rise(axis, velocity, ticks)
        or fall(axis, velocity, ticks, made)
    )
    # An output that falls is on its way back, which counts no distance.
    if not why and abs(velocity) > fallen + EPSILON:
        why = distance(axis, velocity)
    return f"axis={axis.of.name} {why} speed={velocity:.3f}" if why else ""


def bytes_refused(
    valve: ValveState, data: bytes, word: Word, of: bytes | None, *, last: bool = False
) -> str:
    """Rule 8: length, bits that are not ours, control words and checksum are right; no tolerance.

    In a gateway the frame was made ``of`` a joystick's frame, or (None) is our own: enable may be
    on in our own only while it is held and an axis may move, and not in the ``last`` frame.
    """
    record = valve.of
    if len(data) != record.length:
        return f"limit=length length={len(data)} expected={record.length}"
    if of is not None:
        wrong = word[0] ^ int.from_bytes(of, "little") if len(of) == len(data) else -1
        wrong &= ~record.ours
    else:
        wrong = word[0] & record.fixed ^ record.fixed_value
    if wrong:
        return f"limit=bits wrong={wrong:x}"
    for field, values in record.words:
        if field.raw(word) not in values:
            return "limit=word"
    if of is None and record.enable is not None:
        held = not (last or valve.joystick.pressed.released)
        held = held and any(axis.armed or axis.stop_left for axis in valve.axes)
        enabled = record.enable.raw(word) == 1
        if enabled > held or any(field.raw(word) not in values for field, values in record.own):
            return "limit=bits of an own frame"
    return "" if record.protection.right(data) else "limit=checksum"


def turn_refused(valve: ValveState, count: int, *, due: bool) -> str:
    """Rule 9: one frame leaves in the tick in which it is due, with the next alive counter."""
    if not due:
        return "limit=one frame a tick"
    counts = valve.of.protection.counts
    if counts and valve.count is not None and count != (valve.count + 1) % counts:
        return f"limit=counter value={count}"
    return ""


def other_refused(record: Record, key: Key, data: bytes, sent: int) -> str:
    """Rule 10: a message that is no valve's leaves only as the file has it.

    Limit: ``OTHERS`` frames of an identifier in a tick, and one more for each permitted content.
    """
    allowed = record.others.get(key)
    if allowed is None:
        return "limit=identifier"
    lengths, contents = allowed
    if len(data) not in lengths or (contents and data not in contents):
        return "limit=content"
    return "limit=rate" if sent > OTHERS + len(contents) else ""
