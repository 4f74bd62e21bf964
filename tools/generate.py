"""Write what is declared in the program into the files that repeat it: ``make generate``.

Value tables of the DBC files and the tables of docs/states.md come from the enumerations of states,
reasons, faults and trust, from their texts and from the transitions.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from enum import IntEnum
from pathlib import Path
from typing import TypeVar

from canshaper.codec.faults import FAULT_TEXTS
from canshaper.codec.frame import FrameFault
from canshaper.controller.counters import Counters
from canshaper.shaping.reasons import REASON_TEXTS, STATE_TEXTS, ReasonText
from canshaper.shaping.states import REACTION_OF, TRANSITIONS, Reaction, Reason, State
from canshaper.shaping.trust import Trust

Key = TypeVar("Key", bound=IntEnum)
ROOT = Path(__file__).parents[1]
TABLES: Mapping[str, type[IntEnum]] = {
    "State": State,
    "Reason": Reason,
    "LastFault": FrameFault,
    "SwaySensor": Trust,
}


def with_value_tables(dbc: str, tables: Mapping[str, type[IntEnum]]) -> str:
    """Text of a DBC file with the members of enumerations in its value tables.

    Args:
        dbc: the text.
        tables: enumerations by the signals that carry them; a signal of that name whose table
            begins with another word is one of another message.
    """
    for signal, kind in tables.items():
        (first, *_), rows = kind, " ".join(f'{int(m)} "{m.name}"' for m in kind)
        table = re.compile(rf'^(VAL_ \d+ {signal}) {int(first)} "{first.name}" .*;$', re.MULTILINE)
        dbc = table.sub(lambda found, rows=rows: f"{found[1]} {rows} ;", dbc)  # type: ignore[misc]
    return dbc


def with_sections(page: str, sections: Mapping[str, Iterable[str]]) -> str:
    """Text of a page with the lines of its generated sections, by their names."""
    for name, lines in sections.items():
        begin, end = f"<!-- generated: {name} -->\n", f"<!-- end: {name} -->\n"
        before, _, rest = page.partition(begin)
        _, _, after = rest.partition(end)
        page = before + begin + "\n" + "".join(f"{line}\n" for line in lines) + "\n" + end + after
    return page


def state_rows() -> Iterator[str]:
    """Table of the states."""
    yield "| no. | state | valve | meaning |"
    yield "|---|---|---|---|"
    for state, text in STATE_TEXTS.items():
        yield f"| {int(state)} | {state.name} | {text.valve} | {text.meaning} |"


def diagram() -> Iterator[str]:
    """The transitions as a diagram."""
    yield "```mermaid"
    yield "stateDiagram-v2"
    yield "    [*] --> NEUTRAL_WAIT"
    for (old, new), reasons in TRANSITIONS.items():
        yield f"    {old.name} --> {new.name}: {_names(reasons)}"
    yield "```"


def reason_rows(reasons: Iterable[Key], texts: Mapping[Key, ReasonText]) -> Iterator[str]:
    """Table of the reasons."""
    yield "| no. | reason | meaning | what helps | FMI |"
    yield "|---|---|---|---|---|"
    for reason in reasons:
        text = texts[reason]
        fmi = "" if text.fmi is None else text.fmi
        yield f"| {int(reason)} | {reason.name} | {text.cause} | {text.remedy} | {fmi} |"


def fault_rows() -> Iterator[str]:
    """Table of the faults."""
    yield "| no. | fault | counted in | meaning |"
    yield "|---|---|---|---|"
    for fault, text in FAULT_TEXTS.items():
        yield f"| {int(fault)} | {fault.name} | {Counters.SIGNAL_OF.get(fault, '')} | {text} |"


def _names(reasons: frozenset[Reason]) -> str:
    """Reasons by name; most of a kind as that kind, with those that are missing."""
    words = []
    for reaction in (Reaction.SHAPED_STOP, Reaction.NEUTRAL):
        kind = {reason for reason, one in REACTION_OF.items() if one is reaction}
        if len(kind & reasons) > len(kind) / 2:
            missing = "".join(f", but {one.name}" for one in sorted(kind - reasons))
            words.append(f"any reason for: {reaction.value}{missing}")
            reasons -= kind
    return ", ".join([*words, *(reason.name for reason in sorted(reasons))])


def generated(root: Path) -> dict[Path, str]:
    """Texts of all files with generated parts, as they should be."""
    files = {
        path: with_value_tables(path.read_text(encoding="utf-8"), TABLES)
        for path in sorted((root / "dbc").glob("*.dbc"))
    }
    page = root / "docs" / "states.md"
    sections = {
        "states": state_rows(),
        "diagram": diagram(),
        "reasons": reason_rows(Reason, REASON_TEXTS),
        "faults": fault_rows(),
    }
    return {**files, page: with_sections(page.read_text(encoding="utf-8"), sections)}


if __name__ == "__main__":
    for path, text in generated(ROOT).items():
        if path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path.relative_to(ROOT)}")
