"""Values written into a deployment file: everything else stays, byte for byte."""

import os
import shutil
import stat
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from canshaper.config.edit import edited, set_values
from canshaper.config.flow import Value
from canshaper.config.load import load_config
from canshaper.errors import ConfigError

FILE = Path(__file__).resolve().parents[3] / "config" / "forwarder.yaml"
SLEW = ("axes", "slew", "filter")
NEW: dict[str, Value] = {"a1": 0.7, "a2": 0.12233, "third_pole_rad_s": None, "poles_rad_s": None}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return Path(shutil.copy(FILE, tmp_path / "machine.yaml"))


def gff_line(text: str, line: str) -> str:
    old = "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
    assert text.count(old) == 1
    return text.replace(old, line)


def test_flow_style(file: Path) -> None:
    before = file.read_bytes()
    set_values(file, SLEW, NEW)
    assert file.read_bytes() == before.replace(
        b"{ kind: gff, a1: 0.708, a2: 0.12 }\n", b"{ kind: gff, a1: 0.7, a2: 0.12233 }\n"
    )
    assert list(file.parent.iterdir()) == [file]


def test_a_comment_behind_the_section_stays(file: Path) -> None:
    set_values(file, ("axes", "near_far", "filter"), NEW)
    text = file.read_text()
    assert "{ kind: gff, a1: 0.7, a2: 0.12233 } # near-far tuning of the paper\n" in text


BLOCK = """\
    filter:
      # tuned in May
      kind: gff # the paper's
      poles_rad_s: [-3.5, -2.5] # by hand

      # nothing below
"""
BLOCK_AFTER = """\
    filter:
      # tuned in May
      kind: gff # the paper's
      a1: 0.7
      a2: 0.12233 # by hand

      # nothing below
"""


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_block_style_poles_become_coefficients(file: Path, newline: str) -> None:
    text = gff_line(file.read_text(), BLOCK).replace("\n", newline)
    file.write_bytes(text.encode())
    set_values(file, SLEW, NEW)
    after = text.replace(BLOCK.replace("\n", newline), BLOCK_AFTER.replace("\n", newline))
    assert file.read_bytes() == after.encode()
    assert load_config(file)[0].axes["slew"].filter.parameters() == {"a1": 0.7, "a2": 0.12233}


# section before, values, section after
CASES: dict[str, tuple[str, Mapping[str, Value], str]] = {
    "poles in flow style": (
        "{ kind: gff, poles_rad_s: [-3, -2] } # c",
        NEW,
        "{ kind: gff, a1: 0.7, a2: 0.12233 } # c",
    ),
    "poles before kind": (
        "{poles_rad_s: [-3,\n  -2], kind: gff}",
        NEW,
        "{a1: 0.7, a2: 0.12233, kind: gff}",
    ),
    "add a third pole": (
        "{ kind: gff, a1: 1, a2: 0.1, }",
        {"third_pole_rad_s": -4.0},
        "{ kind: gff, a1: 1, a2: 0.1, third_pole_rad_s: -4.0, }",
    ),
    "take the third pole out": (
        "{ kind: gff, a1: 1, third_pole_rad_s: -4, a2: 0.1 }",
        NEW,
        "{ kind: gff, a1: 0.7, a2: 0.12233 }",
    ),
    "take the last one out": (
        "{ kind: gff, a1: 1, a2: 0.1, third_pole_rad_s: -4 }",
        NEW,
        "{ kind: gff, a1: 0.7, a2: 0.12233 }",
    ),
    "another filter": (
        "{ kind: first_order, time_constant_s: 0.3 } # c",
        {"kind": "gff", "time_constant_s": None, "a1": 1.0, "a2": 0.1},
        "{ kind: gff, a1: 1.0, a2: 0.1 } # c",
    ),
    "block, add behind a comment": (
        "\n  kind: gff\n  a1: 1 # s\n  a2: 0.1 # s^2\n# end",
        {"third_pole_rad_s": -4.0},
        "\n  kind: gff\n  a1: 1 # s\n  a2: 0.1 # s^2\n  third_pole_rad_s: -4.0\n# end",
    ),
    "block, take out with its line": (
        "\n  kind: gff\n  third_pole_rad_s: -4\n  a1: 1\n  a2: 0.1\n",
        NEW,
        "\n  kind: gff\n  a1: 0.7\n  a2: 0.12233\n",
    ),
    "block, take out next to a comment": (
        "\n  kind: gff\n  third_pole_rad_s: -4 # why\n  a1: 1\n  a2: 0.1\n",
        NEW,
        "\n  kind: gff\n  # why\n  a1: 0.7\n  a2: 0.12233\n",
    ),
    "block, poles as a block": (
        "\n  poles_rad_s:\n    - -3\n    - -2\n\n  # c\n  kind: gff\n",
        NEW,
        "\n  a1: 0.7\n  a2: 0.12233\n\n  # c\n  kind: gff\n",
    ),
    "block without a last line end": (
        "\n  kind: gff\n  a1: 1\n  a2: 0.1",
        {"third_pole_rad_s": -4.0},
        "\n  kind: gff\n  a1: 1\n  a2: 0.1\n  third_pole_rad_s: -4.0",
    ),
    "quoted key, small number": (
        "{ kind: gff, 'a1': 1, a2: 0.1 }",
        {"a2": 0.00001},
        "{ kind: gff, 'a1': 1, a2: 0.00001 }",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_spans(name: str) -> None:
    before, values, after = CASES[name]
    head = "# ä €: 😀\nother: { filter: [1, 2] } # filter\nfilter: "
    result = edited(head + before, ("filter",), values)
    assert result == head + after
    section = yaml.safe_load(result)["filter"]
    for key, value in values.items():
        assert section.get(key) == value


REFUSED = {
    "shared by an anchor": ("x: &f { kind: gff, a1: 1, a2: 0.1 }\nfilter: *f\n", "anchor"),
    "a value from elsewhere": ("x: &f 1\nfilter: { kind: gff, a1: *f, a2: 0.1 }\n", "anchor"),
    "a comment in the poles": (
        "filter:\n  kind: gff\n  poles_rad_s: # both\n    - -3\n    - -2\n",
        "comment stands inside poles_rad_s",
    ),
    "no such section": ("other: 1\n", "no section filter"),
    "not a section": ("filter: 3\n", "expected a section with keys, got none"),
    "not YAML": ("filter: [1\n", "not YAML"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_changed_alone_is_refused(name: str) -> None:
    text, message = REFUSED[name]
    with pytest.raises(ConfigError, match=message):
        edited(text, ("filter",), NEW, "machine.yaml")


def test_a_result_that_is_no_deployment_is_not_written(file: Path) -> None:
    before = file.read_bytes()
    with pytest.raises(
        ConfigError, match=r"machine.yaml:\d+: axes.slew.filter: a1: expected .*, got 0.1"
    ):
        set_values(file, SLEW, {"a1": 0.1, "a2": 0.12})
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_mode_and_link_stay(file: Path) -> None:
    file.chmod(0o640)
    link = file.with_name("link.yaml")
    link.symlink_to(file.name)
    set_values(link, SLEW, NEW)
    assert link.is_symlink()
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert "a1: 0.7" in file.read_text()


def test_a_directory_that_cannot_be_written(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As root every directory can be written, so the refusal is put in where it would come up."""
    before = file.read_bytes()
    file.parent.chmod(0o555)
    if os.geteuid() == 0:

        def refuse(**_options: object) -> None:
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("canshaper.config.edit.tempfile.mkstemp", refuse)
    try:
        with pytest.raises(ConfigError, match="not written, the file is as it was: Permission"):
            set_values(file, SLEW, NEW)
    finally:
        file.parent.chmod(0o755)
    assert file.read_bytes() == before


@pytest.mark.parametrize("step", ["os.fsync", "Path.replace"])
def test_a_disk_that_fails_on_the_way(
    file: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    before = file.read_bytes()

    def fail(*_arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(f"canshaper.config.edit.{step}", fail)
    with pytest.raises(ConfigError, match="No space left on device"):
        set_values(file, SLEW, NEW)
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_a_file_changed_meanwhile_is_left_alone(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fsync = os.fsync

    def someone_else(number: int) -> None:
        fsync(number)
        file.write_text("tick_ms: 10\n")

    monkeypatch.setattr("canshaper.config.edit.os.fsync", someone_else)
    with pytest.raises(ConfigError, match="changed by someone else"):
        set_values(file, SLEW, NEW)
    assert file.read_text() == "tick_ms: 10\n"


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        set_values(tmp_path / "none.yaml", SLEW, NEW)


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
SWAY: dict[str, Value] = {"period_s": 2.5, "full_speed_m_s": 1.0}


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
        (
            "  sway: { period_s: 2.3 }\n",
            "  sway: { period_s: 2.5, full_speed_m_s: 1.0 }\n",
        ),
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
    set_values(file, SLEW, {"taps": ["2 x 0.5", "3 x 0"]})
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
    set_values(file, SLEW, {"designed_for": {"period_s": 2.5, "damping_ratio": 0.05}})
    old = "designed_for:\n        period_s: 2.3\n        damping_ratio: 0.04\n"
    new = "designed_for: { period_s: 2.5, damping_ratio: 0.05 }\n"
    assert file.read_text() == before.replace(old, new)


def test_a_comment_between_the_entries_is_not_lost(file: Path) -> None:
    block = "    filter:\n      kind: gff\n      poles_rad_s:\n      - -3 # slow\n      - -4\n"
    before = gff_line(file.read_text(), block)
    file.write_text(before)
    with pytest.raises(ConfigError, match="comment stands inside poles_rad_s; change it by hand"):
        set_values(file, SLEW, {"poles_rad_s": [-3.0, -5.0]})
    assert file.read_text() == before


def test_what_another_tool_has_written_can_be_written_to(file: Path) -> None:
    """PyYAML's own form of the whole file: off is false, lists begin below their keys."""
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text())))
    assert "kind: false" in file.read_text()
    set_values(file, SLEW, {"kind": "gff", "a1": None, "a2": None, "poles_rad_s": [-3.0, -4.0]})
    axes = load_config(file)[0].axes
    assert axes["lift"].filter.kind == "off"
    assert axes["slew"].filter.parameters() == {"poles_rad_s": [-3.0, -4.0]}
