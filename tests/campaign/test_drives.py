"""Draws of a campaign, and its measures of a drive."""

import math
import re
from pathlib import Path

import pytest

from canshaper.campaign.draw import Setting, draw_drive
from canshaper.campaign.measure import measured_drive
from canshaper.campaign.operators import OPERATORS, REST_S
from canshaper.config.desk import MEASURES, Uncertainty
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import Simulation, drive
from canshaper.machine.binding import load_deployment
from canshaper.report.stroke_metrics import crane_metrics
from canshaper.shaping.axis import ShapedAxis
from canshaper_sim.crane import CraneParameters
from canshaper_sim.recorder import dwell_s
from tests.faults.shipped import NAMES
from tests.rigs.files import CONFIG, text_of
from tests.rigs.swing import crane_of

ROBUST = load_deployment(CONFIG / "forwarder-robust.yaml")
SENSOR = load_deployment(CONFIG / "forwarder-sensor.yaml")
RANGES = Uncertainty()


def settings(count: int, ranges: Uncertainty = RANGES) -> list[Setting]:
    return [draw_drive(SENSOR, seed, ranges) for seed in range(count)]


def test_the_same_seed_is_the_same_drive_in_any_order() -> None:
    there = [draw_drive(ROBUST, seed, RANGES) for seed in range(20)]
    back = [draw_drive(ROBUST, seed, RANGES) for seed in reversed(range(20))]
    for one, other in zip(there, reversed(back), strict=True):
        assert (one.factors, one.script, one.fault) == (other.factors, other.script, other.fault)


def test_two_files_meet_the_same_crane_and_operator() -> None:
    plain = load_deployment(CONFIG / "forwarder.yaml")
    for seed in range(20):
        one, other = draw_drive(ROBUST, seed, RANGES), draw_drive(plain, seed, RANGES)
        assert (one.factors, one.script) == (other.factors, other.script)
        assert one.options["parameters"] == other.options["parameters"]


def test_other_tails_meet_the_same_drive_and_are_judged_from_the_same_time(tmp_path: Path) -> None:
    file = tmp_path / "longer.yaml"
    file.write_text(re.sub(r"tail_s: [\d.]+", "tail_s: 6", text_of(ROBUST.path)))
    longer = load_deployment(file)
    ranges = Uncertainty(load_change_pct=100.0, bus_fault_pct=50.0)
    for seed in range(20):
        one = draw_drive(ROBUST, seed, ranges, longest_s=dwell_s(longer))
        other = draw_drive(longer, seed, ranges)
        assert (one.factors, one.script, one.fault) == (other.factors, other.script, other.fault)
        assert [at for at, _ in one.options["loads"]] == [at for at, _ in other.options["loads"]]
        assert one.dwell_s == other.dwell_s == 6.0


def test_a_length_that_the_crane_lacks_is_recorded_as_it_was_driven() -> None:
    ranges = Uncertainty(radius_m=[30.0, 40.0], stops_pct=100.0)
    assert draw_drive(SENSOR, 1, Uncertainty(radius_m=[30.0, 40.0])).factors["radius_m"] < 10.0
    joints = load_deployment(CONFIG / "forwarder-joints.yaml")
    assert draw_drive(joints, 1, ranges).factors["near_stop"] == 0.0


def test_numbers_fill_their_ranges_and_do_not_leave_them() -> None:
    drawn = settings(400)
    for name, (low, high), scale in (
        ("length_pct", RANGES.length_pct, 1.0),
        ("damping_pct", RANGES.damping_pct, 1.0),
        ("radius_m", RANGES.radius_m, 1.0),
        ("slew_lag_s", RANGES.valve_lag_s, 1.0),
        ("near_far_rate_limit_1_s", RANGES.valve_rate_per_s, 1.0),
        ("slew_deadband", RANGES.valve_deadband_pct, 0.01),
        ("slew_hysteresis", RANGES.valve_hysteresis_pct, 0.01),
        ("near_far_gain_pct", RANGES.valve_gain_pct, 1.0),
        ("slew_dead_time_s", RANGES.valve_dead_time_s, 1.0),
    ):
        values = [one.factors[name] for one in drawn]
        tenth = 0.1 * scale * (high - low)
        assert scale * low <= min(values) <= scale * low + tenth, name
        assert scale * high - tenth <= max(values) <= scale * high + 1e-12, name


def test_the_crane_is_what_was_drawn() -> None:
    nominal = CraneParameters()
    for one in settings(20):
        crane, factors = one.options["parameters"], one.factors
        assert crane is not None
        assert crane.grapple.l2_m == nominal.grapple.longer(factors["length_pct"]).l2_m
        assert crane.start_radius_m == factors["radius_m"]
        assert crane.near_far.lag_s == factors["near_far_lag_s"]
        assert crane.slew.rate_limit_1_s == factors["slew_rate_limit_1_s"]
        gain = 1.0 + factors["slew_gain_pct"] / 100.0
        assert crane.slew_full_speed_rad_s == gain * nominal.slew_full_speed_rad_s


def test_loads_and_faults_come_as_often_as_the_file_says() -> None:
    drawn = settings(600)
    loaded = [one for one in drawn if one.options["loads"]]
    assert abs(len(loaded) / 600 - RANGES.load_change_pct / 100.0) < 0.06
    assert all(one.factors["load_mass"] == 1.0 for one in drawn if one not in loaded)
    kinds = {one.fault for one in drawn}
    assert {"joystick lost", "joystick late", "joystick garbled", "joystick silent"} <= kinds
    assert {"sensor lost", "sensor stuck", "sensor reversed", "sensor jump"} <= kinds
    none = Uncertainty(load_change_pct=0, bus_fault_pct=0, sensor_fault_pct=0)
    assert all(not one.fault and not one.options["loads"] for one in settings(50, none))


def test_every_operator_ends_with_a_rest_in_which_the_residual_shows() -> None:
    drawn = settings(100)
    assert {one.operator for one in drawn} == {*OPERATORS}
    for one in drawn:
        end_s = max((stroke.end_s for stroke in one.script.strokes), default=0.0)
        assert one.script.duration_s == pytest.approx(end_s + REST_S)


@pytest.mark.parametrize("name", NAMES)
def test_any_shipped_deployment_can_be_driven(name: str) -> None:
    deployment = load_deployment(CONFIG / f"{name}.yaml")
    row = measured_drive(deployment, 1, RANGES)
    assert row["broken"] == 0
    assert {*MEASURES} < {*row}


@pytest.mark.parametrize("seed", [0, 2, 5, 11])
def test_what_is_measured_on_the_fly_is_what_the_recorded_drive_shows(seed: int) -> None:
    setting = draw_drive(ROBUST, seed, RANGES)
    recording = drive(ROBUST, setting.script, **setting.options)
    recorded = crane_metrics(recording, crane_of(recording))
    row = measured_drive(ROBUST, seed, RANGES)
    # The frames have steps of 0.01 deg, 1 mm, and a hundredth of the speed where it stands.
    assert row["residual_deg"] == pytest.approx(recorded.residual_deg, abs=0.02)
    assert row["peak_deg"] == pytest.approx(recorded.peak_deg, abs=0.02)
    assert row["run_on_m"] == pytest.approx(recorded.run_on_m, abs=0.01)


@pytest.mark.slow
def test_a_drive_does_not_depend_on_those_before_it() -> None:
    alone = measured_drive(load_deployment(ROBUST.path), 4, RANGES)
    deployment = load_deployment(ROBUST.path)
    for seed in (8, 0):
        measured_drive(deployment, seed, RANGES)
    assert measured_drive(deployment, 4, RANGES) == alone


def test_a_frame_that_the_gate_refuses_is_a_broken_promise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert measured_drive(ROBUST, 2, RANGES)["broken"] == 0
    command = ShapedAxis.command

    def runs_on(self: ShapedAxis, *arguments: object, **named: object) -> object:
        transition = command(self, *arguments, **named)  # type: ignore[arg-type]
        if self.output.steps and abs(self.output.steps) < 60:  # a little faster than anybody asked
            self.output.steps += 3 if self.output.steps > 0 else -3
        return transition

    monkeypatch.setattr(ShapedAxis, "command", runs_on)
    row = measured_drive(ROBUST, 2, RANGES)
    assert row["broken"] > 0
    assert "output=refused" in row["why"]


@pytest.mark.slow
def test_late_lost_and_garbled_frames_reach_the_controller_as_such() -> None:
    kinds = {}
    for seed in range(300):
        setting = draw_drive(ROBUST, seed, RANGES)
        if setting.fault and setting.fault not in kinds:
            simulation = Simulation(ROBUST, setting.script, **setting.options)
            states = {
                control.axis.state for _ in simulation.ticks() for control in _axes(simulation)
            }
            kinds[setting.fault] = len(states)
    assert {*kinds} == {f"joystick {one}" for one in ("lost", "late", "garbled", "silent")}
    assert max(kinds.values()) > 2  # some stop


def _axes(simulation: Simulation) -> list:
    controller: Controller = simulation.controller
    return [*controller.axes.values()]


# -- pump, ground, wind and stops ------------------------------------------------------------------

OUTSIDE = Uncertainty(
    pump_flow=[1.1, 1.5],
    starved_pct=50,
    slope_deg=[0, 10],
    rock_hz=[0.8, 1.5],
    wind_m_s=[0, 8],
    stops_pct=50,
)


def test_by_default_the_crane_stands_level_in_still_air_with_all_the_oil() -> None:
    nominal = CraneParameters()
    for setting in settings(50):
        crane = setting.options["parameters"]
        assert crane is not None
        assert (crane.pump_flow, crane.carrier) == (nominal.pump_flow, nominal.carrier)
        assert crane.wind.speed_m_s == crane.wind.gust_m_s == 0.0
        assert crane.start_radius_m == pytest.approx(setting.factors["radius_m"])


def test_what_is_outside_of_the_crane_changes_nothing_else_of_a_drive() -> None:
    for one, other in zip(settings(30), settings(30, OUTSIDE), strict=True):
        assert one.script == other.script
        for name in ("length_pct", "slew_lag_s", "near_far_gain_pct", "load_mass"):
            assert one.factors[name] == other.factors[name]


def test_pump_ground_wind_and_stops_reach_the_crane() -> None:
    near = starved = 0
    for setting in settings(200, OUTSIDE):
        crane, of = setting.options["parameters"], setting.factors
        assert crane is not None
        assert 1.1 <= crane.pump_flow == of["pump_flow"] <= 1.5
        assert crane.pump.shares_flow == 1.0 - of["starved"]
        assert abs(crane.carrier.pitch_deg) <= 10.0 >= abs(crane.carrier.roll_deg)
        assert 0.8 <= crane.carrier.rock_hz <= 1.5
        assert crane.wind.gust_m_s == 0.25 * crane.wind.speed_m_s <= 2.0
        starved += int(of["starved"])
        if of["near_stop"]:
            near += 1
            assert of["radius_m"] == crane.start_radius_m
            assert min(crane.start_radius_m - 1.8, 8.0 - crane.start_radius_m) <= 1.5
    assert 70 <= near <= 130
    assert 70 <= starved <= 130


def test_what_a_slope_holds_askew_is_no_swing() -> None:
    still = {"load_change_pct": 0, "bus_fault_pct": 0, "sensor_fault_pct": 0, "sway_deg": [0, 0]}
    askew = Uncertainty(**still, slope_deg=[8, 8])
    level = Uncertainty(**still)
    for seed in (1, 2):
        one, other = (measured_drive(ROBUST, seed, ranges) for ranges in (askew, level))
        assert abs(one["residual_deg"] - other["residual_deg"]) < 2.0
        assert one["raw_deg"] > 0.0


def test_each_sound_drive_is_driven_with_anti_sway_off_too() -> None:
    setting = draw_drive(ROBUST, 3, RANGES)
    row = measured_drive(ROBUST, 3, RANGES)
    assert not setting.fault
    raw = drive(ROBUST, setting.script, **{**setting.options, "bypass": True})
    left = crane_metrics(raw, crane_of(raw)).residual_deg
    assert row["raw_deg"] == pytest.approx(left, rel=0.02)


def test_a_drive_that_swings_over_ends_there_and_counts_with_what_it_has_swung(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("canshaper_sim.crane._HORIZONTAL", math.radians(4.0))
    row = measured_drive(ROBUST, 3, RANGES)
    assert row["swung_over"]
    assert row["residual_deg"] == row["peak_deg"] > 0.0
    assert row["raw_deg"] >= 4.0
