"""Hook and load on a sling: the formula of a double pendulum, its energy, the same in MuJoCo."""

import math

import mujoco
import pytest

from canshaper.machine.binding import load_deployment
from canshaper_sim.crane import CraneParameters, RopeCrane
from canshaper_sim.grapple import Sway
from canshaper_sim.overhead import OverheadBoom, OverheadParameters
from canshaper_sim.plant import PlantNode
from canshaper_sim.sling import SlingParameters, Vector, dot, plus
from tests.rigs.files import CONFIG

G, STEP_S = 9.81, 0.01
STRETCHED_M = G / 40.0**2  # a sling at rest
ROTOR = 1e14  # of what is driven in MuJoCo: it feels nothing of the load


class Crane:
    """The simulated crane, hook and load in the world."""

    def __init__(
        self, sling: SlingParameters, sway: Sway | None = None, *, rope_m: float = 6.0, **own: float
    ) -> None:
        parameters = OverheadParameters(rope_m=rope_m, damping_ratio=0.0, sling=sling, **own)  # type: ignore[arg-type]
        self._crane = RopeCrane(CraneParameters(overhead=parameters), sway)
        boom = self._crane.boom
        assert isinstance(boom, OverheadBoom)
        assert boom.slung
        self.boom, self.slung, self.sling = boom, boom.slung, sling

    def run(self, seconds: float, **commands: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self._crane.step(STEP_S, commands)

    @property
    def hook(self) -> Vector:
        """Where it is in the world."""
        bridge, trolley, _ = self.boom.axes.values()
        return plus((bridge.position, trolley.position, 0.0), 1.0, self.boom.load)

    @property
    def energy(self) -> float:
        """Energy of a hook of 1 kg and its load, with a trolley that stands; J."""
        apart = math.dist(self.hook, self.slung.position)
        stretched = 0.5 * 40.0**2 * max(apart - self.sling.length_m, 0.0) ** 2
        rate = self.slung.rate
        load = 0.5 * dot(rate, rate) + G * self.slung.position[2] + stretched
        hook = 0.5 * dot(self.boom.rate, self.boom.rate) + G * self.hook[2]
        return hook + self.sling.load_ratio * load


def modes(rope_m: float, sling_m: float, ratio: float) -> list[float]:
    """Angular frequencies of small swings, the slower first: w^4 - s w^2 + p = 0."""
    s = G * (1.0 + ratio) * (1.0 / rope_m + 1.0 / sling_m)
    p = (1.0 + ratio) * G * G / (rope_m * sling_m)
    root = math.sqrt(s * s - 4.0 * p)
    return [math.sqrt(0.5 * (s - root)), math.sqrt(0.5 * (s + root))]


@pytest.mark.parametrize("ratio", [1.0, 10.0])
@pytest.mark.parametrize(("rope_m", "sling_m"), [(2.0, 1.0), (5.0, 4.0), (10.0, 2.0)])
@pytest.mark.parametrize("mode", [0, 1])
def test_hook_and_load_swing_in_the_modes_of_a_double_pendulum(
    rope_m: float, sling_m: float, ratio: float, mode: int
) -> None:
    one = Crane(SlingParameters(sling_m, ratio), rope_m=rope_m)
    hangs_m = sling_m + STRETCHED_M
    omega = modes(rope_m, hangs_m, ratio)[mode]
    # The load's swing, parts of the hook's, by its own equation: x2'' = -g (x2 - x1) / l2.
    share = 1.0 / (1.0 - omega * omega * hangs_m / G)
    hook_m = 0.01 / max(1.0, abs(share))
    down = math.sqrt(rope_m**2 - hook_m**2)
    one.boom.load = hook_m, 0.0, -down
    below = math.sqrt(hangs_m**2 - ((share - 1.0) * hook_m) ** 2)
    one.slung.position = share * hook_m, 0.0, -down - below
    seconds = round(5.25 * 2.0 * math.pi / omega, 2)  # near the middle it shows its period best
    one.run(seconds)
    wrong = 0.003 * hook_m * omega * seconds  # a period that is 0.3 % off
    assert one.hook[0] == pytest.approx(hook_m * math.cos(omega * seconds), abs=wrong)
    assert one.slung.position[0] == pytest.approx(share * one.hook[0], abs=abs(share) * wrong)


def test_its_energy_stays_but_for_what_the_sling_takes() -> None:
    one = Crane(SlingParameters(2.0, 3.0), Sway(0.3, -0.2))
    lowest = -G * (6.0 + 3.0 * (8.0 + 0.5 * STRETCHED_M))
    energies = []
    for _ in range(30):
        energies.append(one.energy - lowest)
        one.run(1.0)
    assert energies[-1] == pytest.approx(energies[0], rel=0.001)
    assert max(energies) == energies[0]


def twin(rope_m: float, sling: SlingParameters) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The crane in MuJoCo: bridge, trolley, rope on two hinges, its length, two hinges."""
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><compiler balanceinertia="false"/>
      <option gravity="0 0 -{G}" integrator="RK4" timestep="{STEP_S / 4.0}">
        <flag contact="disable"/></option>
      <default><geom type="sphere" size="0.001"/></default>
      <worldbody><body>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <joint type="slide" axis="1 0 0" armature="{ROTOR}"/>
        <joint type="slide" axis="0 1 0" armature="{ROTOR}"/>
        <body><inertial pos="0 0 0" mass="1e-6" diaginertia="1e-6 1e-6 1e-6"/>
          <joint axis="0 1 0"/><joint axis="1 0 0"/>
          <body pos="0 0 {-rope_m}">
            <inertial pos="0 0 0" mass="100" diaginertia="1e-6 1e-6 1e-6"/>
            <joint type="slide" axis="0 0 1" armature="{ROTOR}"/>
            <body><inertial pos="0 0 {-sling.length_m - STRETCHED_M}"
              mass="{100.0 * sling.load_ratio}" diaginertia="1e-6 1e-6 1e-6"/>
              <joint axis="0 1 0"/><joint axis="1 0 0"/>
            </body></body></body></body></worldbody>
    </mujoco>""")
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("ratio", [1.0, 10.0])
@pytest.mark.parametrize("hoist", [0.0, 1.0])
def test_both_swing_as_in_another_simulation(ratio: float, hoist: float) -> None:
    """Driven along runway and bridge, there and back, the rope still or hoisted."""
    sling = SlingParameters(2.0, ratio)
    one = Crane(sling)
    model, data = twin(6.0, sling)
    apart = furthest = 0.0
    for k in range(1000):
        bridge, trolley = (1.0, 1.0, -1.0, 0.0, 0.0)[k // 200], (0.5, -0.5, 0.0, 0.0, 0.0)[k // 200]
        before = [axis.speed for axis in one.boom.axes.values()]
        one.run(STEP_S, bridge=bridge, trolley=trolley, hoist=hoist if 300 < k < 600 else 0.0)
        after = [axis.speed for axis in one.boom.axes.values()]
        for part in range(4):
            for joint, first, last in zip((0, 1, 4), before, after, strict=True):
                speed = first + (last - first) * (part + 1) / 4.0
                change = (speed - float(data.qvel[joint])) / (STEP_S / 4.0)
                data.qfrc_applied[joint] = ROTOR * change
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        load = data.xipos[4]
        apart = max(apart, math.dist(load, one.slung.position), math.dist(data.xipos[3], one.hook))
        furthest = max(furthest, math.dist(load[:2], data.qpos[:2]))
    assert furthest > 1.0
    assert apart < 0.01


def test_a_load_on_the_ground_stands_until_it_is_lifted_and_then_swings() -> None:
    one = Crane(SlingParameters(2.0, 5.0, ground_m=7.5, off_m=0.5))
    one.slung.rate = (1.0, 0.0, 0.0)
    one.run(2.0, bridge=0.2)  # under a slack sling
    slid_m = 0.5 / (0.5 * G)  # a speed of 1 m/s, half of the weight as friction
    assert one.slung.position == pytest.approx((0.5 + slid_m, 0.0, -7.5), abs=0.01)
    assert math.hypot(*one.boom.load[:2]) < 0.2  # the hook alone
    one.run(4.0, hoist=1.0)
    assert one.slung.position[2] > -7.2
    swing = []
    for _ in range(500):
        one.run(STEP_S)
        swing.append(one.slung.position[0])
    assert max(swing) - min(swing) > 0.1


def test_a_crane_whose_dbc_has_it_sends_how_the_sling_hangs() -> None:
    deployment = load_deployment(CONFIG / "bridge-crane-hook.yaml")
    node = PlantNode(deployment)
    boom = node.crane.boom
    assert isinstance(boom, OverheadBoom)
    assert boom.slung
    node.crane.step(1.5, {"bridge": 1.0, "trolley": -0.5})
    (_, message), frames = deployment.messages.find("SlingSway"), node.feedback()
    (data,) = (one.data for one in frames if one.can_id == message.frame_id)
    along, across = (math.radians(float(angle)) for angle in message.decode(data).values())
    down = boom.load[2] - boom.slung.position[2]
    bridge, trolley, _ = boom.axes.values()
    hook = bridge.position + boom.load[0], trolley.position + boom.load[1]
    below = hook[0] + down * math.tan(along), hook[1] + down * math.tan(across)
    assert below == pytest.approx(boom.slung.position[:2], abs=0.002)
    assert math.dist(below, hook) > 0.1


def test_without_a_sling_it_hangs_as_the_rope_does() -> None:
    boom = RopeCrane(CraneParameters(), Sway(0.2, -0.1)).boom
    assert isinstance(boom, OverheadBoom)
    assert boom.sling_angles == pytest.approx((0.2, -0.1))
