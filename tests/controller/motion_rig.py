"""A machine whose slew and near-far move as one."""

from canshaper.codec.frame import Frame
from tests.rigs.forwarder import Make, Rig

FIXED = "slew: slew, near_far: near_far, radius_m: 3.0, max_pct: 25"
TIP = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100"
MEASURED = f"slew: slew, near_far: near_far, radius: {{ {TIP} }}"
NEAR_JOYSTICK = "command: { joystick: left, signal: NearFar, neutral_pct: 2 }"


def moving_as_one(make: Make, text: str = FIXED, **changes: dict[str, str]) -> Rig:
    section = f"motion: {{ crane: {{ {text} }} }}\naxes:\n"
    return make({"axes:\n": section, **changes.get("yaml", {})}, changes.get("dbc"))


# Near-far on the joystick that the slew joystick is not on, in place of lift.
LIFT_OF_RIGHT = {
    "signal: Lift,": "signal: Rotate,",
    NEAR_JOYSTICK: NEAR_JOYSTICK.replace("left", "right").replace("NearFar", "Lift"),
}


def by_two_joysticks(make: Make) -> Rig:
    """With compensation, and the two joysticks on two joysticks."""
    return moving_as_one(make, yaml=LIFT_OF_RIGHT)


def near_far(rig: Rig, ticks: int, **raw: int) -> list[float]:
    """Velocity of near-far, fraction of full speed, tick by tick."""
    sent = []
    for _ in range(ticks):
        rig.run(1, **raw)
        sent.append(rig.controller.axes["near_far"].axis.output.setpoint)
    return sent


def slewing(rig: Rig, ticks: int, radius_raw: int | None) -> list[float]:
    """Slew in full motion, with or without a frame of the radius each tick."""
    sent = []
    message = rig.message("TipPosition")
    for _ in range(ticks):
        if radius_raw is not None:
            raw = {"SlewAngle": 0, "Radius": radius_raw, "Height": 0}
            data = message.encode(raw, scaling=False, strict=False)
            rig.receive(Frame("crane", message.frame_id, False, data))
        sent += near_far(rig, 1, Slew=1000)
    return sent
