"""The scripted operator on a joystick with direction flags."""

import pytest

from canshaper.design.lockstep import drive
from canshaper_sim.operator import random_script
from tests.codec.test_flags_binding import FLAGGED, FLAGS, SIGNED
from tests.rigs.files import Machine


@pytest.mark.slow
def test_a_joystick_with_flags_drives_as_a_signed_one(machine: Machine) -> None:
    script = random_script(3, 20.0)
    signed = drive(machine.load(), script)
    assert min(signed.axes["slew"].joystick) < -0.2 < 0.2 < max(signed.axes["slew"].joystick)
    machine.in_yaml("signal: Slew,", f"signal: Slew, flags: {FLAGS},")
    machine.in_dbc(SIGNED, FLAGGED)
    machine.in_dbc('Slew 32766 "Error" 32767', 'Slew 1022 "Error" 1023')
    assert drive(machine.load(), script) == signed
