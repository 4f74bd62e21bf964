"""An independent crane for both axes: pillar, tip and grapple in MuJoCo, behind the frames.

MuJoCo does all mechanics; valves, frames and strokes are written here again, with nothing of
``canshaper_sim`` but the hands on the joysticks. Pillar and tip carry rotors of 1e14 (MuJoCo's
"armature") and are pushed by 1e14 times the acceleration of their valve, so that the grapple's
pull does not matter to them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.machine.deployment import Deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.strokes import Script

ROTOR = 1e14
STEP_S = 0.0025
TICK_MS = 20
STEPS = round(TICK_MS / 1000.0 / STEP_S)
RADIUS_ID = 0x401
VALVES = {0x200: "slew", 0x201: "near_far"}
FULL = {"slew": 0.5, "near_far": 1.0}  # rad/s, m/s


@dataclass(frozen=True)
class TwinCrane:
    """What the twin is made of.

    Attributes:
        radius_m: of the tip at the start.
        length: factor on the length of link and grapple.
        lag_s: time constant of each valve with its oil.
        radius_until_s: the sensor of the radius falls silent then.
    """

    radius_m: float = 3.0
    length: float = 1.0
    lag_s: tuple[float, float] = (0.1, 0.1)
    radius_until_s: float = math.inf


class Valve:
    """5 % of deadband, 5 full speeds per second, then a lag of first order."""

    def __init__(self, lag_s: float) -> None:
        self.command = self.spool = self.speed = 0.0
        self._share = -math.expm1(-STEP_S / lag_s)

    def step(self) -> float:
        """Change of speed in a step, full speeds."""
        opening = max(0.0, (abs(self.command) - 0.05) / 0.95)
        error = math.copysign(opening, self.command) - self.spool
        self.spool += math.copysign(min(abs(error), 5.0 * STEP_S), error)
        change = self._share * (self.spool - self.speed)
        self.speed += change
        return change


class Twin:
    """Crane, valves and the sensor of the radius."""

    def __init__(self, crane: TwinCrane) -> None:
        link, arm = 0.2 * crane.length, 1.2 * crane.length
        self._model = mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <compiler angle="radian" balanceinertia="false"/>
          <option gravity="0 0 -9.81" integrator="RK4" timestep="{STEP_S}">
            <flag contact="disable"/></option>
          <worldbody><body pos="0 0 4">
            <inertial pos="0 0 0" mass="500" diaginertia="40 40 40"/>
            <joint axis="0 0 1" armature="{ROTOR}"/>
            <body><inertial pos="0 0 0" mass="100" diaginertia="1 1 1"/>
              <joint type="slide" axis="1 0 0" armature="{ROTOR}"/>
              <body><inertial pos="0 0 {-link}" mass="40" diaginertia="1e-6 1e-6 1e-6"/>
                <joint axis="1 0 0" damping="120"/>
                <body pos="0 0 {-link}">
                  <inertial pos="0 0 {-arm}" mass="300" diaginertia="1e-6 1e-6 1e-6"/>
                  <joint axis="0 1 0" damping="120"/>
                </body></body></body></body></worldbody>
        </mujoco>""")
        self._data = mujoco.MjData(self._model)
        self._data.qpos[1] = crane.radius_m
        self.valves = {axis: Valve(lag) for axis, lag in zip(FULL, crane.lag_s, strict=True)}

    def step(self) -> float:
        """One tick of the valves' frames; the grapple's tilt against the vertical, degrees."""
        data = self._data
        for _ in range(STEPS):
            for joint, (axis, full) in enumerate(FULL.items()):
                data.qfrc_applied[joint] = ROTOR * full * self.valves[axis].step() / STEP_S
            mujoco.mj_step(self._model, data)
        return math.degrees(math.acos(min(1.0, float(data.xmat[4][8]))))

    @property
    def radius_m(self) -> float:
        """Of the tip."""
        return float(self._data.qpos[1])


@dataclass(frozen=True)
class Driven:
    """A drive: tilt of the grapple (degrees), and the velocities in the frames, tick by tick."""

    tilt_deg: list[float]
    sent: dict[str, list[float]]

    @property
    def residual_deg(self) -> float:
        """The largest tilt of the last three seconds."""
        return max(self.tilt_deg[-150:])

    @property
    def peak_deg(self) -> float:
        """The largest tilt of all."""
        return max(self.tilt_deg)


def drive(
    deployment: Deployment, script: Script, crane: TwinCrane | None = None, *, bypass: bool = False
) -> Driven:
    """Let an operator drive the twin through a deployment; the script ends with three calm seconds.

    Args:
        deployment: of the two joysticks and four messages of ``dbc/forwarder.dbc``.
        script: what the operator does.
        crane: the twin; by default the nominal one at a radius of 3 m.
        bypass: with anti-sway switched off.
    """
    crane = crane or TwinCrane()
    twin, controller = Twin(crane), Controller(deployment)
    guarded, hand = Guarded(controller), JoystickNode(deployment, script, bypass=bypass)
    tilt: list[float] = []
    sent: dict[str, list[float]] = {axis: [] for axis in FULL}
    for tick in range(round(script.duration_s * 1000.0 / TICK_MS)):
        now_ns = tick * TICK_MS * 1_000_000
        frames = hand.frames_of_tick(tick * TICK_MS, TICK_MS)
        if now_ns < crane.radius_until_s * 1e9:
            radius = round(1000.0 * twin.radius_m).to_bytes(2, "little")
            frames.append(Frame("crane", RADIUS_ID, False, b"\0\0" + radius + b"\0\0"))
        for frame in frames:
            guarded.receive(frame, now_ns)
        for _, can_id, _, data in guarded.tick(now_ns):
            if axis := VALVES.get(can_id):
                raw = int.from_bytes(data[:1], "little", signed=True)
                twin.valves[axis].command = raw / 125.0
        for axis, values in sent.items():
            values.append(controller.axes[axis].axis.sent)
        controller.events.clear()
        tilt.append(twin.step())
    return Driven(tilt, sent)


def figures(
    deployment: Deployment, scripts: Sequence[Script], crane: TwinCrane | None = None
) -> tuple[float, float, float]:
    """Mean and largest residual, and the largest peak, of several drives."""
    drives = [drive(deployment, script, crane) for script in scripts]
    residuals = [one.residual_deg for one in drives]
    peak = max(one.peak_deg for one in drives)
    return sum(residuals) / len(residuals), max(residuals), peak
