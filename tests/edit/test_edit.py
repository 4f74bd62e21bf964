"""Values written into a deployment file: everything else stays, byte for byte."""

import os
import stat
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from canshaper.config.load import load_config
from canshaper.edit.edit import FileValue, change, edited
from canshaper.errors import ConfigError
from tests.edit.edited import NEW, SLEW, gff_line
from tests.rigs.files import ROOT


def test_flow_style(file: Path) -> None:
    before = file.read_bytes()
    change(file, [(SLEW, NEW, "")])
    assert file.read_bytes() == before.replace(
        b"{ kind: gff, a1: 0.708, a2: 0.12 }\n", b"{ kind: gff, a1: 0.7, a2: 0.12233 }\n"
    )
    assert list(file.parent.iterdir()) == [file]


def test_a_comment_behind_the_section_stays(file: Path) -> None:
    change(file, [(("axes", "near_far", "filter"), NEW, "")])
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
    change(file, [(SLEW, NEW, "")])
    after = text.replace(BLOCK.replace("\n", newline), BLOCK_AFTER.replace("\n", newline))
    assert file.read_bytes() == after.encode()
    assert load_config(file)[0].axes["slew"].filter.parameters() == {"a1": 0.7, "a2": 0.12233}


def test_an_item_of_a_list(file: Path) -> None:
    """One breakpoint of a gain schedule gets its filter, and the others stay."""
    text = (ROOT / "config" / "forwarder-load.yaml").read_text(encoding="utf-8")
    place = ("axes", "slew", "gain_schedule", 1, "filter")
    after = edited(text, place, {"taps": ["2 x 0.5"]}, note="By hand.").splitlines()
    changed = [one for one, was in zip(after, text.splitlines(), strict=True) if one != was]
    assert changed == ["          taps: [2 x 0.5]"]
    assert after.index(changed[0]) > after.index("      - breakpoint: 600 # a log")


# section before, values, section after
CASES: dict[str, tuple[str, Mapping[str, FileValue], str]] = {
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
        change(file, [(SLEW, {"a1": 0.1, "a2": 0.12}, "")])
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_mode_and_link_stay(file: Path) -> None:
    file.chmod(0o640)
    link = file.with_name("link.yaml")
    link.symlink_to(file.name)
    change(link, [(SLEW, NEW, "")])
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

        monkeypatch.setattr("canshaper.edit.edit.tempfile.mkstemp", refuse)
    try:
        with pytest.raises(ConfigError, match="not written, the file is as it was: Permission"):
            change(file, [(SLEW, NEW, "")])
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

    monkeypatch.setattr(f"canshaper.edit.edit.{step}", fail)
    with pytest.raises(ConfigError, match="No space left on device"):
        change(file, [(SLEW, NEW, "")])
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_a_file_changed_meanwhile_is_left_alone(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fsync = os.fsync

    def someone_else(number: int) -> None:
        fsync(number)
        file.write_text("tick_ms: 10\n")

    monkeypatch.setattr("canshaper.edit.edit.os.fsync", someone_else)
    with pytest.raises(ConfigError, match="changed by someone else"):
        change(file, [(SLEW, NEW, "")])
    assert file.read_text() == "tick_ms: 10\n"


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        change(tmp_path / "none.yaml", [(SLEW, NEW, "")])


@pytest.mark.parametrize(
    ("removed", "left"),
    [
        ("ab", "{ c: 3 }"),
        ("ba", "{ c: 3 }"),
        ("abc", "{ }"),
        ("ac", "{ b: 2 }"),
        ("bc", "{ a: 1 }"),
    ],
)
def test_keys_of_a_flow_mapping_go_with_their_commas(removed: str, left: str) -> None:
    values: dict[str, FileValue] = dict.fromkeys(removed)
    text = edited("x: { a: 1,   b: 2, c: 3 }\n", ("x",), values, "file", "")
    assert yaml.safe_load(text) == yaml.safe_load(f"x: {left}\n")
