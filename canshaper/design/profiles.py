"""Measures of each profile of a deployment after a full press on the simulated crane."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from canshaper.config.limits import Sway
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import drive
from canshaper.errors import DesignError
from canshaper.inputs.value import OWN, profile_names
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.report.metrics import AxisMetrics, axis_metrics
from canshaper_sim.crane import CraneParameters
from canshaper_sim.operator import Script, Stroke

# Error of the pendulum length at which profiles are compared: a usual error of sway data.
LENGTH_PCT = 15
_PRESS = (0.5, 3.0, 1.0, 0.1)  # start, duration, level, ramp
_DRIVE_S = 10.0


@dataclass(frozen=True)
class Figures:
    """Measures of a profile on one axis after a full press of 3 s.

    Attributes:
        axis: the axis.
        profile: name of the profile; ``OWN`` for the axis' own filter.
        still_s: from the release until the swing stays below ``still_deg`` of the file.
        swings_on: ``still_s`` is a lower bound: the grapple swings longer than the drive of 10 s.
        run_on_s: from the release until the tip is below 5 % of full speed.
        run_on_travel_s: travel after the release, seconds of full speed.
        peak_deg: largest swing.
        residual_deg: swing left at the right pendulum length.
        residual_wrong_deg: largest swing left with the pendulum length 15 % off.
    """

    axis: str
    profile: str
    still_s: float
    swings_on: bool
    run_on_s: float
    run_on_travel_s: float
    peak_deg: float
    residual_deg: float
    residual_wrong_deg: float


class Chosen:
    """A chooser with one fixed profile."""

    def __init__(self, name: str) -> None:
        self._name = name

    def name(self, _now_ns: int) -> str:
        """Return the name of the chosen profile."""
        return self._name


def choosing(name: str) -> Callable[[Controller], None]:
    """Return a function that fixes a new controller's profile; the load still sets its gains."""

    def choose(controller: Controller) -> None:
        for control in controller.axes.values():
            if control.chooser:
                control.chooser.profile = Chosen(name)

    return choose


def figures(deployment: Deployment, crane: CraneParameters) -> Iterator[Figures]:
    """Yield the measures of the own filter and of each profile, for each axis that has profiles.

    Raises:
        DesignError: the deployment has no profiles.
        DriveError: the simulated crane does not fit the deployment.
    """
    if len(profile_names(deployment.config)) == 1:
        raise DesignError("expected an axis with profiles, got none")
    for axis, bound in deployment.axes.items():
        for name in ["", *bound.config.profiles] if bound.config.profiles else []:
            right, *wrong = (
                _press(deployment, axis, name, replace(crane, grapple=crane.grapple.longer(pct)))
                for pct in (0, -LENGTH_PCT, LENGTH_PCT)
            )
            yield Figures(
                axis,
                name or OWN,
                right.still_s or 0.0,
                bool(right.swings_on),
                right.run_on_s or 0.0,
                right.run_on_travel or 0.0,
                right.peak_deg or 0.0,
                right.residual_deg or 0.0,
                max(one.residual_deg or 0.0 for one in wrong),
            )


def _press(deployment: Deployment, axis: str, name: str, crane: CraneParameters) -> AxisMetrics:
    script = Script("press", (Stroke(axis, *_PRESS),), _DRIVE_S)
    recording = drive(deployment, script, parameters=crane, prepare=choosing(name))
    return axis_metrics(recording, axis, deployment.config.still_deg)


def swinging_axis(deployment: Deployment, name: str) -> tuple[BoundAxis, Sway]:
    """Return an axis and its sway data.

    Raises:
        DesignError: no such axis, or it has no sway data; the message names those that have.
    """
    bound = deployment.axes.get(name)
    sway = bound.config.sway if bound else None
    if bound is None or sway is None:
        fault = "no sway data" if bound else "no such axis"
        having = ", ".join(n for n, a in deployment.axes.items() if a.config.sway) or "none here"
        raise DesignError(f"axis {name}: expected one with sway data, {having}, got {fault}")
    return bound, sway
