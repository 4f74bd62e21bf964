"""Values written into a deployment file: quotes, notes and what becomes of comments."""

from pathlib import Path

import pytest
import yaml

from canshaper.config.load import load_config
from canshaper.edit.edit import FileValue, change, edited
from canshaper.errors import ConfigError
from tests.edit.edited import SLEW, gff_line


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("a: b", '"a: b"'),
        ("a.log, b.log", '"a.log, b.log"'),
        ("Häiriö 2.log", "Häiriö 2.log"),
        ("drive #2.log", '"drive #2.log"'),
        ('a"b', '"a\\"b"'),
        ("true", '"true"'),
        ("12", '"12"'),
        ("", '""'),
        ("2026-11-23", "2026-11-23"),
        ("canshaper identify 0.1.0", "canshaper identify 0.1.0"),
    ],
)
def test_text_is_quoted_where_it_would_be_read_otherwise(text: str, written: str) -> None:
    section = edited("sway: { kind: gff }", ("sway",), {"kind": text, "origin": {"log": text}})
    assert section == f"sway: {{ kind: {written}, origin: {{ log: {written} }} }}"


NOTE = "Written by canshaper identify."
SWAY: dict[str, FileValue] = {"period_s": 2.5, "full_speed_m_s": 1.0}


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("before", "after"),
    [
        (
            "# the crane\n\n  # Stopwatch: ten swings\n  # took 23 s.\n"
            "  sway: { period_s: 2.3 } # by hand\n",
            f"# the crane\n\n  # {NOTE}\n  sway: {{ period_s: 2.5, full_speed_m_s: 1.0 }}\n",
        ),
        (
            "    # of another\n# of all\n  sway: { period_s: 2.3 } # by hand\n  # below\n",
            "    # of another\n# of all\n  sway: { period_s: 2.5, full_speed_m_s: 1.0 }"
            f" # {NOTE}\n  # below\n",
        ),
        ("  sway: { period_s: 2.3 }\n", "  sway: { period_s: 2.5, full_speed_m_s: 1.0 }\n"),
        (
            "  # tool and load\n  sway: { mass_kg: 3, period_s: 2.3 } # heavy\n",
            "  # tool and load\n"
            "  sway: { mass_kg: 3, period_s: 2.5, full_speed_m_s: 1.0 } # heavy\n",
        ),
        (
            "  # some\n  sway: # of all\n    # weighed\n    mass_kg: 3 # by hand\n\n"
            "    # timed\n    period_s: 2.3 # twice\n",
            "  # some\n  sway: # of all\n    # weighed\n    mass_kg: 3 # by hand\n\n"
            f"    # {NOTE}\n    period_s: 2.5\n    full_speed_m_s: 1.0\n",
        ),
        (
            "  sway: # of all\n\n    # timed\n    # twice\n    period_s: 2.3 # by hand\n"
            "    # seen\n    # by eye\n    full_speed_m_s: 2\n",
            f"  sway: # {NOTE}\n\n    period_s: 2.5\n    full_speed_m_s: 1.0\n",
        ),
    ],
)
def test_a_note_replaces_comments_on_what_is_written(before: str, after: str, newline: str) -> None:
    text = ("axis:\n" + before + "  next: 1\n").replace("\n", newline)
    expected = ("axis:\n" + after + "  next: 1\n").replace("\n", newline)
    assert edited(text, ("axis", "sway"), SWAY, "", NOTE) == expected


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("indent", range(7))
def test_a_block_list_of_any_indentation_is_replaced(file: Path, indent: int, newline: str) -> None:
    """Tools that write YAML begin a list below its key, or further right."""
    items = "".join(f"      {' ' * indent}- {tap}\n" for tap in (0.5, 0.25, 0.25))
    block = f"    filter:\n      kind: robust\n      taps: # these\n{items}      tick_ms: 20\n"
    text = gff_line(file.read_text(), block)
    file.write_bytes(text.replace("\n", newline).encode())
    change(file, [(SLEW, {"taps": ["2 x 0.5", "3 x 0"]}, "")])
    expected = text.replace(f"taps: # these\n{items}", "taps: [2 x 0.5, 3 x 0] # these\n")
    assert file.read_bytes() == expected.replace("\n", newline).encode()
    assert load_config(file)[0].axes["slew"].filter.parameters()["taps"][:2] == [0.5, 0.5]


def test_a_block_section_is_replaced_by_numbers_with_their_keys(file: Path) -> None:
    block = (
        "    filter:\n      kind: zv\n      designed_for:\n        period_s: 2.3\n"
        "        damping_ratio: 0.04\n"
    ).replace("kind: zv", "kind: robust\n      tick_ms: 20\n      taps:\n      - 1")
    before = gff_line(file.read_text(), block)
    file.write_text(before)
    change(file, [(SLEW, {"designed_for": {"period_s": 2.5, "damping_ratio": 0.05}}, "")])
    old = "designed_for:\n        period_s: 2.3\n        damping_ratio: 0.04\n"
    new = "designed_for: { period_s: 2.5, damping_ratio: 0.05 }\n"
    assert file.read_text() == before.replace(old, new)


def test_a_comment_between_the_entries_is_not_lost(file: Path) -> None:
    block = "    filter:\n      kind: gff\n      poles_rad_s:\n      - -3 # slow\n      - -4\n"
    before = gff_line(file.read_text(), block)
    file.write_text(before)
    with pytest.raises(ConfigError, match="comment stands inside poles_rad_s; change it by hand"):
        change(file, [(SLEW, {"poles_rad_s": [-3.0, -5.0]}, "")])
    assert file.read_text() == before


def test_what_another_tool_has_written_can_be_written_to(file: Path) -> None:
    """PyYAML's own form of the whole file: off is false, lists begin below their keys."""
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text())))
    assert "kind: false" in file.read_text()
    change(file, [(SLEW, {"kind": "gff", "a1": None, "a2": None, "poles_rad_s": [-3.0, -4.0]}, "")])
    axes = load_config(file)[0].axes
    assert axes["lift"].filter.kind == "off"
    assert axes["slew"].filter.parameters() == {"poles_rad_s": [-3.0, -4.0]}
