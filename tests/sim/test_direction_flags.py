"""The scripted operator on a joystick with direction flags."""

from pathlib import Path

import pytest

from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.operator import random_script
from tests.rigs.files import ROOT

SIGNED = ' SG_ Slew : 0|16@1- (0.1,0) [-100|100] "%" SHAPER'
FLAGGED = """ SG_ SlewNeutral : 0|2@1+ (1,0) [0|3] "" SHAPER
 SG_ SlewNegative : 2|2@1+ (1,0) [0|3] "" SHAPER
 SG_ SlewPositive : 4|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Slew : 6|10@1+ (0.1,0) [0|100] "%" SHAPER"""
FLAGS = "{ neutral: SlewNeutral, negative: SlewNegative, positive: SlewPositive }"


def flagged(directory: Path) -> Deployment:
    """The shipped machine with direction flags for slewing."""
    text = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
    text = text.replace("../dbc/forwarder.dbc", "flags.dbc")
    text = text.replace("signal: Slew,", f"signal: Slew, flags: {FLAGS},")
    dbc = (ROOT / "dbc" / "forwarder.dbc").read_text(encoding="cp1252").replace(SIGNED, FLAGGED)
    dbc = dbc.replace('Slew 32766 "Error" 32767', 'Slew 1022 "Error" 1023')
    (directory / "flags.yaml").write_text(text, encoding="utf-8")
    (directory / "flags.dbc").write_text(dbc, encoding="cp1252")
    return load_deployment(directory / "flags.yaml")


@pytest.mark.slow
def test_a_joystick_with_flags_drives_as_a_signed_one(tmp_path: Path) -> None:
    script = random_script(3, 20.0)
    signed = drive(load_deployment(ROOT / "config" / "forwarder.yaml"), script)
    assert min(signed.axes["slew"].joystick) < -0.2 < 0.2 < max(signed.axes["slew"].joystick)
    assert drive(flagged(tmp_path), script) == signed
