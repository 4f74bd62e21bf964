"""Keys for which C has no part are refused by name; numbers are exact to the last bit."""

from collections.abc import Callable
from typing import Any

import pytest
from pydantic import BaseModel

from canshaper import Fir
from canshaper.config.crane import Motion, Radius
from canshaper.config.limits import Limits, Sway
from canshaper.config.schema import AxisSection, Bus, Command, DeploymentConfig, Joystick, Valve
from canshaper.errors import ConfigError
from canshaper.native.library import sizes_source, tables_source
from canshaper.native.tables import NOT_EXPORTED, tables
from canshaper.shaping.registry import KINDS
from canshaper.shaping.shapers.kind import Shaper, ShaperKind
from canshaper.shaping.shapers.limit_aware import LimitAware
from tests.native.machines import SHIPPED
from tests.rigs.files import CONFIG, Machine, read

REFUSED = sorted(
    path.name for path in CONFIG.glob("*.yaml") if path.stem not in SHIPPED and path.is_file()
)
# Keys that the tables have, by the pattern of their section; or that no valve frame hangs on.
_READ = {"bus", "message", "timeout_ms", "alive_counter", "alive_max_step", "qualify", "cycle_ms"}
_ABOUT = {"codes", "signal", "full", "zero", "invert"}  # what the bound signal has
_BUS = {"interface", "channel", "bitrate", "fd", "data_bitrate", "options", "match"}
_BUS |= {"unconfirmed", "network"}
_SWAY = {"full_speed_m_s", "length_m", "damping_nms", "mass_kg", "period_s", "damping_ratio"}
_SWAY |= {"decay_per_swing", "origin"}
_LIMITS = {"max_pct", "min_pct", "rise_per_s", "fall_per_s", "deadband_pct", "curve_command_pct"}
_LIMITS |= {"curve_speed_pct", "curve_origin", "tail_s", "stop_s", "stop_distance_m"}
_LIMITS |= {"allow_faster", "allow_reverse", "reversal", "reversal_s"}
HANDLED: dict[Any, tuple[type[BaseModel], set[str]]] = {
    (): (
        DeploymentConfig,
        {"version", "tick_ms", "tick", "buses", "dbc", "joysticks", "axes", "motion", "status"}
        | {"identity", "control", "assumed", "crane", "still_deg", "uncertainty", "accept"},
    ),
    ("buses", "*"): (Bus, _BUS),
    ("joysticks", "*"): (Joystick, {*_READ, "enable", "reset", "anti_sway_off", "stuck_s"}),
    ("axes", "*"): (
        AxisSection,
        {"command", "valve", "feedback", "status", "sway", "slewing", "filter", "limits"},
    ),
    ("axes", "*", "command"): (Command, {*_ABOUT, "joystick", "neutral_pct"}),
    ("axes", "*", "valve"): (Valve, {*_READ, *_ABOUT} - {"codes", "alive_max_step", "qualify"}),
    ("axes", "*", "sway"): (Sway, _SWAY),
    ("axes", "*", "limits"): (Limits, _LIMITS),
    ("motion", "*", "radius"): (Radius, {*_READ, "signal", "codes"}),
}


@pytest.mark.parametrize("pattern", HANDLED)
def test_every_key_of_the_file_is_in_the_tables_or_refused(pattern: Any) -> None:
    """A new key of these sections fails here until someone has decided."""
    model, handled = HANDLED[pattern]
    assert set(model.model_fields) == handled | set(NOT_EXPORTED.get(pattern, ()))


def test_a_motion_has_no_other_key() -> None:
    known = {"slew", "near_far", "radius", "radius_m", "max_pct", "max_path_m", "max_s", "aim"}
    assert set(Motion.model_fields) == known | {"luffing", "luffing_rad_s", "waits"}


def problems(machine: Machine) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        tables(machine.load())
    return [str(one).partition("machine.yaml")[2] for one in caught.value.problems]


@pytest.mark.parametrize("name", REFUSED)
def test_a_shipped_machine_with_more_is_refused_by_its_keys(name: str) -> None:
    with pytest.raises(ConfigError) as caught:
        tables(read(CONFIG / name))
    for problem in caught.value.problems:
        assert problem.line is not None
        assert "in an export" in problem.message


def test_what_is_refused_is_named_with_its_line(machine: Machine) -> None:
    line = machine.in_yaml(
        "    enable: Enable\n", "    enable: Enable\n    checksum: { signal: X, kind: xor }\n"
    )
    machine.in_dbc(
        " SG_ AliveCounter : 56|8@1+",
        ' SG_ X : 48|8@1+ (1,0) [0|255] "" SHAPER\n SG_ AliveCounter : 56|8@1+',
    )
    text = "joysticks.left.checksum: expected none in an export, for which C has no part"
    assert problems(machine) == [f":{line + 1}: {text}"]


def test_a_counter_with_more_values_than_c_counts_is_refused(machine: Machine) -> None:
    """A count of 2^32 values would become 0: none of its frames would be checked."""
    machine.in_dbc(" SG_ AliveCounter : 56|8@1+", " SG_ AliveCounter : 38|26@1+")
    text = "expected a whole signal of up to 24 bits in an export, got AliveCounter"
    assert problems(machine)[0].endswith(text)


class Other(Fir):
    pass


@pytest.mark.parametrize(
    "build", [lambda _: Other([1.0]), lambda sway: LimitAware(sway, Other([1.0]))]
)
def test_a_filter_of_another_class_is_refused(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, build: Callable[[Any], Shaper]
) -> None:
    kind = ShaperKind(
        "zv", "Another.", build, lambda *_: {"other": {}}, needs_sway=True, runs_ahead=False
    )
    monkeypatch.setitem(KINDS, "zv", kind)
    machine.in_yaml("filter: { kind: gff, a1: 0.708, a2: 0.12 }", "filter: { kind: zv }")
    (text,) = problems(machine)
    assert text.endswith("axes.slew.filter.kind: expected a filter that C has, got zv")


def test_the_numbers_are_exact() -> None:
    found = tables(read(CONFIG / "forwarder-robust.yaml"))
    source = tables_source(found)
    first, second, *_ = found["axis"][0]["runs"]
    assert (first["end"], second["end"], len(found["axis"][0]["runs"])) == (2, 3, 9)
    assert f"{{.end = 2, .tap = R({first['tap'].hex()})}},\n    {{.end = 3, .tap = R(" in source
    assert ".run_on = HUGE_VAL" in source  # of lift, which no distance bounds
    assert "#define CS_TAPS 91\n#define CS_WINDOW 111\n" in sizes_source(found)


def test_the_sign_of_a_zero_is_kept() -> None:
    numbers = tables(read(CONFIG / "forwarder.yaml"))
    numbers["axis"][0]["deadband"] = -0.0
    assert ".deadband = R(-0x0.0p+0)" in tables_source(numbers)


def test_no_line_of_the_source_is_code() -> None:
    source = tables_source(tables(read(CONFIG / "forwarder-joints.yaml")))
    for line in source.splitlines():
        starts = ("const cs_config ", "#", "/*", "    {")
        assert not line or line.startswith(starts), line
