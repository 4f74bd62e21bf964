"""An independent crane for both axes: pillar, tip and grapple in MuJoCo, behind the frames.

MuJoCo does all mechanics; valves, frames and strokes are written here again, with nothing of
``canshaper_sim`` but the hands on the joysticks. Pillar and tip carry rotors of 1e14 (MuJoCo's
"armature") and are pushed by 1e14 times the acceleration of their valve, so that the grapple's
pull does not matter to them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.deployment import Deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.strokes import Script

ROTOR = 1e14
STEP_S = 0.0025
TICK_MS = 20
STEPS = round(TICK_MS / 1000.0 / STEP_S)
RADIUS_ID, LOAD_ID = 0x401, 0x414
VALVES = {0x200: "slew", 0x201: "near_far"}
FULL = {"slew": 0.5, "near_far": 1.0}  # rad/s, m/s


@dataclass(frozen=True)
class TwinCrane:
    """Masses, lengths and dampings of the twin.

    Attributes:
        radius_m: of the tip at the start.
        length: factor on the length of link and grapple.
        lag_s: time constant of each valve with its oil.
        radius_until_s: the sensor of the radius falls silent then.
        pump: full axis flows that both valves share.
        ends_m: lowest and highest radius.
        cushion_s: length of the cushions before these ends, s of full speed.
        slope_deg: of the ground, down ahead and down to the right.
        tyres: frequency and damping ratio of the rocking carrier, and its inertia, the same about
            both axes; the crane itself then has no weight.
        wind_n: on the grapple, to the left of the carrier.
        log: kg in the grapple's middle, its length, its angle to the boom in degrees.
        lower_m: how much lower the middle of grapple and log hangs than that of the grapple.
        says_kg: weight that the machine reports at a time in s, or None where it is silent; by
            default that of the log.
    """

    radius_m: float = 3.0
    length: float = 1.0
    lag_s: tuple[float, float] = (0.1, 0.1)
    radius_until_s: float = math.inf
    pump: float = math.inf
    ends_m: tuple[float, float] = (-math.inf, math.inf)
    cushion_s: float = 0.0
    slope_deg: tuple[float, float] = (0.0, 0.0)
    tyres: tuple[float, float, float] = (0.0, 0.0, 1.0)
    wind_n: float = 0.0
    log: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lower_m: float = 0.0
    says_kg: Callable[[float], float | None] | None = None


class Valve:
    """5 % of deadband, 5 full speeds per second, then a lag of first order."""

    def __init__(self, lag_s: float) -> None:
        self.command = self.spool = self.speed = 0.0
        self._share = -math.expm1(-STEP_S / lag_s)

    def move(self) -> None:
        """Move the spool on for a step."""
        opening = max(0.0, (abs(self.command) - 0.05) / 0.95)
        error = math.copysign(opening, self.command) - self.spool
        self.spool += math.copysign(min(abs(error), 5.0 * STEP_S), error)

    def step(self, supply: float = 1.0) -> None:
        """Let the oil follow for a step, with so much of it."""
        self.speed += self._share * (supply * self.spool - self.speed)


class Twin:
    """Crane, valves and the sensor of the radius."""

    def __init__(self, crane: TwinCrane) -> None:
        link, arm = 0.2 * crane.length, 1.2 * crane.length + crane.lower_m
        pitch, roll = (math.radians(one) for one in crane.slope_deg)
        rock_hz, ratio, inertia = crane.tyres
        stiffness = inertia * (2.0 * math.pi * rock_hz) ** 2
        damping = 2.0 * ratio * inertia * 2.0 * math.pi * rock_hz
        tyre = f'stiffness="{stiffness}" damping="{damping}"'
        rocks = f'<joint axis="1 0 0" {tyre}/><joint axis="0 1 0" {tyre}/>' if rock_hz else ""
        kg = (1e-3, 1e-3) if rock_hz else (500, 100)
        log_kg, length_m, yaw_deg = crane.log
        slim = f"1e-6 {log_kg * length_m**2 / 12.0 + 1e-6} {log_kg * length_m**2 / 12.0 + 1e-6}"
        self._model = mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <compiler angle="radian" eulerseq="yxz" balanceinertia="false"/>
          <option gravity="0 0 -9.81" integrator="RK4" timestep="{STEP_S}">
            <flag contact="disable"/></option>
          <worldbody><body euler="{pitch} {roll} 0">
            <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>{rocks}
            <body pos="0 0 4">
            <inertial pos="0 0 0" mass="{kg[0]}" diaginertia="1e-3 1e-3 1e-3"/>
            <joint axis="0 0 1" armature="{ROTOR}"/>
            <body><inertial pos="0 0 0" mass="{kg[1]}" diaginertia="1e-3 1e-3 1e-3"/>
              <joint type="slide" axis="1 0 0" armature="{ROTOR}"/>
              <body><inertial pos="0 0 {-link}" mass="40" diaginertia="1e-6 1e-6 1e-6"/>
                <joint axis="1 0 0" damping="120"/>
                <body pos="0 0 {-link}">
                  <inertial pos="0 0 {-arm}" mass="{300 + log_kg}" diaginertia="{slim}"
                    euler="0 0 {math.radians(yaw_deg)}"/>
                  <joint axis="0 1 0" damping="120"/>
                </body></body></body></body></body></worldbody>
        </mujoco>""")
        self._data = mujoco.MjData(self._model)
        self._crane, self._first = crane, 2 if rock_hz else 0  # of the joints of the crane
        self._data.qpos[self._first + 1] = crane.radius_m
        self._data.xfrc_applied[5][:3] = (0.0, crane.wind_n, 0.0)
        self.valves = {axis: Valve(lag) for axis, lag in zip(FULL, crane.lag_s, strict=True)}

    def step(self) -> float:
        """One tick of the valves' frames; the grapple's tilt against the vertical, degrees."""
        data, pump = self._data, self._crane.pump
        for _ in range(STEPS):
            for valve in self.valves.values():
                valve.move()
            asked = sum(abs(valve.spool) for valve in self.valves.values())
            for joint, (axis, full) in enumerate(FULL.items(), self._first):
                self.valves[axis].step(min(1.0, pump / asked) if asked else 1.0)
                speed = full * self.valves[axis].speed
                if axis == "near_far":
                    speed = self._within_ends(speed, full)
                change = (speed - float(data.qvel[joint])) / STEP_S
                data.qfrc_applied[joint] = ROTOR * change
            mujoco.mj_step(self._model, data)
        return math.degrees(math.acos(min(1.0, float(data.xmat[5][8]))))

    def _within_ends(self, speed: float, full: float) -> float:
        """Speed of the radius that its cushions and ends let through."""
        low, high = self._crane.ends_m
        room = max(0.0, high - self.radius_m if speed > 0.0 else self.radius_m - low)
        if cushion_s := self._crane.cushion_s:
            most = max(0.1 * full, full * math.sqrt(room / (full * cushion_s)))
            speed = math.copysign(min(abs(speed), most), speed)
        return math.copysign(min(abs(speed), room / STEP_S), speed)

    @property
    def radius_m(self) -> float:
        """Of the tip."""
        return float(self._data.qpos[self._first + 1])

    @property
    def sway_rad(self) -> tuple[float, float]:
        """Angles of the two joints of the grapple, across the boom and along it."""
        across, along = self._data.qpos[self._first + 2 : self._first + 4]
        return float(across), float(along)

    def begin(self, sway_rad: tuple[float, float], rocked_rad: tuple[float, float]) -> None:
        """Stand still with these angles of the grapple's joints, and of the tyres: roll, pitch."""
        self._data.qpos[self._first + 2 : self._first + 4] = sway_rad
        self._data.qpos[: self._first] = rocked_rad[: self._first]


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
    gated, hand = GatedController(controller), JoystickNode(deployment, script, bypass=bypass)
    tilt: list[float] = []
    sent: dict[str, list[float]] = {axis: [] for axis in FULL}
    for tick in range(round(script.duration_s * 1000.0 / TICK_MS)):
        now_ns = tick * TICK_MS * 1_000_000
        frames = hand.frames_of_tick(tick * TICK_MS, TICK_MS)
        if now_ns < crane.radius_until_s * 1e9:
            radius = round(1000.0 * twin.radius_m).to_bytes(2, "little")
            frames.append(Frame("crane", RADIUS_ID, False, b"\0\0" + radius + b"\0\0"))
        if deployment.load_state and tick % 5 == 0:
            kg = crane.log[0] if crane.says_kg is None else crane.says_kg(tick * TICK_MS / 1000.0)
            if kg is not None:
                data = round(kg).to_bytes(2, "little") + b"\0"
                frames.append(Frame("crane", LOAD_ID, False, data))
        for frame in frames:
            gated.receive(frame, now_ns)
        for _, can_id, _, data in gated.tick(now_ns):
            if axis := VALVES.get(can_id):
                raw = int.from_bytes(data[:1], "little", signed=True)
                twin.valves[axis].command = raw / 125.0
        for axis, values in sent.items():
            values.append(controller.axes[axis].axis.output.setpoint)
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
