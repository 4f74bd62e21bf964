"""How much of near-far's speed the radial compensation may take."""

from collections.abc import Callable

import pytest

from tests.service.conftest import Rig

FILTER = "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
RADIAL = "    radial_compensation: {{ axis: near_far, {}, radius_m: 6.0, max_pct: {} }}\n"
SPEED = "full_speed_rad_s: 0.5"


@pytest.mark.parametrize("max_pct", [2, 3.5])
def test_it_is_bounded_as_configured(changed_rig: Callable[..., Rig], max_pct: float) -> None:
    rig = changed_rig({FILTER: FILTER + RADIAL.format(SPEED, max_pct)})
    rig.run(3)
    asked = []
    for tick in range(300):
        rig.run(1, Slew=1000 if tick < 150 else 0)
        asked.append(rig.controller.axes["near_far"].added)
    assert min(asked) == pytest.approx(-max_pct / 100.0, abs=1e-12)  # inwards while it gets going
    assert max(asked) == pytest.approx(max_pct / 100.0, abs=1e-12)  # and back
