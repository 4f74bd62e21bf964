"""Switches whose values mean the contrary in the DBC: what each would do, and what to write."""

from collections.abc import Mapping
from typing import NamedTuple

from cantools.database.can import Signal

from canshaper.codec.sense import contrary, shows_sway_control
from canshaper.codec.signals import names_broken

_OTHER = "name another signal, or correct VAL_ where the DBC is wrong or says neither"


class Contrary(NamedTuple):
    """Effect of a switch that is taken for its contrary, and the cure.

    Attributes:
        effect: in words that end before the position of the switch.
        cure: what to write instead.
        stop: whether it is an emergency stop.
        known: whether a name that says neither is refused too: it would let a valve move.
    """

    effect: str
    cure: str = _OTHER
    stop: bool = False
    known: bool = False


ENABLE = Contrary(
    "enable while",
    f"{_OTHER}; one in a message of its own may be one of switches, with code: 0",
    known=True,
)
SWITCH = Contrary("enable while", "write code: 0, or code: 1 where it is meant so", known=True)
STOP = Contrary(
    "free the stop while",
    f"{_OTHER}; one whose 1 is free may be one of switches, in every enable",
    stop=True,
    known=True,
)
SWITCHES = {
    "reset": Contrary("reset a trip while"),
    "next_profile": Contrary("choose a profile while"),
    "anti_sway_off": Contrary("switch anti-sway off while"),
}


def flag_of(key: str) -> Contrary:
    """A flag of the direction of a joystick."""
    return Contrary(f"be taken as {key} while")


def contrary_fault(signal: Signal, key: str | int, wrong: Contrary) -> str | None:
    """Why a switch does the contrary by its names, or None; ``key`` is what names it."""
    choices: Mapping[int, object] = signal.choices or {}
    names = {raw: str(n) for raw, n in choices.items() if not names_broken(str(n))}
    off = key == "anti_sway_off"  # whose own name says off, as it should
    where = contrary(names, "" if off else signal.name, stop=wrong.stop, known=wrong.known)
    if where is None and off and shows_sway_control(signal.name):
        where = f"{signal.name} is on"
    if where is None:
        return None
    table = ", ".join(f'{raw} "{names[raw]}"' for raw in (0, 1) if raw in names)
    said = f"{signal.name} ({table})" if table else signal.name
    expected = "0 is free" if wrong.stop else "1 is on"
    text = f"expected a signal whose {expected}, got {said}: it would {wrong.effect} {where}"
    return f"{text}; {wrong.cure}"
