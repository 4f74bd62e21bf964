"""The simulated crane and the one in MuJoCo, which share no code, under the same commands.

``pytest -s tests/closed_loop/test_twin_plant.py`` prints how far their swings are apart.
"""

import math

import pytest

from canshaper_sim.crane import Crane
from canshaper_sim.parameters import changed_parameters
from tests.closed_loop.mujoco_twin import Twin, TwinCrane

TICK_S = 0.02
ENDS_M = (1.8, 5.0)
STOPPED = ("radius_max_m=5",)
TILTED = ("carrier.pitch_deg=10", "carrier.roll_deg=-6")
TYRES = (1.2, 0.1, 4e4)
ROCKING = (
    *("carrier.rock_hz=1.2", "carrier.rock_damping=0.1", "carrier.boom_kg=0"),
    *("carrier.roll_kg_m2=4e4", "carrier.pitch_kg_m2=4e4"),
)
DRAG_M2 = 2.0
WIND = ("wind.speed_m_s=12", f"wind.drag_m2={DRAG_M2}")
WIND_N = 0.5 * 1.225 * DRAG_M2 * 12.0**2
LOG = ("log.grip_s=0", "log.mass_kg=300", "log.below_m=0", "log.length_m=4", "rotator.start_deg=30")


def commands(tick: int) -> tuple[float, float]:
    """Slew and near-far at once, there and back, with releases."""
    return (0.0, 0.6, 0.6, -0.3, 0.0)[tick // 60 % 5], (0.7, 0.7, -0.4, 0.0)[tick // 75 % 4]


@pytest.mark.parametrize(
    ("twin", "changes", "part", "apart_deg"),
    [
        (TwinCrane(), (), 1.0, 0.2),
        (TwinCrane(pump=0.8), ("pump_flow=0.8",), 1.0, 0.2),
        (TwinCrane(ends_m=ENDS_M), STOPPED, 1.0, 0.2),
        (TwinCrane(ends_m=ENDS_M, cushion_s=0.5), (*STOPPED, "ends.cushion_s=0.5"), 1.0, 0.2),
        (TwinCrane(slope_deg=(10.0, -6.0)), TILTED, 1.0, 0.2),
        (TwinCrane(tyres=TYRES), ROCKING, 1.0, 0.8),
        (TwinCrane(wind_n=WIND_N), WIND, 1.0, 0.2),
        (TwinCrane(log=(300.0, 4.0, 30.0)), LOG, 0.3, 0.2),  # small angles
    ],
    ids=["plain", "pump", "stop", "cushion", "slope", "tyres", "wind", "log"],
)
def test_both_swing_alike(
    twin: TwinCrane, changes: tuple[str, ...], part: float, apart_deg: float
) -> None:
    crane = Crane(changed_parameters(["radius_max_m=12", *changes]))
    judge, apart, swing = Twin(twin), 0.0, 0.0
    carrier = crane.around.carrier
    judge.begin(crane.rest_rad, (carrier.roll[0], carrier.pitch[0]) if carrier else (0.0, 0.0))
    for tick in range(500):
        slew, near_far = (part * one for one in commands(tick))
        judge.valves["slew"].command, judge.valves["near_far"].command = slew, near_far
        judge.step()
        crane.step(TICK_S, {"slew": slew, "near_far": near_far})
        pairs = zip(judge.sway_rad, crane.state[7:9], strict=True)
        apart = max(apart, *(abs(a - b) for a, b in pairs))
        swing = max(swing, *map(abs, judge.sway_rad))
        assert crane.state.radius_m == pytest.approx(judge.radius_m, abs=5e-3)
    print(f"{math.degrees(apart):.3f} degrees apart, of {math.degrees(swing):.1f}")
    assert math.degrees(swing) > 7.0
    assert math.degrees(apart) < apart_deg
