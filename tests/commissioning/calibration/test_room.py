"""How much room an axis needs for its ramp, and what happens where it has less."""

from pathlib import Path

import pytest

from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.ramp import RATE_PER_S, TOP, EndStopDetector, Ramp
from canshaper.commissioning.calibration.run import run_simulated
from canshaper.commissioning.calibration.write import speed_signal
from canshaper.errors import CalibrationError
from canshaper.machine.binding import load_deployment
from canshaper_sim.parameters import changed_parameters

JOINTS = Path(__file__).parents[3] / "config" / "forwarder-joints.yaml"


def of_joint(axis: str, ramp: Ramp) -> CalibrationDrive:
    deployment = load_deployment(JOINTS)
    drive = CalibrationDrive(deployment, axis, speed_signal(deployment, axis, None), ramp)
    run_simulated(
        drive, deployment, changed_parameters([f"joints.{axis}.deadband=0.08"]), lambda _: None
    )
    return drive


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["lift_cylinder", "knuckle", "extension"])
def test_a_joint_has_room_for_the_ramp_that_is_proposed(axis: str) -> None:
    """The lift cylinder begins at its upper end, and is brought back first."""
    valve = of_joint(axis, Ramp(RATE_PER_S, TOP)).result()
    for direction in (valve.positive, valve.negative):
        assert direction.opens == pytest.approx(0.08, abs=0.004)
        assert direction.full == pytest.approx(valve.positive.full, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["knuckle", "extension"])
def test_a_ramp_that_reaches_the_end_of_a_joint_is_no_measurement(axis: str) -> None:
    """On the way up or down: what is left of the ramp would make a wrong curve."""
    drive = of_joint(axis, Ramp(0.03, 0.4))
    with pytest.raises(CalibrationError, match=r"its end\? give it room for 5\.7 s"):
        drive.result()
    assert drive.progress < 0.5  # no need to push against it for the rest of a minute


def watched(*samples: tuple[str, float, float], tremble: float = 0.0) -> bool:
    """Samples of (part, command, speed), a tenth of a second apart; whether one is the end."""
    watch, rest = EndStopDetector(), [("rest", 0.0, sign * tremble) for sign in (1, -1)]
    steps = [*rest, *samples]
    reached = [watch.reached(part, 0.1 * n, c, s) for n, (part, c, s) in enumerate(steps)]
    return any(reached)


def test_what_is_no_end() -> None:
    ramp = [0.01 * n for n in range(41)]
    speed = [max(0.0, c - 0.2) for c in ramp]  # a wide dead band: it stands for half of the way
    up = [("up+", c, s) for c, s in zip(ramp, speed, strict=True)]
    down = [("down+", c, s) for _, c, s in reversed(up)]
    assert not watched(*up, *down)
    assert not watched(*up, *down, ("settling", 0.0, 0.0), *(("up-", -c, 0.0) for c in ramp[:20]))
    trembling = [("up+", c, 0.01 * (-1) ** n) for n, c in enumerate(ramp)]
    assert not watched(*trembling, tremble=0.01)
    stands = [("down+", c, 0.0) for c in reversed(ramp)]
    assert watched(*up, *stands)
    assert watched(*up, *(("held+", 0.4, 0.0) for _ in range(7)))
