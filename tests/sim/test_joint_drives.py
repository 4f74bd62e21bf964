"""The closed loop with joints, in lock-step: through the tip controller, and joint by joint."""

from pathlib import Path

import pytest

from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.report.metrics import compare
from canshaper.report.stroke_metrics import crane_metrics
from canshaper_sim.axes import JOINT_AXES
from canshaper_sim.grapple import Sway
from canshaper_sim.machines import build_machine
from canshaper_sim.operator import SCRIPTS, random_script, script_for, script_named
from canshaper_sim.strokes import Script, Stroke
from tests.rigs.files import CONFIG, machine_file
from tests.rigs.swing import crane_of, last_swing

TICK_S = 0.02


def residual_reduction_pct(file: str, script: str, axis: str, machine: str | None = None) -> float:
    deployment = load_deployment(CONFIG / file)
    raw = drive(deployment, SCRIPTS[script], bypass=True, machine=machine)
    shaped = drive(deployment, SCRIPTS[script], machine=machine)
    reduction = compare(raw, shaped)[axis].residual_reduction_pct
    assert reduction is not None
    return reduction


@pytest.mark.slow
def test_near_far_pulse_through_the_tip_controller() -> None:
    """98.7 % where valves move the tip itself; four valves in the place of one cost a percent."""
    reduction_pct = residual_reduction_pct(
        "forwarder.yaml", "pulse-near_far", "near_far", "tip-controller"
    )
    assert reduction_pct >= 97.0
    assert reduction_pct <= residual_reduction_pct("forwarder.yaml", "pulse-near_far", "near_far")


@pytest.mark.slow
def test_slew_pulse_is_the_same_with_and_without_joints() -> None:
    """One joint and one valve in both."""
    with_joints = residual_reduction_pct("forwarder.yaml", "pulse-slew", "slew", "tip-controller")
    assert with_joints == pytest.approx(
        residual_reduction_pct("forwarder.yaml", "pulse-slew", "slew"), abs=0.5
    )


@pytest.mark.parametrize(
    ("axis", "least_pct"),
    # The filter expects tip speed in proportion to the command. Of the telescope that is nearly so;
    # lift and knuckle move the tip in an arc, and their share along the boom changes on the way.
    [("slew", 90.0), ("lift_cylinder", 88.0), ("knuckle", 86.0), ("extension", 96.0)],
)
def test_pulse_of_each_joint(axis: str, least_pct: float) -> None:
    assert residual_reduction_pct("forwarder-joints.yaml", f"pulse-{axis}", axis) >= least_pct


def left_deg(file: str, strokes: tuple[Stroke, ...]) -> tuple[float, float]:
    """Swing in the last 3 of 8 s after the strokes: raw, shaped."""
    deployment = load_deployment(CONFIG / file)
    script = Script("one", strokes, max(one.end_s for one in strokes) + 8.0)
    raw, shaped = (last_swing(drive(deployment, script, bypass=one)) for one in (True, False))
    return raw, shaped


def reversal(axis: str, level: float) -> tuple[Stroke, ...]:
    return Stroke(axis, 0.5, 1.2, level, 0.1), Stroke(axis, 1.7, 1.2, -level, 0.1)


def test_an_excavator_slews_with_a_tool_that_hangs_free() -> None:
    raw, shaped = left_deg("excavator.yaml", (Stroke("slew", 0.5, 1.2, 1.0, 0.1),))
    assert raw > 20.0
    assert shaped < 0.1 * raw


@pytest.mark.slow
def test_what_the_excavator_leaves_of_pulses_reversals_and_random_drives() -> None:
    deployment = load_deployment(CONFIG / "excavator.yaml")
    ways = [(axis, level) for axis in ("slew", "boom", "arm") for level in (1.0, -1.0)]
    drives = [(Stroke(axis, 0.5, 1.2, level, 0.1),) for axis, level in ways]
    drives += [reversal(axis, level) for axis, level in ways]
    drives += [script_for(deployment, f"random-{seed}").strokes for seed in range(4)]
    left = [left_deg("excavator.yaml", one) for one in drives]
    print([f"{raw:.1f} {shaped:.2f}" for raw, shaped in left])
    assert sum(shaped for _, shaped in left) < 0.07 * sum(raw for raw, _ in left)
    assert all(shaped < 0.1 * raw for raw, shaped in left)


@pytest.mark.slow
def test_a_telescope_is_no_near_far_axis(tmp_path: Path) -> None:
    """Why the shipped deployment has no motion: it knows nothing of lift and knuckle."""
    shipped = CONFIG / "forwarder-joints.yaml"
    radius = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 200"
    motion = f"slew: slew, near_far: extension, radius: {{ {radius} }}"
    file = machine_file(tmp_path, shipped, more=f"\nmotion: {{ crane: {{ {motion} }} }}\n")

    def left_deg(path: Path, script: str) -> float:
        recording = drive(load_deployment(path), script_named(script, JOINT_AXES))
        residual_deg = crane_metrics(recording, crane_of(recording)).residual_deg
        assert residual_deg is not None
        return residual_deg

    slew, loading = ((left_deg(shipped, s), left_deg(file, s)) for s in ("pulse-slew", "loading"))
    print(f"slew {slew[0]:.1f} and {slew[1]:.1f}, loading {loading[0]:.1f} and {loading[1]:.1f}")
    assert slew[1] < 0.5 * slew[0]
    assert loading[1] > 0.9 * loading[0]  # it takes nothing of the swing away


@pytest.mark.slow
def test_drive_joint_by_joint_is_recorded() -> None:
    deployment = load_deployment(CONFIG / "forwarder-joints.yaml")
    recording = drive(deployment, SCRIPTS["loading-joints"])
    assert tuple(recording.axes) == JOINT_AXES
    boom = [recording.axes[axis].sway_deg for axis in JOINT_AXES[1:]]
    assert boom[0] == boom[1] == boom[2]
    assert recording.axes["slew"].sway_deg != boom[0]
    for trace in recording.axes.values():
        assert max(map(abs, trace.joystick)) > 0.3
        assert max(map(abs, trace.sent)) > 0.2
        # The speed follows what was sent: shaped, it is never faster than the joystick asked.
        assert 0.2 < max(map(abs, trace.speed)) <= max(map(abs, trace.joystick)) + 0.02


@pytest.mark.parametrize("machine", ["tip", "tip-controller"])
def test_a_drive_may_start_with_a_swing(machine: str) -> None:
    deployment = load_deployment(CONFIG / "forwarder.yaml")
    swing = Sway(theta6_rad=0.1)
    recording = drive(deployment, SCRIPTS["pulse-slew"], machine=machine, sway=swing)
    sway_deg = recording.axes["near_far"].sway_deg
    assert sway_deg is not None
    assert sway_deg[0] == pytest.approx(5.7, abs=0.1)


def test_drives_are_bit_identical() -> None:
    deployment = load_deployment(CONFIG / "forwarder.yaml")
    script = SCRIPTS["pulse-near_far"]
    first = drive(deployment, script, machine="tip-controller")
    assert first == drive(deployment, script, machine="tip-controller")


@pytest.mark.parametrize(
    "name",
    ["pulse-lift_cylinder", "pulse-knuckle", "pulse-extension", "demo-joints", "loading-joints"]
    + [f"random-{seed}" for seed in range(4)]
    + [pytest.param(f"random-{seed}", marks=pytest.mark.slow) for seed in range(4, 12)],
)
def test_joint_scripts_keep_the_default_crane_off_its_stops(name: str) -> None:
    script = script_named(name, JOINT_AXES)
    assert set(script.axes) <= {*JOINT_AXES}
    machine = build_machine("joints")
    for k in range(round(script.duration_s / TICK_S)):
        machine.step(TICK_S, {axis: script.command(axis, k * TICK_S) for axis in JOINT_AXES})
        assert machine.crane.axes_at_stop == ()
    assert not machine.crane.swung_over


@pytest.mark.parametrize(
    "name",
    ["demo", "one-by-one", "loading", *(f"random-{seed}" for seed in range(3))]
    + [pytest.param(f"random-{seed}", marks=pytest.mark.slow) for seed in range(3, 6)],
)
def test_tip_scripts_keep_the_joints_off_their_stops(name: str) -> None:
    script = script_named(name)
    machine = build_machine("tip-controller")
    for k in range(round(script.duration_s / TICK_S)):
        machine.step(TICK_S, {axis: script.command(axis, k * TICK_S) for axis in script.axes})
        assert machine.crane.axes_at_stop == ()
    assert not machine.crane.swung_over


def test_random_scripts_take_the_axes_asked_for() -> None:
    script = script_named("random-3", JOINT_AXES)
    assert script == random_script(3, axes=JOINT_AXES)
    assert script.axes == JOINT_AXES
    assert script_named("random-3").axes == ("slew", "near_far", "lift")
