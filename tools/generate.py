"""Write what is declared in the program into the files that repeat it: ``make generate``.

Value tables of the DBC files and the tables of docs/states.md come from the enumerations of states,
reasons, faults and trust, from their texts and from the transitions. Lists of keys (``keys CLASS``)
come from the schema of the deployment file, other tables from what declares their rows.
"""

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any, TypeVar

import canshaper.config.schema  # noqa: F401  (its classes are the sections)
from canshaper.cli.verbs.config_schema import checksum_table, filter_table
from canshaper.codec.frame import FrameFault
from canshaper.codec.status import AXIS_STATUS
from canshaper.commissioning.procedure.procedure import STEPS
from canshaper.commissioning.procedure.state import FILE
from canshaper.config.desk import MEASURES
from canshaper.config.inputs import PROFILES
from canshaper.config.section import Section
from canshaper.controller.valve_messages import Counters
from canshaper.recording.log import FORMATS
from canshaper.report.shift import FIGURES
from canshaper.shaping.reasons import REASON_TEXTS, STATE_TEXTS, ReasonText
from canshaper.shaping.registry import KINDS
from canshaper.shaping.state_machine import transitions
from canshaper.shaping.states import REACTION_OF, Reaction, Reason, State, Trust
from tools.architecture import ring_rows
from tools.claims import claim_rows
from tools.frame_faults import FAULT_TEXTS, TRUST_TEXTS
from tools.marks import marked, with_sections
from tools.reactions import reaction_rows

Key = TypeVar("Key", bound=IntEnum)
ROOT = Path(__file__).parents[1]
TABLES: Mapping[str, type[IntEnum]] = {
    "State": State,
    "Reason": Reason,
    "LastFault": FrameFault,
    "SwaySensor": Trust,
}


def with_value_tables(dbc: str, tables: Mapping[str, type[IntEnum]]) -> str:
    """Return the text of a DBC file with the members of enumerations in its value tables.

    Args:
        dbc: the text.
        tables: enumerations by the signals that carry them. A table that begins with another number
            or word belongs to another message and stays.
    """
    for signal, kind in tables.items():
        (first, *_), rows = kind, " ".join(f'{int(m)} "{m.name}"' for m in kind)
        table = re.compile(rf'^(VAL_ \d+ {signal}) {int(first)} "{first.name}" .*;$', re.MULTILINE)
        dbc = table.sub(lambda match, rows=rows: f"{match[1]} {rows} ;", dbc)  # type: ignore[misc]
    return dbc


def state_rows() -> Iterator[str]:
    """Yield the Markdown table of the states."""
    yield "| no. | state | valve | meaning |"
    yield "|---|---|---|---|"
    for state, text in STATE_TEXTS.items():
        yield f"| {int(state)} | {state.name} | {text.valve} | {text.meaning} |"


def status_rows() -> Iterator[str]:
    """Yield the Markdown table of an axis' signals in a status message."""
    yield "| signal | value | sent |"
    yield "|---|---|---|"
    for one in AXIS_STATUS:
        sent = "always" if one.required else "where the DBC has it"
        yield f"| `{one.name}` | {one.meaning} | {sent} |"


def diagram() -> Iterator[str]:
    """Yield the transitions of the states as a Mermaid diagram."""
    yield "```mermaid"
    yield "stateDiagram-v2"
    yield "    [*] --> NEUTRAL_WAIT"
    for (old, new), reasons in transitions().items():
        yield f"    {old.name} --> {new.name}: {_names(reasons)}"
    yield "```"


def reason_rows(reasons: Iterable[Key], texts: Mapping[Key, ReasonText]) -> Iterator[str]:
    """Yield the Markdown table of the reasons; one without a text ends the program."""
    yield "| no. | reason | meaning | what helps | FMI |"
    yield "|---|---|---|---|---|"
    for reason in reasons:
        if reason not in texts:
            sys.exit(f"{reason.name}: expected a row in canshaper/shaping/reasons.py")
        text = texts[reason]
        fmi = "" if text.fmi is None else text.fmi
        yield f"| {int(reason)} | {reason.name} | {text.cause} | {text.remedy} | {fmi} |"


def fault_rows() -> Iterator[str]:
    """Yield the Markdown table of the faults of frames and buses."""
    yield "| no. | fault | counted in | meaning |"
    yield "|---|---|---|---|"
    for fault, text in FAULT_TEXTS.items():
        yield f"| {int(fault)} | {fault.name} | {Counters.SIGNAL_OF.get(fault, '')} | {text} |"


def trust_rows() -> Iterator[str]:
    """Yield the Markdown table of the states of trust in a sway sensor."""
    yield "| no. | state | why | back |"
    yield "|---|---|---|---|"
    for trust, (why, back) in TRUST_TEXTS.items():
        yield f"| {int(trust)} | {trust.name} | {why} | {back} |"


def shipped_rows() -> Iterator[str]:
    """Yield the Markdown table of config/, each file with the first sentence of its comment."""
    yield "| deployment | what |"
    yield "|---|---|"
    for path in sorted((ROOT / "config").glob("*.yaml")):
        comment = re.match(r"(?:# ?.*\n)+", path.read_text(encoding="utf-8"))
        text = " ".join(line.strip("# ") for line in comment[0].splitlines()) if comment else ""
        first = re.split(r"[.] (?=[A-Z])", text)[0].rstrip(".")
        yield f"| [{path.stem}](../config/{path.name}) | {first} |"


def _names(reasons: frozenset[Reason]) -> str:
    """Return names of reasons in a line.

    Where they are more than half of a reaction's reasons, its name and the missing ones stand.
    """
    words = []
    for reaction in (Reaction.SHAPED_STOP, Reaction.NEUTRAL):
        kind = {reason for reason, one in REACTION_OF.items() if one is reaction}
        if len(kind & reasons) > len(kind) / 2:
            missing = "".join(f", but {one.name}" for one in sorted(kind - reasons))
            words.append(f"any reason for: {reaction.value}{missing}")
            reasons -= kind
    return ", ".join([*words, *(reason.name for reason in sorted(reasons))])


def key_rows(section: type[Section], links: Mapping[str, str]) -> Iterator[str]:
    """Yield the Markdown list of a section's own keys: default, range, unit, what each is.

    Args:
        section: of the schema; inherited keys are left out.
        links: where sections have a list of their own, by name; a key that holds one leads there.
    """
    schema = section.model_json_schema()
    required = schema.get("required", ())
    here = links.get(section.__name__)
    for key, node in schema["properties"].items():
        if key not in section.__annotations__:
            continue
        number = next(_parts(node, "minimum"), {})
        unit = number.get("unit", "")
        words = [_default(node.get("default"))] if key not in required else []
        words += [", ".join(str(one) for part in _parts(node, "enum") for one in part["enum"])]
        words += [f"{_range(number)} {unit}"] if number else []
        limits = ", ".join(word.strip() for word in words if word)
        below = [part["$ref"].rpartition("/")[2] for part in _parts(node, "$ref")]
        at = next((links[one] for one in below if links.get(one, here) != here), None)
        text = node["description"].removesuffix(f" ({unit})").rstrip(".").replace("``", "`")
        if text[1].islower() or text[1] == " ":
            text = text[0].lower() + text[1:]
        yield f"- {f'[`{key}`]({at})' if at else f'`{key}`'}{limits and f' ({limits})'}: {text}"


def _parts(node: Any, key: str) -> Iterator[dict[str, Any]]:
    """Yield each dict in a JSON schema that has this key, outer ones first."""
    if isinstance(node, dict):
        if key in node:
            yield node
        node = [below for name, below in node.items() if name != "discriminator"]
    if isinstance(node, list):
        for below in node:
            yield from _parts(below, key)


def _range(number: Mapping[str, float]) -> str:
    low, high = (f"{number[end]:.10g}" for end in ("minimum", "maximum"))
    return low if low == high else f"{low} to {high}"


def _default(value: Any) -> str:
    """Return the default of an optional key as YAML; "optional" for None, a dict, an empty list."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list) and value:
        return f"[{value[0]:g}, {value[1]:g}]"
    return f"{value}".removesuffix(".0") if isinstance(value, int | float | str) else "optional"


def section_names(kind: type[Section] = Section) -> dict[str, type[Section]]:
    """Return name -> class of a section and its subclasses; of all sections by default."""
    below = [section_names(one) for one in kind.__subclasses__()]
    return {kind.__name__: kind} | {name: one for names in below for name, one in names.items()}


def list_places(pages: Mapping[Path, str]) -> dict[str, tuple[Path, str]]:
    """Return section -> (page, anchor of the heading) of each list of keys in these pages."""
    places = {}
    for page, text in pages.items():
        anchor = ""
        for line in text.splitlines():
            if line.startswith("#"):
                anchor = re.sub(r"[^\w\- ]", "", line.strip("# ").lower()).replace(" ", "-")
            elif mark := re.match(r"<!-- generated: keys (\w+) -->", line):
                places[mark[1]] = page, anchor
    return places


def section_rows(name: str, links: Mapping[str, str]) -> Iterable[str]:
    """Return the lines of a page's generated section by its name; ``links`` as in `key_rows`."""
    if name.startswith("keys "):
        return key_rows(section_names()[name.removeprefix("keys ")], links)
    return TABLES_OF_PAGES[name]()


def column_rows(columns: Mapping[str, str], head: str = "column | what") -> Iterator[str]:
    """Yield a Markdown table of names, each with what it is, under this head."""
    yield f"| {head} |"
    yield "|---|---|"
    for column, text in columns.items():
        yield f"| `{column}` | {text} |"


def profile_rows() -> Iterator[str]:
    """Yield the Markdown table of the profiles of AUTOSAR E2E."""
    yield "| `profile` | needs | header | counter | CRC |"
    yield "|---|---|---|---|---|"
    for name, one in PROFILES.items():
        needs = ", ".join(f"`{key}`" for key in one.needs)
        yield f"| `{name}` | {needs} | {one.header} | {one.counter} | {one.crc} |"


def step_rows() -> Iterator[str]:
    """Yield the Markdown table of the steps of a commissioning."""
    yield "| step | what it does | writes | open again after |"
    yield "|---|---|---|---|"
    for step in STEPS:
        after = ", ".join("any change of the file" if n == FILE else f"`{n}`" for n in step.needs)
        yield f"| `{step.name}` | {step.does} | {step.writes} | {after} |"


TABLES_OF_PAGES: Mapping[str, Callable[[], Iterable[str]]] = {
    "states": state_rows,
    "status": status_rows,
    "diagram": diagram,
    "reasons": lambda: reason_rows(Reason, REASON_TEXTS),
    "faults": fault_rows,
    "reactions": reaction_rows,
    "tests": claim_rows,
    "filters": lambda: filter_table(KINDS.values()),
    "checksums": checksum_table,
    "e2e profiles": profile_rows,
    "measures": lambda: column_rows(MEASURES),
    "figures": lambda: column_rows(FIGURES),
    "steps": step_rows,
    "rings": ring_rows,
    "trust": trust_rows,
    "shipped": shipped_rows,
    "logs": lambda: column_rows({s: f.says for s, f in FORMATS.items()}, "suffix | written by"),
}


def generated(root: Path) -> dict[Path, str]:
    """Return path -> text as it should be of all DBC files and pages with generated parts."""
    files = {
        path: with_value_tables(path.read_text(encoding="utf-8"), TABLES)
        for path in sorted((root / "dbc").glob("*.dbc"))
    }
    pages = {
        path: path.read_text(encoding="utf-8") for path in sorted((root / "docs").glob("*.md"))
    }
    places = list_places(pages)
    for page, text in pages.items():
        links = {
            name: f"{'' if one == page else one.name}#{anchor}"
            for name, (one, anchor) in places.items()
        }
        if names := marked(text, "generated"):
            sections = {name: section_rows(name, links) for name in names}
            files[page] = with_sections(text, sections)
    return files


if __name__ == "__main__":
    for path, text in generated(ROOT).items():
        if path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path.relative_to(ROOT)}")
