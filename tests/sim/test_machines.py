"""Which machine a deployment gets, its feedback, and its parameters by name."""

import math
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.design.lockstep import drive
from canshaper.errors import ConfigError, DriveError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import JOINT_AXES, TIP_AXES
from canshaper_sim.joints import JointBoom
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.machines import MACHINES, TipControlledCrane, build_machine, machine_for
from canshaper_sim.operator import SCRIPTS
from canshaper_sim.parameters import changed_parameters, parameter_names
from canshaper_sim.plant import FEEDBACK, JOINT_FEEDBACK, PlantNode
from tests.cli.invocation import invoke
from tests.rigs.files import ROOT, machine_file

TIP_FILE = ROOT / "config" / "forwarder.yaml"
JOINT_FILE = ROOT / "config" / "forwarder-joints.yaml"
KINDS = "tip, tip-controller, joints, overhead, tower, luffing"


def renamed(tmp_path: Path, file: Path, *changes: tuple[str, str]) -> Deployment:
    return load_deployment(machine_file(tmp_path, file, *changes))


def decoded(deployment: Deployment, frames: list[Frame]) -> dict[str, dict[str, Any]]:
    values: dict[str, Any] = {}
    for frame in frames:
        for name in (*FEEDBACK, *JOINT_FEEDBACK):
            entry = deployment.messages.find(name)
            assert not isinstance(entry, str)
            if entry[1].frame_id == frame.can_id:
                values[name] = entry[1].decode(frame.data)
    return values


def test_axes_choose_the_machine() -> None:
    assert machine_for(dict.fromkeys(TIP_AXES)) == "tip"
    assert machine_for({"slew": None}) == "tip"
    assert machine_for(dict.fromkeys(JOINT_AXES)) == "joints"
    assert machine_for({"knuckle": None}) == "joints"
    assert machine_for(dict.fromkeys(TIP_AXES), "tip-controller") == "tip-controller"
    for build in (partial(machine_for, {}), build_machine):
        with pytest.raises(ValueError, match=f"machine: expected one of {KINDS}, got 'crab'"):
            build("crab")
    assert [type(build_machine(name).crane.boom).__name__ for name in MACHINES] == [
        "TipBoom",
        "JointBoom",
        "JointBoom",
        "OverheadBoom",
        "RopedBoom",
        "RopedBoom",
    ]


def test_axes_that_the_machine_lacks_are_reported(tmp_path: Path) -> None:
    deployment = renamed(tmp_path, TIP_FILE, ("\n  near_far:", "\n  boom:"))
    expected = (
        r"axes.boom: the crane has slew, near_far, lift, or joint by joint"
        r" slew, lift_cylinder, knuckle, extension"
    )
    with pytest.raises(ConfigError, match=expected):
        PlantNode(deployment)
    mixed = renamed(tmp_path, TIP_FILE, ("\n  near_far:", "\n  knuckle:"))
    with pytest.raises(ConfigError, match=r"axes.lift: the crane has slew, lift_cylinder"):
        PlantNode(mixed)
    with pytest.raises(ConfigError, match=r"axes.knuckle: machine tip-controller has slew"):
        PlantNode(load_deployment(JOINT_FILE), machine="tip-controller")


def test_joints_need_their_feedback_messages(tmp_path: Path) -> None:
    dbc = tmp_path / "old.dbc"
    text = (ROOT / "dbc" / "forwarder.dbc").read_text()
    dbc.write_text(text.replace("1027 JointPosition", "1027 Other"))
    deployment = renamed(tmp_path, TIP_FILE, (str(ROOT / "dbc" / "forwarder.dbc"), str(dbc)))
    PlantNode(deployment)
    with pytest.raises(
        ConfigError, match="a message of the DBC files, got 'JointPosition'; there are"
    ):
        PlantNode(deployment, machine="tip-controller")


@pytest.mark.parametrize(("file", "machine"), [(TIP_FILE, "tip-controller"), (JOINT_FILE, None)])
def test_joint_feedback(file: Path, machine: str | None) -> None:
    deployment = load_deployment(file)
    plant = PlantNode(deployment, machine=machine)
    plant.advance(0.02)
    values = decoded(deployment, plant.feedback())
    assert [*values] == [*JOINT_FEEDBACK, *FEEDBACK]  # closes with the sway
    boom = plant.crane.boom
    assert isinstance(boom, JointBoom)
    slew, lift, knuckle, extension = boom.joints
    position = values["JointPosition"]
    assert position["SlewAngle"] == pytest.approx(math.degrees(slew), abs=0.01)
    assert position["LiftAngle"] == pytest.approx(math.degrees(lift), abs=0.01)
    assert position["KnuckleAngle"] == pytest.approx(math.degrees(knuckle), abs=0.01)
    assert position["Extension"] == pytest.approx(extension, abs=0.001)
    assert values["TipPosition"]["Radius"] == pytest.approx(3.0, abs=0.001)
    assert values["TipPosition"]["Height"] == pytest.approx(4.0, abs=0.001)


def test_the_tip_machine_sends_what_it_did() -> None:
    deployment = load_deployment(TIP_FILE)
    assert [*decoded(deployment, PlantNode(deployment).feedback())] == [*FEEDBACK]


def test_parameters_by_name() -> None:
    names = parameter_names()
    assert names["joints.main_boom_m"] == 3.7
    assert names["joints.knuckle.lag_s"] == 0.1
    assert names["tip_controller.lead_s"] == 0.12
    changed = changed_parameters(
        ["joints.main_boom_m=4.2", "joints.knuckle.lag_s=0.15", "slew.deadband=0.1"]
    )
    assert changed.joints.main_boom_m == 4.2
    assert changed.joints.knuckle.lag_s == 0.15
    assert changed.joints.lift_cylinder.lag_s == 0.1
    assert changed.slew.deadband == 0.1
    machine = TipControlledCrane(changed)
    boom = machine.crane.boom
    assert isinstance(boom, JointBoom)
    assert changed.joints.boom.tip(*boom.joints[1:]) == pytest.approx((3.0, 4.0), abs=1e-12)
    for change in ("joints.boom_m=1", "joints=1", "joints.knuckle=1", "joints.knuckle.lag_s.x=1"):
        with pytest.raises(ValueError, match=f"expected a parameter, got '{change[:-2]}'"):
            changed_parameters([change])
    with pytest.raises(ValueError, match=r"joints: main_boom_m: expected .*, got 99.0"):
        changed_parameters(["joints.main_boom_m=99"])


def test_a_script_for_the_other_kind_of_crane_is_refused() -> None:
    tip, joints = load_deployment(TIP_FILE), load_deployment(JOINT_FILE)
    JoystickNode(tip, SCRIPTS["pulse-slew"])
    JoystickNode(joints, SCRIPTS["pulse-slew"])
    with pytest.raises(ValueError, match="script demo moves slew, near_far, lift; the deployment"):
        JoystickNode(joints, SCRIPTS["demo"])
    with pytest.raises(DriveError, match="script pulse-knuckle moves knuckle; the deployment has"):
        drive(tip, SCRIPTS["pulse-knuckle"])
    with pytest.raises(DriveError, match=r"machine: expected .*, got 'crab'"):
        drive(tip, SCRIPTS["pulse-slew"], machine="crab")


def test_an_axis_that_the_deployment_merely_lacks_is_left_out(tmp_path: Path) -> None:
    text = TIP_FILE.read_text()
    lift = text[text.index("\n  lift:") : text.index("\nstatus:")]
    JoystickNode(renamed(tmp_path, TIP_FILE, (lift, "\n")), SCRIPTS["demo"])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["sim", str(JOINT_FILE), "--machine", "tip"], "axes.knuckle: machine tip has slew"),
        (
            ["sim", str(TIP_FILE), "--machine", "crab"],
            f"machine: expected one of {KINDS}, got 'crab'",
        ),
        (
            ["operator", str(JOINT_FILE), "--script", "pulse-near_far"],
            "script pulse-near_far moves",
        ),
    ],
)
def test_commands_report_what_does_not_fit(arguments: list[str], text: str) -> None:
    done = invoke(*arguments)
    assert done.exit_code == 2
    assert text in done.output
