"""Commands in a joystick's own message: several axes in one frame, and directions by flags."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.faults import shipped, variants
from tests.guard.bench import Bench, limited
from tests.rigs.gateway import GatewayRig

FREE = {"deadband_pct": 0.0, "rise_per_s": 100.0, "fall_per_s": 100.0}


@pytest.mark.parametrize("axis", ["slew", "near_far"])
def test_each_axis_of_a_frame_is_looked_at(axis: str) -> None:
    deployment = load_deployment(shipped.CONFIG / "gateway-forwarder.yaml")
    one = Bench(limited(deployment, axis, **FREE), axis)
    assert not one.sends(0, **{axis: 0.2})
    assert not one.sends(200, **{axis: 0.2})
    why = one.sends(300, **{axis: 0.2})
    assert why == f"axis={axis} limit=asked speed=0.300 allowed=0.200"


def test_flags_give_the_direction_there_too(tmp_path: Path) -> None:
    flags = variants.VARIANTS["flags"]
    yaml = [(old, new) for old, new in flags.yaml.items() if old.startswith("signal:")]
    rig = GatewayRig(tmp_path, tuple(yaml), tuple(flags.dbc.items()))
    one = Bench(limited(rig.deployment, "slew", **FREE), "slew")
    assert not one.sends(0, slew=-0.2)
    assert not one.sends(-200, slew=-0.2)
    assert "limit=asked speed=-0.300 allowed=0.200" in one.sends(-300, slew=-0.2)


def test_the_second_frame_of_a_period_is_no_faster_for_the_rates() -> None:
    deployment = load_deployment(shipped.CONFIG / "gateway-forwarder.yaml")
    one = Bench(limited(deployment, "slew", deadband_pct=0.0, rise_per_s=5.0), "slew")
    one.ramp(200, slew=1.0)
    assert not one.sends(200, slew=1.0)
    one.number -= 1
    one.guard.at = one.guard.at[0] - 1, one.guard.at[1] - 1  # the same tick once more
    assert one.sends(280, slew=1.0).endswith("limit=rate speed=0.280 allowed=0.202")
