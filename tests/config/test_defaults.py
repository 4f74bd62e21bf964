"""Defaults of a minimal deployment, sway data, and files made of noise."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from canshaper.config.load import load_config
from canshaper.config.schema import DeploymentConfig
from canshaper.errors import ConfigError
from canshaper.shaping.limits import OutputLimits

Load = Callable[[str | bytes], DeploymentConfig]

SMALLEST = """
version: 1
buses: {b: {interface: virtual, channel: c}}
dbc: [a.dbc]
joysticks: {l: {bus: b, message: L, timeout_ms: 100, enable: E}}
axes:
  x:
    command: {joystick: l, signal: S}
    valve: {bus: b, message: V, signal: S, timeout_ms: 200}
    filter: {kind: off}
"""

NEW = [
    "",
    "x",
    "1e999",
    ".nan",
    "[",
    "}",
    "&a ",
    "*a",
    "!!python/name:os.system ",
    "off",
    "\n",
    "  ",
]
NEW += [": ", "- ", "~", "'", '"', "-1", "true", "2020-01-01", "!!int ''", "\ttick_ms: 1\n", "#"]

noise = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300, deadline=None
)


def test_defaults_are_the_cautious_ones(load: Load) -> None:
    config = load(SMALLEST)
    axis, joystick = config.axes["x"], config.joysticks["l"]
    assert config.tick_ms == 20
    assert config.status is None
    assert config.buses["b"].bitrate is None
    assert (joystick.reset, joystick.anti_sway_off, joystick.alive_counter) == (None, None, None)
    assert (axis.status, axis.sway, axis.valve.alive_counter) == (None, None, None)
    assert axis.command.neutral_pct == 2.0
    assert axis.limits.stop_s == 2.0
    assert axis.limits.output_limits() == OutputLimits()
    assert not axis.limits.allow_faster
    assert not axis.limits.allow_reverse


def test_a_configuration_cannot_be_changed(load: Load) -> None:
    config = load(SMALLEST)
    with pytest.raises(ValidationError, match="frozen"):
        config.axes["x"].limits.allow_reverse = True  # type: ignore[misc]


def test_percentages_become_fractions(load: Load) -> None:
    text = (
        SMALLEST + "    limits: {max_pct: 80, min_pct: 3, deadband_pct: 12, allow_faster: true}\n"
    )
    limits = load(text).axes["x"].limits.output_limits()
    assert limits == OutputLimits(maximum=0.8, minimum=0.03, deadband=0.12, allow_faster=True)


@pytest.mark.parametrize(
    ("data", "period_s", "damping_ratio"),
    [
        ("length_m: 1.0, damping_nms: 0, mass_kg: 300", 2 * math.pi / math.sqrt(9.81), 0.0),
        ("period_s: 2.5, damping_ratio: 0.1", 2.5, 0.1),
        # half of the amplitude lost over a swing: zeta = d / sqrt(4 pi^2 + d^2), d = ln 2
        (
            "period_s: 2.5, decay_per_swing: 0.5",
            2.5,
            math.log(2) / math.hypot(2 * math.pi, math.log(2)),
        ),
    ],
)
def test_sway_data_can_be_given_in_three_ways(
    load: Load, data: str, period_s: float, damping_ratio: float
) -> None:
    sway = load(SMALLEST + f"    sway: {{full_speed_m_s: 1, {data}}}\n").axes["x"].sway
    assert sway
    assert sway.mode().period_s == pytest.approx(period_s)
    assert sway.mode().damping_ratio == pytest.approx(damping_ratio)


@pytest.mark.parametrize("parameters", [{"a1": 0.7, "a2": 0.1}, {"poles_rad_s": [-5, -2.0]}])
def test_gff_is_given_by_denominator_or_poles(load: Load, parameters: dict[str, Any]) -> None:
    sway = "    sway: {full_speed_m_s: 1, period_s: 2, damping_ratio: 0}\n"
    given = ", ".join(f"{k}: {v}" for k, v in parameters.items())
    text = SMALLEST.replace("{kind: off}\n", f"{{kind: gff, {given}}}\n") + sway
    shaper = load(text).axes["x"].filter
    assert shaper.model_dump(exclude_none=True) == {"kind": "gff", **parameters}


def loads_or_says_why(file: Path, content: bytes) -> None:
    file.write_bytes(content)
    try:
        config, _ = load_config(file)
    except ConfigError as error:
        assert error.problems
        assert all(p.message and p.file == str(file) for p in error.problems)
    else:
        assert isinstance(config, DeploymentConfig)


@noise
@given(content=st.binary(max_size=200))
def test_any_bytes_load_or_say_why(file: Path, content: bytes) -> None:
    loads_or_says_why(file, content)


@noise
@given(text=st.text(alphabet="ab:-,[]{}&*!<>?|'\"#%@`~\n .0159eE+xfn\\tU", max_size=120))
def test_any_text_of_yaml_signs_loads_or_says_why(file: Path, text: str) -> None:
    loads_or_says_why(file, text.encode())


@pytest.mark.slow
@noise
@given(
    cuts=st.lists(
        st.tuples(st.integers(0, 2600), st.integers(0, 40), st.sampled_from(NEW)),
        min_size=1,
        max_size=4,
    )
)
def test_any_change_of_the_shipped_file_loads_or_says_why(
    file: Path, shipped: str, cuts: list[tuple[int, int, str]]
) -> None:
    text = shipped
    for at, length, new in cuts:
        text = text[:at] + new + text[at + length :]
    loads_or_says_why(file, text.encode())


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=5,
)


@pytest.mark.slow
@noise
@given(data=st.data(), value=values)
def test_any_value_in_any_place_loads_or_says_why(
    file: Path, shipped: str, data: st.DataObject, value: object
) -> None:
    import yaml

    tree = yaml.safe_load(shipped.replace("kind: off", "kind: 'off'"))
    place = tree
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        below = place[key]
        if not isinstance(below, dict | list) or not below or data.draw(st.booleans()):
            place[key] = value
            break
        place = below
    loads_or_says_why(file, yaml.safe_dump(tree, allow_unicode=False).encode())
