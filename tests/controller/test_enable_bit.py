"""A bit of a signal that enables: controller and gate read the same one."""

from collections.abc import Callable

import pytest

from canshaper.shaping.states import State
from tests.rigs.forwarder import Rig

FIRST = "of 20 ms\n    enable: "  # of the left joystick
OTHERS, HELD = 0x5F, 0x20


@pytest.mark.parametrize("layout", ["40|8@1+", "40|8@1-", "47|8@0+"])
def test_one_bit_of_a_byte_enables(changed_rig: Callable[..., Rig], layout: str) -> None:
    keys, after = f' SG_ Keys : {layout} (1,0) [0|0] "" SHAPER\n', " SG_ NearFar : 16|16@1-"
    rig = changed_rig({f"{FIRST}Enable": f"{FIRST}Keys/5"}, {after: keys + after})
    rig.run(5, Keys=OTHERS)
    assert rig.state("slew") is State.NEUTRAL_WAIT
    rig.run(5, Keys=HELD)
    assert rig.run(20, Slew=1000, Keys=HELD)["SlewCommand"]["Velocity"] > 0.0
    assert rig.state("slew") is State.ACTIVE
    assert rig.run(2, Slew=1000, Keys=OTHERS)["SlewCommand"]["Velocity"] == 0.0
