"""A load that stands on the ground under the bridge crane's sling, and is lifted off in motion.

``pytest -s tests/closed_loop/test_lift_off.py`` prints the swing of the load, trolley to load, that
is left ten seconds after the last joystick: off and shaped.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from canshaper.design.lockstep import Simulation
from canshaper.machine.binding import load_deployment
from canshaper_sim.overhead import OverheadBoom
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.strokes import Script, Stroke
from tests.rigs.overhead import changed
from tests.sim.test_sling import modes

SLING_M, RATIO, GROUND_M, STEP_S = 1.5, 5.0, 9.0, 0.02


def lifted(
    directory: Path, off_m: float, strokes: tuple[Stroke, ...], *, bypass: bool, look_s: float = 6.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rope in m, height of the load in m and its swing in degrees until look_s after ten seconds.

    The length signal says the rope; the file adds the sling.
    """
    own = f"overhead.rope_m: 7.8, overhead.sling.length_m: {SLING_M}, overhead.sling.off_m: {off_m}"
    own += f", overhead.sling.load_ratio: {RATIO}, overhead.sling.ground_m: {GROUND_M}"
    file = changed(
        directory,
        ("hoist: hoist }", f"hoist: hoist, simulated: {{ {own} }} }}"),
        ("signal: RopeLength,", f"signal: RopeLength, offset_m: {SLING_M},"),
        ("lowest_m: 1.5", "lowest_m: 2"),
    )
    deployment = load_deployment(file)
    script = Script("lift", strokes, max(one.end_s for one in strokes) + 10.0 + look_s)
    parameters = changed_parameters([], deployment)
    simulation = Simulation(deployment, script, bypass=bypass, parameters=parameters)
    boom = simulation.plant.crane.boom
    assert isinstance(boom, OverheadBoom)
    rows = []
    for _ in simulation.ticks():
        assert boom.slung is not None
        x, y, z = boom.slung.position
        x, y = x - boom.axes["bridge"].position, y - boom.axes["trolley"].position
        rows.append((boom.rope_m, z + GROUND_M, math.degrees(math.atan2(math.hypot(x, y), -z))))
    rope_m, up_m, swing_deg = np.array(rows).T
    return rope_m, up_m, swing_deg


HOIST = Stroke("hoist", 0.5, 6.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "off_m", "strokes", "most"),
    [
        ("lifted, then travel", 0.0, (HOIST, Stroke("bridge", 5.0, 6.0, 1.0)), 0.02),
        ("lifted in travel", 0.0, (HOIST, Stroke("bridge", 1.6, 6.0, 1.0)), 0.1),
        ("dragged", 0.0, (HOIST, Stroke("bridge", 0.1, 8.0, 1.0)), 0.1),
        # Of a crooked pull nothing was commanded: no filter takes it.
        ("0.5 m crooked", 0.5, (HOIST,), 1.0),
    ],
)
def test_what_is_left_of_a_load_that_is_lifted_off(
    tmp_path: Path,
    name: str,
    off_m: float,
    strokes: tuple[Stroke, ...],
    most: float,
) -> None:
    left = []
    for bypass in (True, False):
        _, up_m, swing_deg = lifted(tmp_path, off_m, strokes, bypass=bypass)
        assert up_m[0] < 0.0
        assert up_m[-1] > 1.0
        left.append(float(swing_deg[-round(6.0 / STEP_S) :].max()))
    print(f"\n{name}: {left[0]:.1f} off, {left[1]:.2f} shaped")
    assert left[0] > 3.0
    assert left[1] <= most * left[0]


def test_from_lift_off_on_it_swings_with_the_length_that_the_file_adds_up(tmp_path: Path) -> None:
    """Lifted for 2 s, 0.5 m crooked: rope and sling were its pendulum when it left the ground."""
    strokes = (Stroke("hoist", 0.5, 2.0, 1.0),)
    rope_m, up_m, swing_deg = lifted(tmp_path, 0.5, strokes, bypass=False, look_s=4.0)
    off = int(np.argmax(up_m > 0.001))
    assert rope_m[off] + SLING_M == pytest.approx(math.hypot(GROUND_M, 0.5), abs=0.07)
    assert np.ptp(swing_deg[: off - 1]) < 0.3
    after = swing_deg[round(3.0 / STEP_S) :]
    inner = after[1:-1]
    lows = np.flatnonzero((inner < after[:-2]) & (inner <= after[2:]) & (inner < 0.5))
    half_s = float(np.diff(lows).mean()) * STEP_S  # between two passes below the trolley
    omega = modes(float(rope_m[-1]), SLING_M, RATIO)[0]
    assert half_s == pytest.approx(math.pi / omega, rel=0.02)
    own_s = 2.0 * math.pi * math.sqrt((float(rope_m[-1]) + SLING_M) / 9.81)
    assert 2.0 * half_s == pytest.approx(own_s, rel=0.02)
