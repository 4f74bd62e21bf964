"""A message that a part of a deployment uses, and its signals while they are bound.

A switch whose values mean the contrary in the DBC is refused, with what it would do, and what to
write.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from cantools.database.can import Message, Signal

from canshaper.codec.frame import STATE_BITS
from canshaper.codec.layout import Chosen, is_j1939
from canshaper.codec.sense import contrary, shows_sway_control
from canshaper.codec.signals import code_fault, find_signal, names_broken, raw_fault, raw_limits
from canshaper.config.source import Diagnostics, Place
from canshaper.errors import there_are
from canshaper.machine.database import DbcFile

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


class NamedCode(NamedTuple):
    """A value that the DBC names (VAL_) of a signal that is read, and what it means."""

    message: str
    signal: str
    code: float
    name: str
    means: str


class StartValue(NamedTuple):
    """A signal of a valve message that no axis uses: every frame carries its start value."""

    message: str
    signal: str
    value: float
    unit: str


@dataclass(frozen=True)
class UsedMessage:
    """A message with the part of the deployment file that names it.

    Attributes:
        diagnostics: gets every problem.
        place: of that part.
        file: its DBC file.
        message: the message.
        can_id: its identifier on the bus; in J1939 with the source address, 254 for any.
        any_source: whether it may come from any source address.
        chosen: which frames are meant, where the message is multiplexed.
        uses: what its signals are used for, by name: each has one use, or a switch could move an
            axis.
        codes: what the named values of its signals mean.
        starts: start values of signals that no axis uses, in a valve message.
    """

    diagnostics: Diagnostics
    place: Place
    file: DbcFile
    message: Message
    can_id: int
    any_source: bool
    chosen: Chosen | None = None
    uses: dict[str, str] = field(default_factory=dict)
    codes: list[NamedCode] = field(default_factory=list)
    starts: list[StartValue] = field(default_factory=list)

    def add(self, key: str, text: str) -> None:
        """Note a problem at a key of its part of the deployment file."""
        self.diagnostics.add((*self.place, key), text)

    def add_fault(self, fault: str | None) -> None:
        """Note a problem in the DBC file; None is no problem."""
        if fault is not None:
            self.diagnostics.problems.append(self.file.problem(self.message, fault))

    def find(self, place: Place, name: str | None) -> Signal | None:
        """The signal; None when there is none of that name, or none was named."""
        if name is None:
            return None
        signal = find_signal(self.message, name)
        if signal is None:
            names = [s.name for s in self.message.signals]
            text = f"expected a signal of {self.message.name}, got {name!r}"
            self.diagnostics.add(place, text + there_are(name, names))
        return signal

    def integer(
        self, place: Place, name: str | None, use: str, *, signed: bool = True
    ) -> Signal | None:
        """The signal of a switch, counter or code, which is known by its raw value."""
        if signal := self.find(place, name):
            self.check_integer(place, signal, signed=signed)
            self.use(place, signal, use)
        return signal

    def check_switch(
        self,
        place: Place,
        name: str | None,
        means: Mapping[int, str],
        other: str,
        wrong: Contrary | None = None,
    ) -> None:
        """Note what the codes of a switch mean, and a problem where the DBC has them otherwise.

        Args:
            place: of the key that names it.
            name: its signal; one that is missing is noted elsewhere.
            means: what the codes mean that count.
            other: what all others mean.
            wrong: what it would do where its names mean the contrary; None where the file says
                which code counts.
        """
        signal = None if name is None else find_signal(self.message, name)
        if signal is None:
            return
        fault = next((f for raw in means if (f := code_fault(signal, raw))), None)
        if wrong and not fault:
            fault = raw_fault(signal) or contrary_fault(signal, place[-1], wrong)
        if fault:
            self.diagnostics.add(place, fault)
        for raw, choice in (signal.choices or {}).items():
            code = NamedCode(
                self.message.name, signal.name, raw, str(choice), means.get(raw, other)
            )
            self.codes.append(code)
            if raw in means and names_broken(code.name):
                text = f"expected a signal whose {raw} is {code.means}, got {signal.name!r}"
                self.diagnostics.add(place, f'{text}, whose {raw} is "{code.name}" in the DBC')

    def check_start_values(self, start: Mapping[str, float]) -> None:
        """Check that signals that no axis uses rest: every frame carries their start value.

        Args:
            start: raw start value of every signal of the message that is sent.
        """
        for signal in self.message.signals:
            raw = start[signal.name]
            missing = is_j1939(self.message) and signal.raw_initial is None  # all bits 1
            if signal.name in self.uses or signal.is_multiplexer or missing:
                continue
            value, unit = raw * signal.scale + signal.offset, signal.unit or ""
            self.starts.append(StartValue(self.message.name, signal.name, value, unit))
            ends = [one * signal.scale + signal.offset for one in raw_limits(signal)]
            low = min(ends) if signal.minimum is None else signal.minimum
            high = max(ends) if signal.maximum is None else signal.maximum
            if low < 0.0 < high and value != 0.0 and raw not in (signal.choices or {}):
                rest = -signal.offset / signal.scale
                text = f"expected {rest:g}, rest, or a value that VAL_ names: no axis uses it and"
                text += f" every frame of {self.message.name} carries it; got {raw:g}, {value:g}"
                self.add_fault(f"{signal.name}: GenSigStartValue: {text} {unit}".rstrip())

    def check_integer(self, place: Place, signal: Signal, *, signed: bool = True) -> None:
        """Check that a raw value is a whole number."""
        if signal.is_float or (signal.is_signed and not signed):
            got = "a float" if signal.is_float else "a signed one"
            kind = "an integer" if signed else "an unsigned integer"
            self.diagnostics.add(place, f"{signal.name}: expected {kind} signal, got {got}")

    def use(self, place: Place, signal: Signal, use: str) -> None:
        """Note the one use of a signal."""
        self.check_unused(place, signal)
        self.uses[signal.name] = use

    def check_unused(
        self, place: Place, signal: Signal, also: dict[str, str] | None = None
    ) -> None:
        """Note a problem where the signal has a use already, by ``uses`` or by ``also``."""
        if use := self.uses.get(signal.name) or (also or {}).get(signal.name):
            self.diagnostics.add(
                place,
                f"expected a free signal, got {signal.name!r}, which is {use} already",
            )

    def check_state_bits(self, place: Place, signal: Signal) -> None:
        """Check that control and status word of CiA 408 have the state in their low bits."""
        if signal.length < STATE_BITS:
            text = f"{signal.name}: expected {STATE_BITS} bits or more, got {signal.length}"
            self.diagnostics.add(place, text)


def key_path(place: Place) -> str:
    """A place as it is written: axes.slew.valve."""
    return ".".join(str(part) for part in place)
