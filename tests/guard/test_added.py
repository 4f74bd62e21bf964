"""How far the other axis of a two-axis motion may command an axis."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.faults import shipped
from tests.guard.bench import Bench, limited


def robust() -> Bench:
    return Bench(load_deployment(shipped.CONFIG / "forwarder-robust.yaml"), "near_far")


# Before, joysticks, and the most that may follow. Velocity of n of 125 steps behind 5 % dead band:
# (n / 125 - 0.05) / 0.95. The rise is 0.1 in a tick, and up to 0.25 is added.
CASES = {
    "nothing beyond the command of the own joystick": (38, {"near_far": 0.3, "slew": 1.0}, 41),
    "nothing was added": (25, {"near_far": 1.0}, 38),
    "as fast as may be added": (34, {"slew": 1.0}, 36),
    "by the rates": (10, {"slew": 1.0}, 23),
    "a joystick within the neutral band commands nothing": (
        34,
        {"near_far": 0.01, "slew": 1.0},
        36,
    ),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("sign", [1, -1])
def test_what_may_follow(sign: int, case: str) -> None:
    before, joysticks, most = CASES[case]
    joysticks = {name: sign * value for name, value in joysticks.items()}
    for steps in (most, most + 1):
        bench = robust()
        bench.ramp(sign * before, **joysticks)
        refusal = bench.sends(sign * steps, **joysticks)
        assert bool(refusal) == (steps > most), (steps, refusal)


@pytest.mark.parametrize("sign", [1, -1])
def test_without_a_command_nothing_is_added(sign: int) -> None:
    bench = robust()
    bench.ramp(0)
    assert bench.sends(sign * 10)


def test_what_was_added_gives_the_own_part_no_longer_tail() -> None:
    bench = robust()
    bench.ramp(119, near_far=1.0, slew=1.0)
    refused = [bool(bench.sends(119, slew=1.0)) for _ in range(200)]
    # tail_s, timeout_ms, the longest standstill and three periods
    assert refused.index(True) == (2200 + 100 + 100 + 60) // 20


@pytest.mark.parametrize("axis", ["slew", "near_far"])
def test_each_moves_the_other_as_fast_as_the_file_says(axis: str) -> None:
    other = {"slew": "near_far", "near_far": "slew"}[axis]
    deployment = load_deployment(shipped.CONFIG / "forwarder-robust.yaml")
    free = {"deadband_pct": 0.0, "rise_per_s": 100.0}
    one = Bench(limited(deployment, axis, **free), axis)
    why = one.sends(50, **{other: 1.0})
    assert why == f"axis={axis} limit=asked speed=0.400 allowed=0.254"  # 25 %, half a step


def test_a_motion_of_slew_alone_moves_nothing_else(tmp_path: Path) -> None:
    text = (shipped.CONFIG / "forwarder.yaml").read_text(encoding="utf-8")
    file = tmp_path / "machine.yaml"
    motion = "motion: { crane: { slew: slew } }\n"
    file.write_text(text.replace("../dbc", str(shipped.CONFIG.parent / "dbc")) + motion)
    bench = Bench(load_deployment(file), "near_far")
    bench.ramp(0, slew=1.0)
    assert "limit=asked" in bench.sends(10, slew=1.0)


def test_the_other_axis_may_have_another_joystick(tmp_path: Path) -> None:
    text = (shipped.CONFIG / "forwarder-robust.yaml").read_text(encoding="utf-8")
    left, right = "joystick: left, signal: NearFar", "joystick: right, signal: Lift"
    assert left in text
    text = text.replace(left, "").replace(right, left).replace("{ ,", f"{{ {right},")
    file = tmp_path / "machine.yaml"
    file.write_text(text.replace("../dbc", str(shipped.CONFIG.parent / "dbc")))
    bench = Bench(load_deployment(file), "near_far")
    assert bench.deployment.axes["near_far"].config.command.joystick == "right"
    bench.ramp(34, slew=1.0)
    assert bench.sends(40, slew=1.0)
