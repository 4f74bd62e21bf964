"""Every kind of bad deployment file: one clear problem each, with its line, all of them at once."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.config.load import load_config
from canshaper.config.schema import AxisConfig, DeploymentConfig
from canshaper.errors import ConfigError

Load = Callable[[str | bytes], DeploymentConfig]
Problems = Callable[[str | bytes], list[str]]

TOP = (
    "version, tick_ms, tick, buses, dbc, joysticks, switches, axes, motion, gateway,"
    " emergency_stop, load_state, profile, status, identity, control, uncertainty, accept"
)
AXIS = ", ".join(AxisConfig.model_fields)
SWAY = (
    "expected length_m, damping_nms and mass_kg, or period_s and damping_ratio, or period_s"
    " and decay_per_swing"
)


def changed(text: str, old: str, new: str) -> tuple[str, int]:
    """The text with the first ``old`` replaced, and the line of that."""
    assert old in text
    return text.replace(old, new, 1), text[: text.index(old)].count("\n") + 1


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        # unknown keys, wherever they stand, with those allowed there
        ("tick_ms", "ticks", f"ticks: expected one of the keys {TOP}"),
        (
            "channel: vcan0",
            "channel: a, speed: 1",
            "buses.crane.speed: expected one of the keys interface, channel, bitrate",
        ),
        (
            "enable: Enable",
            "enable: Enable\n    on: X",
            "joysticks.left.on: expected one of the keys bus, message, alive_counter, checksum,"
            " e2e, cycle_ms, multiplexor, source, timeout_ms, alive_max_step, qualify, enable,"
            " enable_of, reset, anti_sway_off, next_profile, node, stuck_s",
        ),
        (
            "{ joystick: left,",
            "{ joystick: left, deadzone: 1,",
            "axes.slew.command.deadzone: expected one of the keys full, zero, invert, joystick,"
            " signal, flags, negative, neutral_pct",
        ),
        (
            "kind: gff,",
            "kind: gff, a3: 1,",
            "axes.slew.filter.a3: expected one of the keys kind, a1, a2, poles_rad_s",
        ),
        ("kind: off", "kind: off, a1: 1", "axes.lift.filter.a1: expected one of the keys kind"),
        # missing keys, with what they mean
        ("interface: socketcan, ", "", "buses.crane.interface: missing: python-can interface"),
        ("joystick: left, ", "", "axes.slew.command.joystick: missing: name of a joystick"),
        (", full_speed_m_s: 1.5", "", "axes.slew.sway.full_speed_m_s: missing: speed of the tip"),
        # numbers
        ("tick_ms: 20", "tick_ms: 0", "expected a whole number, 1 to 50 ms, got 0"),
        ("tick_ms: 20", "tick_ms: 51", "expected a whole number, 1 to 50 ms, got 51"),
        ("tick_ms: 20", "tick_ms: 20.0", "expected a whole number, 1 to 50 ms, got 20.0"),
        ("tick_ms: 20", "tick_ms: '20'", "expected a whole number, 1 to 50 ms, got '20'"),
        ("tick_ms: 20", "tick_ms: true", "expected a whole number, 1 to 50 ms, got True"),
        ("tick_ms: 20", "tick_ms: 024", "expected a whole number, 1 to 50 ms, got 24.0"),
        ("tick_ms: 20", "tick_ms:", "expected a whole number, 1 to 50 ms, got nothing"),
        (
            "timeout_ms: 100",
            "timeout_ms: 1:40",
            "expected a whole number, 10 to 1000 ms, got '1:40'",
        ),
        ("rise_per_s: 5", "rise_per_s: .nan", "expected 0.2 to 100 full speeds per s, got nan"),
        ("rise_per_s: 5", "rise_per_s: .inf", "expected 0.2 to 100 full speeds per s, got inf"),
        ("rise_per_s: 5", "rise_per_s: -1e999", "expected 0.2 to 100 full speeds per s, got -inf"),
        ("rise_per_s: 5", "rise_per_s: [5]", "expected 0.2 to 100 full speeds per s, got [5]"),
        (
            "rise_per_s: 5",
            "rise_per_s: {a: 5}",
            "expected 0.2 to 100 full speeds per s, got {'a': 5}",
        ),
        (
            "neutral_pct: 2",
            "neutral_pct: 20.1",
            "expected 0.1 to 20 % of full deflection, got 20.1",
        ),
        (
            "period_s: 2.356",
            "period_s: 0.1",
            "axes.slew.sway.period_s: expected 0.15 to 12 s, got 0.1",
        ),
        ("damping_nms: 120", "damping_nms: -1", "expected 0 to 1e+06 N m s/rad, got -1"),
        # other types
        (
            "channel: vcan0",
            "channel: 0",
            "expected text (in quotes where it looks like a number), got 0",
        ),
        ("tail_s: 2.0", "allow_reverse: 1", "expected true or false, got 1"),
        ("tail_s: 2.0", "allow_faster: yes", "expected true or false, got 'yes'"),
        ("[../dbc/forwarder.dbc]", "a.dbc", "dbc: expected a list, got 'a.dbc'"),
        ("[../dbc/forwarder.dbc]", "[]", "dbc: expected 1 or more entries, got []"),
        (
            "[../dbc/forwarder.dbc]",
            "[3]",
            "dbc.0: expected text (in quotes where it looks like a number), got 3",
        ),
        (
            "{ interface: socketcan, channel: vcan0, bitrate: 250000 }",
            "vcan0",
            "buses.crane: expected a section with the keys interface, channel, bitrate, fd,"
            " data_bitrate, options, match, network, j1939, canopen, got 'vcan0'",
        ),
        (
            "{ kind: off }",
            "off",
            "expected a section of the kind 'off', 'gff', 'first_order', 's_curve', 'zv', 'zvd',"
            " 'ei', 'two_mode', 'robust', got 'off'",
        ),
        # filters
        (
            "kind: off",
            "kind: on",
            "axes.lift.filter.kind: expected one of 'off', 'gff', 'first_order', 's_curve', 'zv',"
            " 'zvd', 'ei', 'two_mode', 'robust', got 'on'",
        ),
        (
            "kind: off",
            "",
            "axes.lift.filter.kind: expected one of 'off', 'gff', 'first_order', 's_curve', 'zv',"
            " 'zvd', 'ei', 'two_mode', 'robust', got nothing",
        ),
        (
            "kind: off",
            "kind: true",
            "expected one of 'off', 'gff', 'first_order', 's_curve', 'zv', 'zvd', 'ei',"
            " 'two_mode', 'robust', got True",
        ),
        ("a1: 0.708, a2: 0.12", "", "filter: expected a1 and a2, or poles_rad_s, got neither"),
        (", a2: 0.12", "", "axes.slew.filter: expected a1 and a2, or poles_rad_s, got a1"),
        ("a1: 0.708", "a1: null", "axes.slew.filter: expected a1 and a2, or poles_rad_s, got a2"),
        (
            "a2: 0.12",
            "a2: 0.12, poles_rad_s: [-3, -4]",
            "axes.slew.filter: expected a1 and a2, or poles_rad_s, got a1, a2, poles_rad_s",
        ),
        (
            "a1: 0.708",
            "a1: 0.6",
            "a1: expected 0.69282 or more for a2 = 0.12 (real poles, a1^2 >= 4 a2), got 0.6",
        ),
        ("a1: 0.708, a2: 0.12", "poles_rad_s: [-3]", "expected 2 or more entries, got [-3]"),
        (
            "a1: 0.708, a2: 0.12",
            "poles_rad_s: [-3, -4, -5]",
            "expected 2 entries at most, got [-3, -4, -5]",
        ),
        (
            "a1: 0.708, a2: 0.12",
            "poles_rad_s: [-3, 4]",
            "axes.slew.filter.poles_rad_s.1: expected -100 to -0.1 rad/s, got 4",
        ),
        # sway data
        ("period_s: 2.356, damping_ratio: 0.038, ", "", f"sway: {SWAY}, got no sway data"),
        ("damping_ratio: 0.038, ", "", f"axes.slew.sway: {SWAY}, got period_s"),
        ("mass_kg: 300, ", "", f"axes.near_far.sway: {SWAY}, got damping_nms, length_m"),
        ("mass_kg: 300", "period_s: 2", f"{SWAY}, got damping_nms, length_m, period_s"),
        ("mass_kg: 300", "mass_kg: ~", f"axes.near_far.sway: {SWAY}, got damping_nms, length_m"),
        (
            "damping_ratio: 0.038",
            "damping_ratio: 0.038, decay_per_swing: 0.2",
            f"{SWAY}, got damping_ratio, decay_per_swing, period_s",
        ),
        (
            "damping_nms: 120",
            "damping_nms: 100000",
            "axes.near_far.sway: damping ratio: expected 0 to 0.95, got ",
        ),
        # what does not go together
        (
            "rise_per_s: 5",
            "min_pct: 30, max_pct: 30",
            "min_pct: expected less than max_pct, got 30",
        ),
        (
            "    sway: { period",
            "    # { period",
            "axes.slew: expected sway data for filter gff, got none",
        ),
    ],
)
def test_one_fault_is_one_problem_with_its_line(
    shipped: str, problems: Problems, old: str, new: str, says: str
) -> None:
    text, line = changed(shipped, old, new)
    (problem,) = problems(text)
    assert says in problem
    reported = re.match(r"machine\.yaml:(\d+): ", problem)
    assert reported, problem
    # a problem of a whole axis stands at its name, that of an added line one below
    name = shipped.splitlines().index("  slew:") + 1
    assert int(reported[1]) in (
        (name,) if "sway data for" in says else (line, line + new.count("\n"))
    )


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
        " full, zero, invert, joystick, signal, flags, negative, neutral_pct, got an unknown one;"
        " did you mean joystick?",
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


@pytest.mark.parametrize("text", ["", "# nothing\n", "{}\n"])
def test_empty_file_lacks_everything(problems: Problems, text: str) -> None:
    keys = [re.sub(r"^machine\.yaml(:1)?: ", "", p).split(": ", 1) for p in problems(text)]
    assert [k for k, _ in keys] == ["axes", "buses", "dbc", "joysticks", "version"]
    assert all(text.startswith("missing: ") for _, text in keys)


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


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(tmp_path / "none.yaml")
    assert str(caught.value) == f"{tmp_path / 'none.yaml'}: No such file or directory"


def test_off_needs_no_quotes(shipped: str, load: Load) -> None:
    for word in ("off", "'off'", '"off"', "false", "False", "FALSE"):  # as tools of YAML 1.1 write
        config = load(shipped.replace("kind: off", f"kind: {word}"))
        assert config.axes["lift"].filter.kind == "off"


@pytest.mark.parametrize("word", ["true", "'false'", "no", "0", "null"])
def test_nothing_else_is_off(shipped: str, problems: Problems, word: str) -> None:
    (problem,) = problems(shipped.replace("kind: off", f"kind: {word}"))
    assert "axes.lift.filter.kind: expected one of 'off', 'gff', " in problem
    assert ", got " in problem


def test_numbers_with_an_exponent_are_numbers(shipped: str, load: Load) -> None:
    sway = load(shipped.replace("damping_nms: 120", "damping_nms: 1.2e2")).axes["near_far"].sway
    assert sway
    assert sway.damping_nms == 120.0


def test_the_shipped_file_is_read_as_it_stands(shipped: str, load: Load) -> None:
    config = load(shipped)
    assert config.tick_ms == 20
    assert list(config.axes) == ["slew", "near_far", "lift"]
    slew = config.axes["slew"]
    assert slew.filter.model_dump(exclude_none=True) == {"kind": "gff", "a1": 0.708, "a2": 0.12}
    assert (slew.limits.deadband_pct, slew.limits.rise_per_s) == (5, 5)
    assert slew.sway
    assert slew.sway.mode().damping_ratio == 0.038


@pytest.mark.parametrize("text", ["", "# only a comment\n", "\n\n"])
def test_an_empty_file_is_wrong_in_its_first_line(problems: Problems, text: str) -> None:
    said = problems(text)
    assert said[0].split(":")[:3][1:] == ["1", " axes"], said
    assert all(": missing: " in one for one in said)
