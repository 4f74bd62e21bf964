"""Every filter of a deployment file: it loads, it builds, and what is wrong is said in one line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.config.schema import DeploymentConfig
from canshaper.errors import ConfigError
from canshaper.shaping.registry import KINDS, build_shaper
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.sway import SwayMode, SwayModel
from tests.rigs.files import Machine
from tests.rigs.residual import residual_left

Load = Callable[[str], DeploymentConfig]
Problems = Callable[[str], list[str]]

SLEW = "filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
LIFT = "filter: { kind: off }"
TICK_S = 0.02

MODE = SwayMode.from_period(2.356, 0.038)  # of the slew axis

# Every kind as the registry declares it, and what a person may write otherwise.
GOOD: list[tuple[str, dict[str, Any]]] = [
    *(
        (f"kind: {kind.name}" + "".join(f", {key}: {json.dumps(row[key])}" for key in row), row)
        for kind in KINDS.values()
        for row in kind.settings(MODE, TICK_S).values()
    ),
    ("kind: gff, poles_rad_s: [-5, -3.5]", {"poles_rad_s": [-5.0, -3.5]}),
    (
        "kind: gff, a1: 0.42, a2: 0.043, third_pole_rad_s: -6.5",
        {"a1": 0.42, "a2": 0.043, "third_pole_rad_s": -6.5},
    ),
    ("kind: s_curve, rate_per_s: 1, jerk_per_s2: 7", {"rate_per_s": 1.0, "jerk_per_s2": 7.0}),
    ("kind: ei", {"residual_pct": 5.0}),
    ("kind: ei, residual_pct: 2", {"residual_pct": 2.0}),
    ("kind: two_mode, period_s: 0.9, damping_ratio: 0", {"period_s": 0.9, "damping_ratio": 0.0}),
    (
        "kind: robust, tick_ms: 20, taps: [0.5, 0.25, 0.25]",
        {"tick_ms": 20, "taps": [0.5, 0.25, 0.25]},
    ),
]
good = pytest.mark.parametrize(("text", "parameters"), GOOD, ids=[g[0][:60] for g in GOOD])


def slew_with(shipped: str, text: str) -> str:
    assert SLEW in shipped
    return shipped.replace(SLEW, f"filter: {{ {text} }}\n")


@good
def test_it_loads_with_its_parameters_and_builds(
    load: Load, shipped: str, text: str, parameters: dict[str, Any]
) -> None:
    axis = load(slew_with(shipped, text)).axes["slew"]
    assert axis.filter.parameters() == parameters
    assert axis.sway is not None
    sway = SwayModel(axis.sway.mode(), TICK_S)
    shaper = build_shaper(axis.filter.kind, TICK_S, sway, **axis.filter.parameters())
    if axis.filter.kind == "ei":
        assert isinstance(shaper, Fir)
        left = residual_left(shaper.taps, SwayMode(sway.mode.omega_rad_s, 0.0), TICK_S)
        assert 100.0 * left == pytest.approx(parameters["residual_pct"], abs=1.5)
    for _ in range(2000):  # gain one, whatever the kind
        sway.step(output := shaper.step(0.6))
    assert output == pytest.approx(0.6, abs=1e-6)


@good
def test_the_json_schema_accepts_it(shipped: str, text: str, parameters: dict[str, Any]) -> None:
    schema = json.loads(CliRunner().invoke(app, ["config-schema"]).stdout)
    # PyYAML takes "off" for false; editors, whose YAML is 1.2, do not
    data = yaml.safe_load(slew_with(shipped, text).replace("kind: off", "kind: 'off'"))
    assert [e.message for e in Draft202012Validator(schema).iter_errors(data)] == []


BAD = [
    ("kind: gff, a1: 0.42", "expected a1 and a2, or poles_rad_s, got a1"),
    ("kind: robust, tick_ms: 20, taps: []", "taps: expected 1 or more entries, got []"),
    ("kind: robust, tick_ms: 20, taps: [1.5, -0.5]", "taps.0: expected 0 to 1, got 1.5"),
]


@pytest.mark.parametrize(("text", "says"), BAD, ids=[b[0] for b in BAD])
def test_what_is_wrong_is_named_once_or_for_each_entry(
    problems: Problems, shipped: str, text: str, says: str
) -> None:
    line = shipped[: shipped.index(SLEW)].count("\n") + 1
    reported = problems(slew_with(shipped, text))
    assert says in reported[0]
    for problem in reported:
        assert problem.startswith(f"machine.yaml:{line}: axes.slew.filter")
    # two bad taps are two problems; all else is one
    assert len(reported) == (2 if "-0.5" in text else 1)


def test_too_many_taps_are_one_problem(problems: Problems, shipped: str) -> None:
    taps = ", ".join(["0.0009990009990009990"] * 1001)
    (problem,) = problems(slew_with(shipped, f"kind: robust, tick_ms: 20, taps: [{taps}]"))
    assert "taps: expected 1000 entries at most, got [0.000" in problem


# -- against the valve's period: canshaper check ---------------------------------------------------


def checked(directory: Path, text: str, *, sway: str = "") -> list[str]:
    """Problems of a machine whose slew valve is sent every 40 ms."""
    machine, problems = Machine(directory), list[str]()
    machine.yaml = slew_with(machine.yaml, text)
    if sway:
        machine.in_yaml("period_s: 2.356, damping_ratio: 0.038", sway)
    cycle = 'BA_ "GenMsgCycleTime" BO_ 512 {};'
    machine.in_dbc(cycle.format(20), cycle.format(40))
    try:
        machine.load()
    except ConfigError as error:
        problems = [str(p).removeprefix(f"{directory}/") for p in error.problems]
    result = CliRunner().invoke(app, ["check", str(directory / "machine.yaml")])
    assert not isinstance(result.exception, Exception)
    assert result.exit_code == (2 if problems else 0)
    return problems


QUICK = "period_s: 0.31416, damping_ratio: 0"  # 20 rad/s


@pytest.mark.parametrize(
    ("text", "sway", "says"),
    [
        ("kind: zv", "period_s: 0.2, damping_ratio: 0", "natural frequency at a tick of 0.04 s"),
        (
            "kind: gff, poles_rad_s: [-4, -4], third_pole_rad_s: -26",
            "",
            "pole: expected -25 to below 0 rad/s at a tick of 0.04 s, got -26 rad/s",
        ),
    ],
)
def test_a_filter_that_its_valve_cannot_run_is_one_problem(
    tmp_path: Path, text: str, sway: str, says: str
) -> None:
    (problem,) = checked(tmp_path, text, sway=sway)
    assert "axes.slew.filter: " in problem
    assert says in problem


@pytest.mark.parametrize("text", ["kind: zv", "kind: zvd", "kind: ei", "kind: gff, a1: 1, a2: 0.1"])
def test_a_quick_swing_that_the_tick_can_follow_is_good(tmp_path: Path, text: str) -> None:
    assert checked(tmp_path, text, sway=QUICK) == []
