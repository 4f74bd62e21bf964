"""Generated parts are current, and a new reason reaches all of them."""

import runpy
from enum import IntEnum
from pathlib import Path
from typing import Any

import cantools
import pytest

from canshaper.codec.frame import FrameFault
from canshaper.shaping.reasons import REASON_TEXTS, STATE_TEXTS, ReasonText
from canshaper.shaping.state_machine import transitions
from canshaper.shaping.states import REACTION_OF, Reaction, Reason, State, Trust
from tools import architecture
from tools.frame_faults import FAULT_TEXTS, TRUST_TEXTS

ROOT = Path(__file__).parents[2]
generate: dict[str, Any] = runpy.run_path(str(ROOT / "tools/generate.py"))
GENERATED: dict[Path, str] = generate["generated"](ROOT)
LAST = max(Reason)
ADDED = IntEnum("Reason", {**{one.name: int(one) for one in Reason}, "HOSE_BURST": LAST + 1})  # type: ignore[misc]


@pytest.mark.parametrize("path", GENERATED, ids=[path.name for path in GENERATED])
def test_files_are_as_generated(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == GENERATED[path], "run make generate"


@pytest.mark.parametrize("path", sorted((ROOT / "dbc").glob("*.dbc")), ids=lambda path: path.name)
def test_every_status_of_a_dbc_has_the_tables_of_the_program(path: Path) -> None:
    database: Any = cantools.database.load_file(path)
    for message in database.messages:
        names = {signal.name: signal for signal in message.signals}
        kinds: dict[str, type[IntEnum]] = {}
        if {"State", "Reason", "ShapedCommand"} <= names.keys():
            kinds |= {"State": State, "Reason": Reason}
        if "LastFault" in names:
            kinds |= {"LastFault": FrameFault}
        if "SwaySensor" in names:
            kinds |= {"SwaySensor": Trust}
        for name, kind in kinds.items():
            table = {number: str(text) for number, text in names[name].choices.items()}
            assert table == {int(one): one.name for one in kind}


def test_a_reason_that_is_added_reaches_dbc_and_page() -> None:
    text = (ROOT / "dbc" / "forwarder.dbc").read_text(encoding="utf-8")
    new = generate["with_value_tables"](text, {"Reason": ADDED})
    last = f'{LAST:d} "{LAST.name}" ;'
    assert new.count(f'{LAST + 1} "HOSE_BURST" ;') == text.count(last) > 0
    texts = {
        **REASON_TEXTS,
        LAST + 1: ReasonText("a hose burst", "no pressure", "a new hose", fmi=7),
    }
    rows = list(generate["reason_rows"](ADDED, texts))
    assert rows[-1] == f"| {LAST + 1} | HOSE_BURST | no pressure | a new hose | 7 |"
    page = "a\n<!-- generated: reasons -->\nLAST YEAR\n<!-- end: reasons -->\nb\n"
    written = generate["with_sections"](page, {"reasons": rows})
    assert rows[-1] in written
    assert "LAST YEAR" not in written
    assert written.startswith("a\n") and written.endswith("\nb\n")


def test_a_valve_state_of_another_message_keeps_its_table() -> None:
    text = 'VAL_ 5 State 0 "Block" 1 "Extend" ;\n'
    assert generate["with_value_tables"](text, {"State": State}) == text


def test_every_reason_fault_and_state_has_its_texts() -> None:
    assert [*FAULT_TEXTS, *TRUST_TEXTS] == [*FrameFault, *Trust]
    assert all(FAULT_TEXTS.values())
    assert REASON_TEXTS.keys() == {*Reason}
    assert STATE_TEXTS.keys() == {*State}
    assert all(text.words and text.cause for text in REASON_TEXTS.values())


def test_the_reaction_is_reported_by_the_number() -> None:
    assert REACTION_OF.keys() == {*Reason}
    for reason, reaction in REACTION_OF.items():
        kinds = [Reaction.NONE, Reaction.SHAPED_STOP, Reaction.NEUTRAL]
        assert reaction is kinds[int(reason) // 32]


def test_the_page_names_every_transition() -> None:
    text = GENERATED[ROOT / "docs" / "states.md"]
    for old, new in transitions():
        assert f"    {old.name} --> {new.name}: " in text


def test_a_list_of_keys_has_default_range_unit_and_the_place_of_what_is_below() -> None:
    of, links = generate["section_names"](), {"Match": "#the-device", "Limits": "#limits"}
    rows = [r for n in ("Limits", "Uncertainty", "Bus") for r in generate["key_rows"](of[n], links)]
    assert "- `allow_reverse` (false): the output may go against the joystick" in rows
    assert "- `min_pct` (0, 0 to 50 % of full speed): outputs below this are zero" in rows
    assert "- `damping_pct` ([-50, 100], -95 to 500 %): damping of its joints, from and to" in rows
    assert any(row.startswith("- [`match`](#the-device) (optional): the device") for row in rows)


def test_a_list_of_keys_has_those_of_the_section_itself() -> None:
    rows = list(generate["key_rows"](generate["section_names"]()["EmergencyStop"], {}))
    assert [row.partition("`")[2].partition("`")[0] for row in rows] == ["signal"]


def test_a_room_without_a_ring_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    rings = {name: ring for name, ring in architecture.RINGS.items() if name != "gate"}
    monkeypatch.setattr(architecture, "RINGS", rings)
    with pytest.raises(ValueError, match=r"expected gate/\w+ in RINGS .*, got no ring"):
        list(architecture.ring_rows())


def test_lines_of_a_ring_are_those_of_its_rooms() -> None:
    files = [*(ROOT / "canshaper/gate").glob("*.py")]
    files += [ROOT / f"canshaper/{name}.py" for name in ("controller/gated", "blackbox/recorder")]
    gate = sum(len(file.read_text("utf-8").splitlines()) for file in files)
    row = next(row for row in architecture.ring_rows() if row.startswith("| gate |"))
    assert f"| {round(gate / 1000)} 000 |" in row
