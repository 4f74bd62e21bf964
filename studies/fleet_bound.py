"""What no shaper can leave less of for a fleet: ``python -m studies.fleet_bound`` (minutes).

The fleet that judges ``robust --fleet``, linear: a pendulum in each plane, with the drawn length,
damping, load, full speed and first swing, and no limits. Of each drive the swing left is then the
size of a linear function of the taps, and the mean of the worst twentieth convex in them. With the
drives themselves it is told what the limits add: a reversal that is cut off, and one that is not.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from canshaper.campaign import fleet
from canshaper.campaign.draw import Setting
from canshaper.campaign.fleet_candidates import (
    JUDGING,
    ROBUST,
    Candidate,
    Driven,
    FleetFilter,
    designed,
    fitted,
)
from canshaper.campaign.native import NativeCrane
from canshaper.campaign.run import Source
from canshaper.campaign.statistics import quantile
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.parameters import changed_parameters

FILE = Path(__file__).resolve().parents[1] / "config/forwarder-robust.yaml"
AXES = ("slew", "near_far")
DURATION_S, TICK_S, RATE, WORST, LATER_S = 1.8, 0.02, 5.0, 0.05, 2.5
TAPS = round(DURATION_S / TICK_S) + 1
Floats = NDArray[np.float64]


def plane(setting: Setting, axis: str) -> tuple[Floats, Floats]:
    """Swing 2.5 s after the release, deg: of a tap at each tick (2, TAPS), and of the first one."""
    p, script = setting.options["parameters"], setting.script
    assert p
    count = round((max(one.end_s for one in script.strokes) + LATER_S) / TICK_S)
    times_s = TICK_S * np.arange(count)
    own, full, first = "mode6", p.near_far_full_speed_m_s, 1
    commands = np.array([script.command(axis, at) for at in times_s])
    speed = full * commands
    if axis == "slew":
        out = np.array([script.command("near_far", at) for at in times_s])
        radius_m = p.start_radius_m + full * TICK_S * np.cumsum(out)
        own, first = "mode5", 0
        radius_m = np.clip(radius_m, p.radius_min_m, p.radius_max_m)
        speed = p.slew_full_speed_rad_s * commands * radius_m
    hanging = [p.grapple] * count
    for at_s, grapple in setting.options.get("loads", ()):
        at = math.ceil(at_s / TICK_S - 1e-9)
        hanging[at:] = [grapple] * len(hanging[at:])
    until, answers, turns = np.eye(2), np.zeros((2, count)), dict[int, Floats]()
    for k in range(count - 1, -1, -1):
        mode, key = getattr(hanging[k], own), id(hanging[k])
        if key not in turns:
            omega = mode.omega_rad_s
            turns[key] = expm(TICK_S * np.array([[0, 1], [-(omega**2), -2 * mode.zeta * omega]]))
        until = until @ turns[key]
        answers[:, k] = until[:, 1] * mode.gain_1_m
    scale = np.array([1.0, 1.0 / getattr(hanging[-1], own).omega_rad_s])
    changes = np.diff(speed, prepend=0.0)
    tapped = [answers[:, k:] @ changes[: count - k] for k in range(TAPS)]
    begun = until[:, 0] * (setting.options.get("sway") or (0.0, 0.0))[first]
    return np.degrees(scale[:, None] * np.array(tapped).T), np.degrees(scale * begun)


def least(tapped: Floats, begun: Floats) -> tuple[float, list[Floats]]:
    """The least mean of the worst twentieth that taps within the valve's rate can leave, deg."""
    taps = [casadi.MX.sym(axis, TAPS) for axis in AXES]
    level, over = casadi.MX.sym("level"), casadi.MX.sym("over", len(tapped))
    squares: Any = 1e-6
    for k, own in enumerate(taps):
        for i in range(2):
            squares += (casadi.DM(tapped[:, k, i]) @ own + casadi.DM(begun[:, k, i])) ** 2
    sums = [casadi.sum1(own) - 1.0 for own in taps]
    problem: Any = {
        "x": casadi.vertcat(*taps, level, over),
        "f": level + casadi.sum1(over) / (WORST * len(tapped)),
        "g": casadi.vertcat(casadi.sqrt(squares) - level - over, *sums),
    }
    solver = casadi.nlpsol("s", "ipopt", problem, {"ipopt.print_level": 0, "print_time": 0})
    two, drives = 2 * TAPS, len(tapped)
    found = solver(
        x0=[1.0 / TAPS] * two + [10.0] + [1.0] * drives,
        lbx=[0.0] * two + [0.0] * (1 + drives),
        ubx=[RATE * TICK_S] * two + [math.inf] * (1 + drives),
        lbg=[-math.inf] * drives + [0.0] * 2,
        ubg=[0.0] * (drives + 2),
    )
    x = np.array(found["x"]).ravel()
    return float(found["f"]), [x[:TAPS], x[TAPS:two]]


def show(name: str, left: list[float]) -> None:
    """Print what drives leave."""
    worst = Driven(None, (), left).worst_deg
    print(f"{name:32} worst twentieth {worst:5.2f}  p99 {quantile(left, 0.99).value:5.2f} deg")


def driven(deployment: Deployment, filters: list[FleetFilter], reversal_s: float) -> Deployment:
    """The machine with these filters, and with another time that a reversal runs on."""
    made = fitted(deployment, filters)
    axes = dict(made.axes)
    for name in AXES:
        config = axes[name].config
        limits = config.limits.model_copy(update={"reversal_s": reversal_s})
        axes[name] = replace(axes[name], config=config.model_copy(update={"limits": limits}))
    return replace(made, axes=axes)


def main() -> None:
    """Print what box, design and the best taps leave."""
    deployment = load_deployment(FILE)
    source = Source.of(deployment, deployment.config.uncertainty)
    drives = fleet._drives(source.path, source.files, JUDGING)
    pairs = [[plane(one, axis) for axis in AXES] for one in drives]
    tapped = np.array([[of[0] for of in pair] for pair in pairs])
    begun = np.array([[of[1] for of in pair] for pair in pairs])

    def linear(taps: list[Floats]) -> list[float]:
        swing = [tapped[:, k] @ own + begun[:, k] for k, own in enumerate(taps)]
        size: list[float] = np.sqrt(np.sum(np.square(swing), axis=(0, 2))).tolist()
        return size

    low, high = fleet._lengths(deployment)
    middle = low + 0.3 * (high - low)
    bounds = {"box of lengths": (low, high), "for the fleet": (0.8 * middle, 1.2 * middle)}
    for name, ends in bounds.items():
        candidate = Candidate(ROBUST, *ends, DURATION_S)
        filters = [designed(deployment, axis, candidate) for axis in AXES]
        shapers = [fitted(deployment, filters).axes[axis].config.filter for axis in AXES]
        taps = [np.array(one.parameters()["taps"]) for one in shapers]
        show(f"linear, {name}", linear([np.pad(one, (0, TAPS - len(one))) for one in taps]))
        for reversal_s in (0.45, 2.2):
            crane = NativeCrane(driven(deployment, filters, reversal_s), keeps=False)
            nominal = changed_parameters([], deployment)
            both = [crane.drive(one, nominal) for one in drives]
            left = [one["peak_deg" if over else "residual_deg"] or 0.0 for one, over in both]
            show(f"{name}, reversal_s {reversal_s:g}", left)
    bound, best = least(tapped, begun)
    show("linear, the best taps", linear(best))
    print(f"bound: {bound:.2f} deg")


if __name__ == "__main__":
    main()
