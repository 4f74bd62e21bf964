"""Together the axes ask for no more oil than the pump delivers."""

import pytest

from canshaper.codec.frame import Frame
from canshaper.config.load import load_config
from canshaper.controller.gated import GatedController
from canshaper.errors import ConfigError
from canshaper.shaping.states import Reason, State
from tests.rigs.files import ROOT
from tests.rigs.forwarder import Make, Rig
from tests.rigs.sent import status_frame

FULL = {"Slew": 1000, "NearFar": 1000}


@pytest.fixture
def pump() -> Rig:
    return Rig(ROOT / "config" / "forwarder-pump.yaml")


def commands(rig: Rig) -> list[float]:
    return [control.axis.demand for control in rig.controller.axes.values()]


def news(rig: Rig) -> list[str]:
    return [event.text for event in rig.controller.events if "hydraulics" in event.text]


def test_from_the_first_tick_on_both_are_slower_by_one_factor(pump: Rig) -> None:
    pump.run(3)
    pump.run(1, Slew=1000, NearFar=500)
    assert commands(pump) == pytest.approx([0.8, 0.4, 0.0])
    pump.run(1, **FULL)
    assert commands(pump) == pytest.approx([0.6, 0.6, 0.0])
    assert news(pump) == ["hydraulics=scaled speed_pct=80"]


def test_one_axis_has_all_it_asks_for(pump: Rig) -> None:
    pump.run(3)
    pump.run(50, Slew=1000)
    assert commands(pump) == [1.0, 0.0, 0.0]
    assert news(pump) == []


def test_what_runs_on_still_takes_its_oil(pump: Rig) -> None:
    pump.run(3)
    pump.run(150, **FULL)
    pump.run(1, Slew=1000)
    assert pump.controller.axes["near_far"].axis.output.setpoint > 0.4
    assert commands(pump)[0] < 0.65
    pump.run(250, Slew=1000)
    assert commands(pump)[0] == 1.0


def test_that_there_is_enough_again_is_reported_after_five_seconds(pump: Rig) -> None:
    pump.run(3)
    for _ in range(3):  # a line for all of it
        pump.run(50, **FULL)
        pump.run(100)
    assert len(news(pump)) == 1
    pump.run(260)
    assert news(pump)[1:] == ["hydraulics=enough"]


def test_in_bypass_the_crane_is_as_it_is(pump: Rig) -> None:
    pump.run(3, AntiSwayOff=1)
    pump.run(20, **FULL, AntiSwayOff=1)
    assert commands(pump)[:2] == [1.0, 1.0]


def test_a_little_that_is_scaled_is_no_neutral(pump: Rig) -> None:
    """Nothing is armed by a joystick that is held, however little of it is left."""
    rig = pump
    rig.run(10, Slew=1000, NearFar=25, Lift=1000)
    assert rig.state("near_far") is State.NEUTRAL_WAIT
    assert rig.reason("near_far") == "JOYSTICK_NOT_NEUTRAL"
    rig.run(3)
    rig.run(5, Slew=1000, NearFar=25, Lift=1000)
    assert rig.state("near_far") is State.ACTIVE


def test_a_joystick_that_is_lost_asks_for_nothing_more(pump: Rig) -> None:
    pump.run(3)
    pump.run(50, Slew=600, Lift=1000)
    for _ in range(200):  # the left joystick, which has slew and near-far, is silent
        pump.receive(pump.joystick("JoystickRight", Lift=1000))
        pump.tick()
    assert pump.state("slew") is State.NEUTRAL_WAIT
    assert commands(pump) == [0.0, 0.0, 1.0]


def test_shares_and_others_count(changed_rig: Make) -> None:
    oil = "hydraulics: { flow: 1.5, others: 0.3, shares: { near_far: 2 } }"
    rig = changed_rig({"axes:\n": f"{oil}\naxes:\n"})
    rig.run(3)
    rig.run(1, **FULL)
    assert commands(rig) == pytest.approx([0.4, 0.4, 0.0])


def test_the_gate_passes_whatever_third_lever_joins(pump: Rig) -> None:
    gated = GatedController(pump.controller)
    levers = [{}, {"Slew": 1000}, FULL, {**FULL, "Lift": 1000}, {"Lift": -1000}, FULL, {}]
    for raw in levers:
        for _ in range(60):
            left = {k: v for k, v in raw.items() if k != "Lift"}
            right = {k: v for k, v in raw.items() if k == "Lift"}
            for frame in (
                pump.joystick("JoystickLeft", **left),
                pump.joystick("JoystickRight", **right),
            ):
                gated.receive(frame, pump.now_ns)
            list(gated.tick(pump.now_ns))
            pump.now_ns += 20_000_000
    assert not any("refused" in event.text for event in pump.controller.events)


@pytest.mark.parametrize(
    ("oil", "why"),
    [
        (
            "{ flow: 1.2, shares: { boom: 1 } }",
            "shares.boom: expected an axis, got 'boom'; there are slew,",
        ),
        ("{ flow: 1.2, others: 1.2 }", "others: expected less than the flow, got 1.2"),
        ("{ flow: 0 }", "hydraulics.flow: expected 0.1 to 100 full axis flows, got 0"),
        ("{ shares: { slew: 1 } }", "hydraulics.flow: missing"),
    ],
)
def test_what_cannot_be_is_refused(changed_rig: Make, oil: str, why: str) -> None:
    with pytest.raises(ConfigError) as refused:
        changed_rig({"axes:\n": f"hydraulics: {oil}\naxes:\n"})
    assert why in str(refused.value)


def test_the_shipped_file_differs_in_the_oil_and_the_ends_only() -> None:
    pump, robust = (
        load_config(ROOT / "config" / f"forwarder-{name}.yaml")[0] for name in ("pump", "robust")
    )
    assert pump.hydraulics is not None
    oil, near_far = pump.hydraulics, pump.axes["near_far"]
    limits = near_far.limits.model_copy(update={"ends": None})
    axes = pump.axes | {"near_far": near_far.model_copy(update={"limits": limits})}
    usual = {"hydraulics": None, "axes": axes, "uncertainty": robust.uncertainty}
    assert pump.model_copy(update=usual) == robust
    assert oil.flow == 1.2


SAW = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 200, full: 10"


def with_saw(make: Make, others: float) -> Rig:
    oil = f"{{ flow: 1.5, others: {others}, others_measured: {{ {SAW} }} }}"
    return make({"axes:\n": f"hydraulics: {oil}\naxes:\n"})


def saw(rig: Rig, flow: float) -> None:
    message = rig.message("TipPosition")
    values = {"SlewAngle": 0, "Radius": flow, "Height": 0}
    rig.receive(Frame("crane", message.frame_id, False, message.encode(values)))


@pytest.mark.parametrize(("others", "left"), [(0.0, 0.75), (0.3, 0.6), (1.5, 0.0)])
def test_what_others_take_is_measured_and_the_constant_counts_while_it_is_lost(
    changed_rig: Make, others: float, left: float
) -> None:
    rig = with_saw(changed_rig, others)
    rig.run(3)
    saw(rig, 5.0)
    rig.run(1, **FULL)
    assert commands(rig) == pytest.approx([0.5, 0.5, 0.0])
    rig.run(100, **FULL)
    assert commands(rig) == pytest.approx([left, left, 0.0])
    saw(rig, 15.0)
    rig.run(1, **FULL)
    assert commands(rig) == [0.0, 0.0, 0.0]
    lost = [line for line in news(rig) if "others" in line]
    assert lost[-2:] == ["hydraulics_others=lost", "hydraulics_others=known"]


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ("full: 90", "hydraulics.others_measured.full: expected a flow within the range of Radius"),
        ("full: 0", "hydraulics.others_measured.full: expected 1e-06 to 1e+06 units, got 0"),
        ("signal: Speed", "hydraulics.others_measured.signal: "),
    ],
)
def test_a_measured_flow_that_cannot_be_is_refused(changed_rig: Make, keys: str, why: str) -> None:
    name = keys.partition(":")[0]
    oil = ", ".join(keys if one.startswith(name) else one for one in SAW.split(", "))
    with pytest.raises(ConfigError) as refused:
        text = f"hydraulics: {{ flow: 1.5, others_measured: {{ {oil} }} }}"
        changed_rig({"axes:\n": f"{text}\naxes:\n"})
    assert why in str(refused.value)


def test_its_reason_says_that_the_pump_gives_no_more(pump: Rig) -> None:
    pump.run(3)
    pump.run(30, **FULL)
    axes = pump.controller.axes
    reasons = [axis.reason for axis in axes.values()]
    assert reasons == [Reason.FLOW_LIMITED, Reason.FLOW_LIMITED, Reason.JOYSTICK_NEUTRAL]
    frame = status_frame(axes["slew"].bound.status, axes["slew"])
    sent = pump.message("SlewStatus").decode(frame.data, decode_choices=False)
    assert sent["Reason"] == Reason.FLOW_LIMITED
    pump.run(20)  # runs on
    assert axes["slew"].reason is Reason.JOYSTICK_MOVED
    pump.run(150, Slew=1000)
    assert axes["slew"].reason is Reason.JOYSTICK_MOVED
