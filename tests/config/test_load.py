"""Deployment files as a whole: all problems at once, in the order of the file."""

from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.errors import did_you_mean, there_are
from tests.config.sections import TOP, Problems, changed
from tests.rigs.files import faults, machine_file

Load = Callable[[str | bytes], DeploymentConfig]
AXIS = ", ".join(AxisSection.model_fields)


@pytest.mark.parametrize("name", ["slew", "command", "limits", "buses", "kind", "0"])
def test_keys_allowed_do_not_depend_on_the_name_of_the_axis(
    shipped: str, problems: Problems, name: str
) -> None:
    axis = f"'{name}'" if name == "0" else name
    text = shipped.replace("  slew:\n", f"  {axis}:\n    stik: 1\n", 1)
    text = text.replace("{ joystick: left, signal: Slew,", "{ joistick: left, signal: Slew,", 1)
    line = shipped.splitlines().index("  slew:") + 2
    assert problems(text) == [
        f"machine.yaml:{line}: axes.{name}.stik: expected one of the keys {AXIS}, got an unknown"
        " one",
        f"machine.yaml:{line + 1}: axes.{name}.command.joistick: expected one of the keys"
        " full, zero, invert, codes, joystick, signal, flags, negative, neutral_pct, got an unknown"
        " one; did you mean joystick?",
        f"machine.yaml:{line + 1}: axes.{name}.command.joystick: missing: name of a joystick",
    ]


def test_all_problems_are_reported_at_once_in_the_order_of_the_file(
    shipped: str, problems: Problems
) -> None:
    text = shipped
    for old, new in [
        ("tick_ms: 20", "tick_ms: 99"),
        ("timeout_ms: 100", "timeout_ms: soon"),
        ("signal: NearFar,", ""),
        ("kind: off", "kind: magic"),
        ("status: { bus: crane, message: ShaperStatus }", "staus: 1"),
    ]:
        text, _ = changed(text, old, new)
    reported = problems(text)
    assert [p.split(": ")[1] for p in reported] == [
        "tick_ms",
        "joysticks.left.timeout_ms",
        "axes.near_far.command.signal",
        "axes.lift.filter.kind",
        "staus",
    ]
    lines = [int(p.split(":")[1]) for p in reported]
    assert lines == sorted(lines)


@pytest.mark.parametrize(
    ("text", "shown"),
    [("- a\n", "['a']"), ("~\n", "nothing"), ("3\n", "3"), ("hello\n", "'hello'")],
)
def test_a_file_that_is_no_mapping(problems: Problems, text: str, shown: str) -> None:
    says = f"machine.yaml:1: expected a section with the keys {TOP}, got {shown}"
    assert problems(text) == [says]


def test_long_findings_are_cut(shipped: str, problems: Problems) -> None:
    (problem,) = problems(shipped.replace("tick_ms: 20", f"tick_ms: {'x' * 500}"))
    assert len(problem) < 160
    assert "'xxx" in problem


def test_off_needs_no_quotes(shipped: str, load: Load) -> None:
    for word in ("off", "'off'", '"off"', "false", "False", "FALSE"):  # as tools of YAML 1.1 write
        config = load(shipped.replace("kind: off", f"kind: {word}"))
        assert config.axes["lift"].filter.kind == "off"


@pytest.mark.parametrize("text", ["", "# only a comment\n", "\n\n", "{}\n"])
def test_an_empty_file_is_wrong_in_its_first_line(problems: Problems, text: str) -> None:
    said = problems(text)
    assert said[0].split(":")[:3][1:] == ["1", " axes"], said
    keys = [one.rpartition(": missing: ")[0].split(": ")[-1] for one in said]
    assert keys == ["axes", "buses", "dbc", "joysticks", "version"]


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("joistick", "; did you mean joystick?"),
        ("JoystickLEFT", "; did you mean JoystickLeft?"),
        ("Left", ""),
        ("", ""),
    ],
)
def test_a_name_like_it_is_named(name: str, end: str) -> None:
    assert did_you_mean(name, ("joystick", "JoystickLeft", "NearFarCommand")) == end


def test_of_many_names_only_the_nearest_are_listed() -> None:
    few = [f"Valve{i:02}" for i in range(20)]
    assert there_are("Valve", few) == f"; there are {', '.join(few)}; did you mean Valve19?"
    assert there_are("Valve", []) == "; there are none"
    many = [*few, *(f"Pump{i:03}" for i in range(140)), "JoystickLeft", "JoystickRight"]
    said = there_are("JoystikLeft", many)
    assert said.startswith("; there are 162, such as JoystickLeft, JoystickRight")
    assert said.endswith("; did you mean JoystickLeft?")
    assert len(said) < 120
    nothing_like_it = "; there are 162, such as Valve00, Valve01, Valve02, Valve03, Valve04"
    assert there_are("###", many) == nothing_like_it


@pytest.mark.parametrize(
    ("old", "new", "end"),
    [
        ("timeout_ms: 100 #", "timeoutms: 100 #", "got an unknown one; did you mean timeout_ms?"),
        ("message: JoystickLeft", "message: JoystikLeft", "; did you mean JoystickLeft?"),
        ("signal: NearFar,", "signal: NearFaar,", "; did you mean NearFar?"),
    ],
)
def test_every_kind_of_name_in_a_file(tmp_path: Path, old: str, new: str, end: str) -> None:
    assert any(one.endswith(end) for one in faults(machine_file(tmp_path, "forwarder", (old, new))))
