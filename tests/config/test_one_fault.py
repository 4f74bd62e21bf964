"""Every kind of bad deployment file: one clear problem each, with its line."""

import re

import pytest

from canshaper.shaping.registry import KINDS
from tests.config.sections import TOP, Problems, changed

SWAY = (
    "expected length_m, damping_nms and mass_kg, or period_s and damping_ratio, or period_s"
    " and decay_per_swing, or length_m and damping_ratio"
)


NAMES = ", ".join(map(repr, KINDS))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        # unknown keys, wherever they stand, with those allowed there
        ("tick_ms", "ticks", f"ticks: expected one of the keys {TOP}"),
        (
            "enable: Enable",
            "enable: Enable\n    on: X",
            "joysticks.left.on: expected one of the keys bus, message, alive_counter, checksum,"
            " e2e, cycle_ms, multiplexor, source, timeout_ms, alive_max_step, qualify, enable,"
            " enable_of, reset, anti_sway_off, next_profile, node, stuck_s",
        ),
        # missing keys, with what they mean
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
        # other types
        (
            "channel: vcan0",
            "channel: 0",
            "expected text (in quotes where it looks like a number), got 0",
        ),
        ("tail_s: 2.0", "allow_faster: yes", "expected true or false, got 'yes'"),
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
            " data_bitrate, options, match, unconfirmed, network, j1939, canopen, got 'vcan0'",
        ),
        (
            "{ kind: off }",
            "off",
            f"expected a section of the kind {NAMES}, got 'off'",
        ),
        # filters; more of them in test_filters
        ("kind: off", "kind: on", f"axes.lift.filter.kind: expected one of {NAMES}, got 'on'"),
        ("kind: off", "", f"axes.lift.filter.kind: expected one of {NAMES}, got nothing"),
        ("kind: off", "kind: true", f"axes.lift.filter.kind: expected one of {NAMES}, got True"),
        ("a1: 0.708, a2: 0.12", "poles_rad_s: [-3]", "expected 2 or more entries, got [-3]"),
        (
            "a1: 0.708, a2: 0.12",
            "poles_rad_s: [-3, -4, -5]",
            "expected 2 entries at most, got [-3, -4, -5]",
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
