"""Machines with every part that the C has: filters, limits, motions, periods, fields, joysticks."""

from collections.abc import Callable
from typing import Any

import yaml

from canshaper.config.source import Source
from tests.rigs.files import CONFIG, Machine

SHIPPED = (
    *("forwarder", "forwarder-gff", "forwarder-joints", "forwarder-robust"),
    *("bridge-crane-hook", "multicopter"),
)
Change = Callable[[dict[str, Any], Machine], None]


def changed(machine: Machine, change: Change, base: str = "forwarder-robust.yaml") -> Machine:
    """The shipped machine with a change of its data, and of its DBC file."""
    machine.become(base, "forwarder.dbc")
    data = Source(CONFIG / base).data
    data["dbc"] = ["machine.dbc"]
    for axis in data["axes"].values():
        axis["limits"].pop("stop_distance_m", None)
        if "sway" in axis:
            axis["limits"]["stop_distance_m"] = 200.0
    change(data, machine)
    machine.yaml = yaml.safe_dump(data, sort_keys=False)
    return machine


def filtered(**parameters: Any) -> Change:
    """Both axes that swing with the same filter."""

    def change(data: dict[str, Any], _machine: Machine) -> None:
        for name in ("slew", "near_far"):
            data["axes"][name]["filter"] = parameters

    return change


def limited(slew: dict[str, Any], near_far: dict[str, Any]) -> Change:
    """Both of them with other limits."""

    def change(data: dict[str, Any], _machine: Machine) -> None:
        data["axes"]["slew"]["limits"] |= slew
        data["axes"]["near_far"]["limits"] |= near_far

    return change


def circle(data: dict[str, Any], _machine: Machine) -> None:
    motion = data["motion"]["crane"]
    del motion["radius"]
    motion |= {"radius_m": 6.0, "max_pct": 10.0, "max_path_m": 0.05, "max_s": 0.5}


def slew_alone(data: dict[str, Any], _machine: Machine) -> None:
    data["motion"]["crane"] = {"slew": "slew"}


def no_motion(data: dict[str, Any], _machine: Machine) -> None:
    del data["motion"]


def periods(data: dict[str, Any], _machine: Machine) -> None:
    """Ticks of 10 ms, near-far every second one, slew every third one."""
    data["tick_ms"] = 10
    for name, cycle_ms in (("slew", 30), ("near_far", 20), ("lift", 10)):
        data["axes"][name]["valve"] |= {"cycle_ms": cycle_ms}
    for name in ("slew", "near_far"):
        data["axes"][name]["filter"] = {"kind": "zv"}


def joysticks(data: dict[str, Any], _machine: Machine) -> None:
    data["joysticks"]["left"] |= {"qualify": 3, "alive_max_step": 1, "stuck_s": 1.0}
    del data["joysticks"]["right"]["alive_counter"], data["joysticks"]["right"]["reset"]
    data["joysticks"]["right"]["timeout_ms"] = 60


def motorola(data: dict[str, Any], machine: Machine) -> None:
    """Both valves in one message, high bytes first, one of them counting backwards."""
    machine.in_dbc(" SG_ Slew : 0|16@1- (0.1,0)", " SG_ Slew : 7|16@0- (0.1,0)")
    machine.in_dbc(" SG_ AliveCounter : 56|8@1+", " SG_ AliveCounter : 59|4@0+")
    machine.in_dbc(" SG_ Radius : 16|16@1+ (0.001,0)", " SG_ Radius : 23|16@0+ (0.001,0.5)")
    machine.in_dbc("BO_ 512 SlewCommand: 2 SHAPER", "BO_ 512 SlewCommand: 6 SHAPER")
    machine.in_dbc(
        " SG_ Velocity : 0|8@1- (0.8,0) [-100|100]",
        ' SG_ Other : 20|12@0+ (-0.1,100) [-100|100] "%" VALVES\n'
        " SG_ Velocity : 0|8@1- (0.8,0) [-100|100]",
    )
    machine.in_dbc(" SG_ AliveCounter : 8|8@1+", " SG_ AliveCounter : 8|4@1+")
    data["axes"]["near_far"]["valve"] |= {"message": "SlewCommand", "signal": "Other"}
    data["joysticks"]["left"]["alive_max_step"] = 2


VARIANTS: dict[str, Change] = {
    "zv": filtered(kind="zv"),
    "zvd": filtered(kind="zvd"),
    "ei": filtered(kind="ei", residual_pct=5.0),
    "two_mode": filtered(kind="two_mode", period_s=0.9, damping_ratio=0.02),
    "first_order": filtered(kind="first_order", time_constant_s=0.3),
    "s_curve": filtered(kind="s_curve", rate_per_s=1.0, jerk_per_s2=6.0),
    "gff": filtered(kind="gff", poles_rad_s=[-4.0, -5.0], third_pole_rad_s=-4.0),
    "off": filtered(kind="off"),
    "faster": limited(
        {"allow_faster": True, "rise_per_s": 2.0, "max_pct": 80.0, "reversal": "stop"},
        {"allow_reverse": True, "fall_per_s": 3.0, "min_pct": 3.0},
    ),
    "tight": limited(
        {"stop_distance_m": 1.6, "reversal_s": 0.3, "tail_s": 1.0},
        {"stop_distance_m": 0.6, "reversal": "stop", "tail_s": 0.0, "deadband_pct": 0.0},
    ),
    "curve": limited(
        {
            "deadband_pct": 0.0,
            "curve_command_pct": [-100.0, -60.0, -8.0, 6.0, 50.0, 100.0],
            "curve_speed_pct": [-90.0, -40.0, 0.0, 0.0, 45.0, 100.0],
        },
        {"rise_per_s": 0.5, "fall_per_s": 1.0},
    ),
    "circle": circle,
    "slew_alone": slew_alone,
    "no_motion": no_motion,
    "periods": periods,
    "joysticks": joysticks,
    "motorola": motorola,
}
