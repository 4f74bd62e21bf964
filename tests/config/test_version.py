"""The version of the file's format: what came before it is reported key by key."""

import re
from pathlib import Path

import pytest

from canshaper.config.load import MOVED, load_config
from canshaper.errors import ConfigError
from tests.config.conftest import Load, Problems

# As machines were described before there was a version, with every key that moved since then.
OLD = """\
tick_ms: 20
buses:
  near: { interface: socketcan, channel: vcan0 }
  far: { interface: socketcan, channel: vcan1 }
dbc: [a.dbc]
levers:
  left:
    bus: near
    message: Left
    timeout_ms: 100
    enable: Enable
    frozen_s: 10
axes:
  slew:
    stick: { lever: left,
             signal: Slew }
    valve: { bus: far, message: Left, signal: Slew, timeout_ms: 200 }
    sway: { period_s: 2.4, damping_ratio: 0.04, full_speed_m_s: 1.5 }
    filter: { kind: zv }
    sets:
      - at: 0
        sway: { period_s: 2.4, damping_ratio: 0.04, full_speed_m_s: 1.5 }
        filter: { kind: zv }
    feels:
      calm:
        filter: { kind: zv }
        sets:
          - sway: { period_s: 2.4, damping_ratio: 0.04, full_speed_m_s: 1.5 }
            at: 0
            filter: { kind: zv }
gateway: { between: [near, far],
           passing: daemon }
grapple: { bus: far, message: Load, signal: Weight, timeout_ms: 500 }
feel: { bus: far, message: Feel, signal: Feel, timeout_ms: 500, codes: { calm: 1 } }
"""
ANSWERS = [
    "machine.yaml:1: version: missing: version of the file's format",
    "machine.yaml:6: levers: moved to joysticks",
    "machine.yaml:12: levers.left.frozen_s: moved to stuck_s",
    "machine.yaml:15: axes.slew.stick: moved to command",
    "machine.yaml:15: axes.slew.stick.lever: moved to joystick",
    "machine.yaml:20: axes.slew.sets: moved to gain_schedule",
    "machine.yaml:21: axes.slew.sets.0.at: moved to breakpoint",
    "machine.yaml:24: axes.slew.feels: moved to profiles",
    "machine.yaml:27: axes.slew.feels.calm.sets: moved to gain_schedule",
    "machine.yaml:29: axes.slew.feels.calm.sets.0.at: moved to breakpoint",
    "machine.yaml:32: gateway.passing: moved to forwarding",
    "machine.yaml:33: grapple: moved to load_state",
    "machine.yaml:34: feel: moved to profile",
]


def renamed(text: str) -> str:
    """Make the changes by hand that the answers ask for."""
    for pattern, name in MOVED.items():
        old = pattern.split(".")[-1].split("|")[0]
        text = re.sub(rf"\b{old}:", f"{name}:", text)
    return text


def test_an_old_file_is_answered_with_every_key_that_moved(problems: Problems) -> None:
    assert problems(OLD) == ANSWERS
    assert len(ANSWERS) == 1 + len(MOVED)


def test_done_as_reported_it_is_a_good_file(load: Load, problems: Problems) -> None:
    assert problems(renamed(OLD)) == ANSWERS[:1]
    config = load(f"version: 1\n{renamed(OLD)}")
    assert config.joysticks["left"].stuck_s == 10
    assert config.axes["slew"].profiles["calm"].gain_schedule[0].breakpoint == 0


def test_half_way_only_what_is_left_is_reported(problems: Problems) -> None:
    text = "version: 1\n" + renamed(OLD).replace("{ joystick: left", "{ lever: left")
    assert problems(text) == ["machine.yaml:16: axes.slew.command.lever: moved to joystick"]


def test_other_faults_of_an_old_file_are_reported_with_the_keys_that_moved(
    problems: Problems,
) -> None:
    text = OLD.replace("timeout_ms: 100", "timeout_ms: soon").replace("lever: left,", "lever: 3,")
    reported = problems(text)
    assert len(reported) == len(ANSWERS) + 2
    assert any(p.startswith("machine.yaml:10: joysticks.left.timeout_ms: ") for p in reported)
    assert any(p.startswith("machine.yaml:15: axes.slew.command.joystick: ") for p in reported)


def test_a_key_with_both_names_is_reported_once(problems: Problems) -> None:
    text = "version: 1\n" + renamed(OLD).replace("tick_ms: 20", "tick_ms: 20\nlevers: {}")
    assert problems(text) == ["machine.yaml:3: levers: moved to joysticks"]


@pytest.mark.parametrize("text", ["version: 2\n", "nonsense: 1\naxes: []\nversion: 2\n"])
def test_of_a_later_version_one_line_is_said(problems: Problems, text: str) -> None:
    (problem,) = problems(text)
    line = text.count("\n")
    says = "expected 1, got 2: the file is for a later release of canshaper"
    assert problem == f"machine.yaml:{line}: version: {says}"


@pytest.mark.parametrize("value", ["0", "-1", "1.0", "'1'", "true", "", "[1]", "one"])
def test_what_is_no_version(problems: Problems, shipped: str, value: str) -> None:
    (problem,) = problems(shipped.replace("version: 1 ", f"version: {value} "))
    line = shipped.splitlines().index("version: 1 # of the file's format") + 1
    assert problem.startswith(f"machine.yaml:{line}: version: ")


@pytest.mark.parametrize("text", ["- levers\n", "levers\n", "levers: 3\naxes: [stick]\n"])
def test_a_file_that_is_something_else(tmp_path: Path, text: str) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError):
        load_config(file)
