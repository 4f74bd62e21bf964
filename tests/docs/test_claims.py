"""Each claim of the safety page has one id, and names tests that are there.

A claim begins with its id: P, H, R, G, A and a number, or names of reasons and faults, such as
SEND_FAILED. It, or its row in the table of tests, names `room/test_file::part`: a file in
``tests``, and a part, in whole words, of the name of one of its functions or cases.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.shaping.states import REACTION_OF, Reaction, Reason
from tests.docs.pages import ROOT
from tools import reactions

TEXT = (ROOT / "docs/safety.md").read_text(encoding="utf-8")
SECTIONS = ("Promises", "Hazards", "Added velocity", "Faults", "The gate")
ID = r"(?:[PHRGA]\d+|[A-Z]+(?:_[A-Z]+)+)"
CLAIM = re.compile(rf"(?:- |\| )({ID}(?:, {ID})*)\b")
TEST = re.compile(r"`((?:[a-z0-9_]+/)+(?:test|frame)_[a-z0-9_]+)(?:::([a-z0-9_]+))?`")
NONE = "none: by the ECU"
NAMES = {one.name for kind in (Reason, FrameFault) for one in kind}


def entries(text: str, names: Iterable[str] = SECTIONS) -> Iterator[str]:
    """Rows of tables and points of lists in the sections with claims, each in one line."""
    for name in names:
        section = text.partition(f"\n## {name}\n")[2].partition("\n## ")[0].partition("\n### ")[0]
        rows = re.sub(r"\n {2,}(?=\S)", " ", section).splitlines()
        ruled = [i for i, row in enumerate(rows) if row.startswith("|--")]
        heads = {*ruled, *(i - 1 for i in ruled)}
        yield from (r for i, r in enumerate(rows) if r[:2] in ("- ", "| ") and i not in heads)


def is_there(file: str, part: str) -> bool:
    """Whether that test is in the tree."""
    path = ROOT / "tests" / f"{file}.py"
    if not path.exists():
        return False
    functions = rf"def test_(?:\w+_)?{part}(?:_\w+)?\("
    case = rf'"{part.replace("_", " ")}": '
    return not part or bool(re.search(f"{functions}|{case}", path.read_text(encoding="utf-8")))


def faults(text: str) -> list[str]:
    """Yield the faults of the claims of a page."""
    wrong, ids = [], Counter[str]()
    table = {row.split()[1]: row for row in entries(text, ["Tests"])}
    for entry in entries(text):
        claim = CLAIM.match(entry)
        if claim is None:
            wrong.append(f"no id: {entry}")
            continue
        ids.update(claim[1].split(", "))
        tests = TEST.findall(entry := entry + table.pop(claim[1], ""))
        if not tests and NONE not in entry:
            wrong.append(f"{claim[1]}: no test")
        wrong += [f"{claim[1]}: {f}::{part} is gone" for f, part in tests if not is_there(f, part)]
    wrong += [f"{one}: no claim" for one in table]
    wrong += [f"{one}: stands {count} times" for one, count in ids.items() if count > 1]
    names = {one for one in ids if "_" in one}
    wrong += [f"{one}: neither reason nor fault" for one in sorted(names - NAMES)]
    return wrong


def test_each_claim_has_one_id_and_tests_that_are_there() -> None:
    assert faults(TEXT) == []


def test_every_reason_to_stop_is_a_claim() -> None:
    matches = [claim for entry in entries(TEXT) if (claim := CLAIM.match(entry))]
    ids = {one for claim in matches for one in claim[1].split(", ")}
    stops = {one.name for one in Reason if REACTION_OF[one] is not Reaction.NONE}
    assert stops <= ids
    for letter in "PHRGA":
        numbers = sorted(int(one[1:]) for one in ids if re.fullmatch(rf"{letter}\d+", one))
        assert numbers == [*range(1, len(numbers) + 1)], letter


@pytest.mark.parametrize(
    ("entry", "fault"),
    [
        ("- P1 it stops. `promises/test_1`", None),
        ("| P1 it stops | `promises/test_2::sound_controller` |", None),
        ("- SEND_FAILED, BUS_GONE:\n  `hil/frame_faults::error_code`", None),
        ("- P1 it stops. none: by the ECU", None),
        ("- P1 it stops.", "P1: no test"),
        ("- P1 it stops.\n\n## Tests\n| P1 | `promises/test_1` |", None),
        ("- P1 `promises/test_1`\n\n## Tests\n| P2 | `promises/test_2` |", "P2: no claim"),
        ("- It stops. `promises/test_1`", "no id: "),
        ("- P1 it stops. `promises/test_0`", "P1: promises/test_0:: is gone"),
        ("- P1 it stops. `promises/test_2::sound_contr`", "P1: promises/test_2::sound_contr is"),
        ("- P1 `promises/test_1`\n- P1 `promises/test_2`", "P1: stands 2 times"),
        ("- NO_REASON `promises/test_1`", "NO_REASON: neither reason nor fault"),
    ],
)
def test_a_claim_that_is_wrong_is_seen(entry: str, fault: str | None) -> None:
    seen = faults(f"# Page\n\n## Promises\n\n| id | test |\n|---|---|\n{entry}\n\n## Other\n- no\n")
    assert len(seen) == (fault is not None)
    assert not fault or seen[0].startswith(fault)


def test_a_row_says_the_reaction_of_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = reactions.Row("EMERGENCY_STOP", "", "promises/test_1", "", reactions.NONE)
    monkeypatch.setattr(reactions, "ROWS", (wrong,))
    with pytest.raises(ValueError, match=r"^expected one reaction of EMERGENCY_STOP, got "):
        list(reactions.reaction_rows())
