"""Guesses what a switch or code means from its name in the DBC: on or off, stop or free, a move
or rest."""

import re
from collections.abc import Mapping

_GAP = re.compile(r"(?<=[a-zäöüß])(?=[A-ZÄÖÜ])|(?<=[A-Z])(?=[A-Z][a-z])|[\W_\d]+")
_OFF = re.compile(
    r"\b(not|no|off|false|released|let go|opened|open|empty|idle|inactive|deactivated|disabled?"
    r"|unpressed|unoccupied|absent|stop|stopped|nicht|nein|aus|losgelassen|inaktiv|gesperrt)\b"
)
_ON = re.compile(
    r"\b(on|yes|true|active|activated|enabled?|pressed|closed|gripped|held|hold|present|seated"
    r"|occupied|engaged|operated|actuated|requested|touched|ja|ein|an|aktiv|freigegeben"
    r"|gedrückt|betätigt)\b"
)
_NOT_FREE = re.compile(r"\b(not|no|nicht) (ok|okay|ready|normal|safe|free|closed|healthy)\b")
_FREE = re.compile(
    r"\b(not|no|free|closed|released|ok|okay|normal|ready|safe|healthy|inactive|deactivated|off"
    r"|unpressed|run|running|nicht|frei|entriegelt)\b"
)
_STOP = re.compile(
    r"\b(e?stop|stopped|opened|open|emergency|pressed|active|activated|actuated|operated|engaged"
    r"|trigger(ed)?|trip(ped)?|halt|on|locked|latched|gedrückt|betätigt|aktiv|notaus|nothalt)\b"
)
_REST = re.compile(
    r"\b(block(ed)?|neutral|stop|hold|off|rest|idle|cent(er|re)|zero|none|(do ?n.?t|no) ?care"
    r"|no change|ignored?)\b"
)
_MOVE = re.compile(
    r"\b(extend|retract|raise|lower|lift|left|right|up|down|forward|backward|reverse|out|in"
    r"|positive|negative|heben|senken|links|rechts)\b"
)
_BACK = re.compile(r"\b(retract|lower|down|backward|reverse|in|negative|senken)\b")
_FORTH = re.compile(r"\b(extend|raise|lift|up|forward|out|positive|heben)\b")
_NEUTRAL, _SIGN = (
    re.compile(r"\bneutral\b|\bcent(er|re)\b"),
    re.compile(r"\b(neg|pos)(ative|itive)?\b"),
)
_SWAY = re.compile(r"sway|damping|swing", re.I)
_RAW = re.compile(r"\b(off|bypass|disabled?|raw|manual|direct)\b")


def words(name: str) -> str:
    """Return the words of a name in small letters: GripReleased becomes "grip released"."""
    return " ".join(filter(None, _GAP.split(name))).lower()


def on(name: str) -> bool | None:
    """Return whether a name says that a switch is on; None where it says neither on nor off."""
    text = words(name)
    return False if _OFF.search(text) else True if _ON.search(text) else None


def free(name: str) -> bool | None:
    """Return whether a name says that an emergency stop is free; None for neither free nor stop."""
    text = words(name)
    if _NOT_FREE.search(text):
        return False
    return True if _FREE.search(text) else False if _STOP.search(text) else None


def of_signal(name: str, *, stop: bool = False) -> bool | None:
    """Return whether 1 means on (``stop``: free) by the last word of a signal's name, or None."""
    last = words(name).rpartition(" ")[2]
    if last == "no":  # SwitchNo1
        return None
    return free(last) if stop else on(last)


def shows_sway_control(name: str) -> bool:
    """Return whether, by a signal's name, its value 1 says that anti-sway is on, not off."""
    return bool(_SWAY.search(name)) and not _RAW.search(words(name))


def direction_fault(name: str, *, moves: bool) -> bool:
    """Return whether a direction code's name contradicts it: rest for a move, a move for rest."""
    text = words(name)
    return bool(_REST.search(text) if moves else _MOVE.search(text) or "care" in text)


def turned(positive: str, negative: str) -> bool:
    """Return whether two direction codes seem swapped: each name says the other's direction."""
    one, other = words(positive), words(negative)
    contrary = _BACK.search(one) and _FORTH.search(other)
    return bool(contrary) and not (_FORTH.search(one) or _BACK.search(other))


def contrary(
    names: Mapping[int, str], signal: str, *, stop: bool = False, known: bool = False
) -> str | None:
    """Return in words the state in which a switch would act against its names; None if none.

    Args:
        names: DBC names of the raw values 0 and 1, as far as there are any.
        signal: name of the signal, which counts where the names of its values say neither.
        stop: True for an emergency stop, which is free at 0; any other switch acts at 1.
        known: True refuses also an acting value whose name says neither: perhaps a fault's.
    """
    sense = free if stop else on
    acts, rests = (names.get(raw, "") for raw in ((0, 1) if stop else (1, 0)))
    guessed = sense(acts) is None and (sense(rests) is True or (known and bool(acts)))
    if sense(acts) is False or guessed:
        return f'"{acts}"' if acts else f'not "{rests}"'
    if sense(acts) is None and sense(rests) is None and of_signal(signal, stop=stop) is stop:
        return f"not {signal}" if stop else signal
    return None


def flag_fault(key: str, name: str) -> bool:
    """Return whether a flag's name says neutral where ``key`` is a direction, or vice versa."""
    text = words(name)
    neutral = bool(_NEUTRAL.search(text))
    return neutral not in (bool(_SIGN.search(text)), key == "neutral")
