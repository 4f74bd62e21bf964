"""A message that a section of a deployment uses, and the uses of its signals while it is bound.

A switch is refused if its values mean the contrary in the DBC; the message says what the switch
would do, and what to write instead.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from cantools.database.can import Message, Signal

from canshaper.codec.frame import STATE_BITS
from canshaper.codec.layout import Chosen, is_j1939
from canshaper.codec.sense import contrary, shows_sway_control
from canshaper.codec.signals import (
    code_fault,
    find_signal,
    j1939_code,
    j1939_fault,
    names_broken,
    raw_fault,
    raw_limits,
)
from canshaper.config.source import Diagnostics, Place
from canshaper.errors import there_are
from canshaper.machine.database import DbcFile

_OTHER = "name another signal, or correct VAL_ where the DBC is wrong or says neither"


class Contrary(NamedTuple):
    """Texts for a switch whose names in the DBC mean the contrary: its effect, and the cure.

    Attributes:
        effect: effect in words, to be followed by the position of the switch.
        cure: what to write instead.
        stop: whether the switch is an emergency stop.
        known: whether a name that says neither on nor off is refused too, as it may be a fault
            under which a valve would move.
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
    """Return the texts for a direction flag of a joystick."""
    return Contrary(f"be taken as {key} while")


def contrary_fault(signal: Signal, key: str | int, wrong: Contrary) -> str | None:
    """Return why a switch, named by ``key`` of the file, does the contrary in the DBC, or None."""
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
    """A named value (VAL_ of the DBC) of a signal that is read, and its meaning for us."""

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
    """A message with the section of the deployment file that names it.

    Attributes:
        diagnostics: collects every problem.
        place: place of the section.
        file: DBC file of the message.
        message: the message, with the file's corrections.
        can_id: its identifier on the bus; in J1939 with the source address, 254 for any.
        any_source: whether it may come from any source address.
        chosen: which frames count, where the message is multiplexed.
        uses: use of each signal, by name. A signal has one use only; else a switch could move an
            axis.
        codes: meanings of the named values of its signals.
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
        """Add a problem at a key of the section."""
        self.diagnostics.add((*self.place, key), text)

    def add_fault(self, fault: str | None) -> None:
        """Add a problem at the message in its DBC file; None is no problem."""
        if fault is not None:
            self.diagnostics.problems.append(self.file.problem(self.message, fault))

    def find(self, place: Place, name: str | None) -> Signal | None:
        """Return the signal; None without a name, and with a problem if there is no such signal."""
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
        """Return the integer signal of a switch, counter or code, and record its use."""
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
        """Record what the codes of a switch mean; add a problem where the DBC contradicts.

        Args:
            place: place of the key that names the switch.
            name: name of its signal; a missing signal is reported elsewhere.
            means: meaning of each code that counts.
            other: meaning of every other code.
            wrong: texts for names that mean the contrary; None where the file states which code
                counts.
        """
        signal = None if name is None else find_signal(self.message, name)
        if signal is None:
            return
        fault = next((f for raw in means if (f := code_fault(signal, raw))), None)
        if is_j1939(self.message) and (first := j1939_code(signal)) is not None:
            raw = max(means)
            if raw >= first and raw not in (signal.choices or {}):
                text = f"{signal.name}: expected a code below {first}, as the others are errors in"
                fault = fault or f"{text} J1939, or a name for it (VAL_), got {raw}"
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
        """Record the start value of each unused signal; report one not at rest, as frames carry it.

        Args:
            start: raw start value of every signal of the sent message, by name.
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

    def check_errors(self, signal: Signal, *, command: bool = False) -> None:
        """Check that no error code of J1939 is a measurement, or, named too, a ``command``."""
        if is_j1939(self.message):
            self.add_fault(j1939_fault(signal, command=command))

    def check_integer(self, place: Place, signal: Signal, *, signed: bool = True) -> None:
        """Check that a signal is an integer, and unsigned unless ``signed``."""
        if signal.is_float or (signal.is_signed and not signed):
            got = "a float" if signal.is_float else "a signed one"
            kind = "an integer" if signed else "an unsigned integer"
            self.diagnostics.add(place, f"{signal.name}: expected {kind} signal, got {got}")

    def use(self, place: Place, signal: Signal, use: str) -> None:
        """Record the use of a signal; add a problem if it has one already."""
        self.check_unused(place, signal)
        self.uses[signal.name] = use

    def check_unused(
        self, place: Place, signal: Signal, also: dict[str, str] | None = None
    ) -> None:
        """Add a problem if ``uses`` or ``also`` already has a use of the signal."""
        if use := self.uses.get(signal.name) or (also or {}).get(signal.name):
            self.diagnostics.add(
                place,
                f"expected a free signal, got {signal.name!r}, which is {use} already",
            )

    def check_state_bits(self, place: Place, signal: Signal) -> None:
        """Check that a control or status word of CiA 408 is long enough for the state bits."""
        if signal.length < STATE_BITS:
            text = f"{signal.name}: expected {STATE_BITS} bits or more, got {signal.length}"
            self.diagnostics.add(place, text)


def key_path(place: Place) -> str:
    """Return a place as text, such as axes.slew.valve."""
    return ".".join(str(part) for part in place)
