"""The YAML reader: what is no YAML, what YAML allows and a deployment does not, line numbers."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.config import source
from canshaper.config.source import Source
from canshaper.errors import ConfigError

Problems = Callable[[str | bytes], list[str]]


def data(file: Path, text: str) -> object:
    file.write_text(text, encoding="utf-8")
    return Source(file).data


def fault(file: Path, text: str | bytes) -> str:
    """The one problem of a text, after the name of the file."""
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return unreadable(file)


def unreadable(path: Path) -> str:
    with pytest.raises(ConfigError) as caught:
        Source(path)
    (problem,) = caught.value.problems
    return str(problem).removeprefix(str(path))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: [1, 2\nb: 3\n", ":2: not YAML: expected ',' or ']'"),
        ("a: 'open\n", ":2: not YAML: found unexpected end of stream"),
        ("a:\n\t- b\n", ":2: not YAML: found character"),
        ("a: 1\n---\nb: 2\n", ":2: not YAML: but found another document"),
        ("a: *nobody\n", ":1: not YAML: found undefined alias 'nobody'"),
        ("a: \0\n", ":1: not YAML: unacceptable character #x0000"),
        ("a: 1\r\nb: 1\n\n\3\n", ":4: not YAML: unacceptable character #x0003"),
        (b"a: \xff\xfe\n", ":1: not YAML: 'utf-8' codec can't decode byte 0xff in position 3"),
        (bytes(range(256)), ":2: not YAML: 'utf-8' codec can't decode"),
        (b"a: 1\r\n\n\xff", ":3: not YAML: 'utf-8' codec can't decode byte 0xff in position 7"),
        ('a: "\\UFFFFFFFF"\n', ": not YAML: "),
        ("[" * 3000, ":1: not YAML: nested too deeply"),
        ("- " * 3000, ":1: not YAML: nested too deeply"),
        ("a: &a [*a]\n", ":1: not YAML: the anchor a contains itself"),
        ("a: &a {b: *a}\n", ":1: not YAML: the anchor a contains itself"),
        ("a: 1\nb: &b\n  c: 2\n  d:\n    - *b\n", ":5: not YAML: the anchor b contains itself"),
    ],
)
def test_what_is_no_yaml_is_one_problem(file: Path, text: str | bytes, says: str) -> None:
    assert fault(file, text).startswith(says)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (r"""a: ["b\0c"]""", ":1: a.0: expected text without control characters, got 'b\\x00c'"),
        ("a:\n  b: |\n    c\n", ":2: a.b: expected text without control characters, got 'c\\n'"),
        (r"""a: "\x7f" """, ":1: a: expected text without control characters, got '\\x7f'"),
        (r"""a: "\ud800" """, ":1: a: expected text without control characters, got '\\ud800'"),
        (r"""a: { "b\0": 1 }""", ":1: a: expected a word as key, got 'b\\x00'"),
    ],
)
def test_control_characters_are_refused(file: Path, text: str, says: str) -> None:
    assert fault(file, text) == says


def test_other_characters_are_text(file: Path) -> None:
    text = 'a: "größe\u00a0\u3000.dbc"'
    assert data(file, text) == {"a": "größe\u00a0\u3000.dbc"}


def test_anchors_within_anchors_do_not_fill_the_memory(file: Path) -> None:
    rows = ["a0: &a0 [x, x, x, x]"]
    rows += [f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}, *a{i - 1}, *a{i - 1}]" for i in range(1, 30)]
    assert "not YAML: too large" in fault(file, "\n".join(rows))


def test_anchor_is_the_same_data_again(file: Path) -> None:
    assert data(file, "a: &x {b: 1}\nc: *x\n") == {"a": {"b": 1}, "c": {"b": 1}}


def test_missing_file_and_directory_and_unusable_name(tmp_path: Path) -> None:
    assert unreadable(tmp_path / "none.yaml") == ": No such file or directory"
    assert unreadable(tmp_path) == ": Is a directory"
    assert "File name too long" in unreadable(tmp_path / ("n" * 300))
    assert re.search("embedded null (byte|character)", unreadable(tmp_path / "a\0b"))


def test_file_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_args: object, **_options: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(source.os, "open", refuse)
    assert unreadable(tmp_path / "a.yaml") == ": Permission denied"


@pytest.mark.parametrize(
    ("text", "tag", "where"),
    [
        (
            "a: !!python/object/apply:os.system ['touch {0}']",
            "!!python/object/apply:os.system",
            "a",
        ),
        ("a: !!python/object/new:os.system ['touch {0}']", "!!python/object/new:os.system", "a"),
        ("a: !!python/object:os.system {}", "!!python/object:os.system", "a"),
        ("a: !!python/tuple [1]", "!!python/tuple", "a"),
        ("a:\n  b: !!python/name:os.system x", "!!python/name:os.system", "a.b"),
        ("a: !!set {b, c}", "!!set", "a"),
        ("a: !!omap [b: 1]", "!!omap", "a"),
        ("a: !!binary aGVsbG8=", "!!binary", "a"),
        ("a: !mine 3", "!mine", "a"),
        ("a: =", "!!value", "a"),
    ],
)
def test_tags_are_refused_and_run_nothing(file: Path, text: str, tag: str, where: str) -> None:
    made = file.with_name("made-by-a-tag")
    problem = fault(file, text.replace("{0}", str(made)))
    line = text.count("\n") + 1
    assert problem == f":{line}: {where}: expected no tag, got {tag}"
    assert not made.exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1: 2", ":1: expected a word as key, got '1'"),
        ("~: 2", ":1: expected a word as key, got '~'"),
        ("a:\n  true: 2", ":2: a: expected a word as key, got 'true'"),
        ("? [a, b]\n: 2", ":1: expected a word as key, got a sequence"),
        ("? {a: b}\n: 2", ":1: expected a word as key, got a mapping"),
        ("a: &a {b: 1}\nc:\n  <<: *a", ":3: c: expected a word as key, got '<<'"),
        ("? !!python/name:os.system x\n: 2", ":1: expected a word as key, got 'x'"),
    ],
)
def test_keys_are_words(file: Path, text: str, says: str) -> None:
    assert fault(file, text) == says


def test_every_double_key_is_reported_with_its_first_line(problems: Problems) -> None:
    text = "a:\n  b: 1\n  c: 2\n  b: 3\nd: 4\na: 5\nd: 6\n"
    assert problems(text) == [
        "machine.yaml:4: a.b: key stands twice, first in line 2",
        "machine.yaml:6: a: key stands twice, first in line 1",
        "machine.yaml:7: d: key stands twice, first in line 5",
    ]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("off", "off"),
        ("on", "on"),
        ("no", "no"),
        ("true", True),
        ("False", False),
        ("~", None),
        ("", None),
        ("20", 20),
        ("-3", -3),
        ("010", 10.0),  # a float: no whole number is taken for the octal 8
        ("0x10", 16),
        ("0xFf", 255),
        ("0x", "0x"),
        ("-0x10", "-0x10"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("1.5", 1.5),
        (".5", 0.5),
        ("1e3", 1000.0),
        ("1e+06", 1e6),
        ("-2.5E-3", -0.0025),
        ("1e999", float("inf")),
        ("-.inf", float("-inf")),
        ("9" * 5000, float("inf")),
        ("2020-13-45", "2020-13-45"),
        ("'20'", "20"),
        ('"off"', "off"),
        ("!!int ''", ""),
        ("!!timestamp x", "x"),
        ("1:" * 200 + "1.0", "1:" * 200 + "1.0"),
    ],
)
def test_scalars_are_those_of_yaml_1_2(file: Path, text: str, value: object) -> None:
    read = data(file, f"a: {text}\n")
    assert read == {"a": value}
    assert isinstance(read, dict)
    assert type(read["a"]) is type(value)


def test_not_a_number_is_read_as_such(file: Path) -> None:
    read = data(file, "a: .nan\n")
    assert isinstance(read, dict)
    assert read["a"] != read["a"]


def test_empty_file_has_no_data(file: Path) -> None:
    assert data(file, "") == {}
    assert data(file, "# only a comment\n") == {}


def test_problem_names_the_nearest_line_that_exists(file: Path) -> None:
    file.write_text("a:\n  b:\n    - c: 1\n", encoding="utf-8")
    source = Source(file)
    assert str(source.problem(("a", "b", 0, "c"), "x")) == f"{file}:3: a.b.0.c: x"
    assert str(source.problem(("a", "b", 0, "d", "e"), "x")) == f"{file}:3: a.b.0.d.e: x"
    assert str(source.problem(("a", "z"), "x")) == f"{file}:1: a.z: x"
    assert str(source.problem(("z",), "x")) == f"{file}:1: z: x"
