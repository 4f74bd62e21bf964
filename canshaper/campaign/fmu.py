"""The simulated crane in C as a co-simulation unit, for the controller of another tool."""

from collections.abc import Iterable
from pathlib import Path

from canshaper.campaign.native import grapple_numbers, is_simple, steps_of, valve_numbers
from canshaper.errors import ConfigError
from canshaper.machine.deployment import Deployment
from canshaper.native.fmu import Unit, Variable
from canshaper.native.library import real
from canshaper_sim.axes import LIFT, NEAR_FAR, SLEW, TIP_AXES
from canshaper_sim.cranes import cranes
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.unit import POSE, SWAY

FILES = Path(__file__).with_name("c")
_POSES = {
    SLEW: ("Slew angle, counter-clockwise from above", "rad"),
    NEAR_FAR: ("Distance of the tip from the slew axis", "m"),
    LIFT: ("Height of the tip", "m"),
}


def plant_unit(deployment: Deployment) -> Unit:
    """Return the simulated crane of a deployment as a unit.

    Raises:
        ConfigError: there are several cranes, or one that the C does not support: one with
            joints or a rope, a slope, wind or too little oil.
    """
    crane, axes = changed_parameters([], deployment), deployment.by_coordinate
    moves_tip = not {*deployment.coordinates.values()} - {*TIP_AXES}
    if not (moves_tip and is_simple(crane)) or len(cranes(deployment)) > 1:
        text = "expected one crane moved by its tip, on level ground, with oil enough, in a unit"
        raise ConfigError([deployment.source.problem(("crane",), text)])
    names = [axes.get(one, one) for one in TIP_AXES]
    outputs, speeds = list[Variable](), list[Variable]()
    for name, (moved, (text, unit)) in zip(names, _POSES.items(), strict=True):
        start, pose = valve_numbers(crane, moved)["start"], POSE[moved]
        outputs.append(Variable(f"{name}.{pose}", text, unit, start))
        speeds.append(Variable(f"{name}.speed", f"Speed of {pose}", f"{unit}/s"))
    for one, way in zip(SWAY, ("in slew direction", "towards the crane"), strict=True):
        outputs.append(Variable(one, f"Swing of the grapple {way}", "rad"))
        speeds.append(Variable(f"{one}_rate", f"Rate of {one}", "rad/s"))
    own, steps = "cs_unit_plant.c", steps_of(deployment.config.tick_ms)
    valves = ", ".join(_row(valve_numbers(crane, one).values()) for one in TIP_AXES)
    return Unit(
        "plant",
        f"Simulated crane of {deployment.path.name}: valves to swing",
        [Variable(f"{one}.command", "Of the valve, a part of its full one", "1") for one in names],
        [*outputs, *speeds],
        {
            "cs_crane.h": (FILES / "cs_plant.c").read_text(encoding="utf-8"),
            own: (FILES / own).read_text(encoding="utf-8"),
        },
        f"""\
#define R(x) (x)
#define CS_UNIT_CRANE {{{valves}}}
#define CS_UNIT_STEP_S {steps["step_s"].hex()}
#define CS_UNIT_STEPS {steps["steps"]}
#define CS_UNIT_GRAPPLE {_row(grapple_numbers(crane.grapple))}
""",
    )


def _row(values: Iterable[float]) -> str:
    return f"{{{', '.join(real(float(one)) for one in values)}}}"
