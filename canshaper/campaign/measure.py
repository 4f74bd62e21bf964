"""Drive and measure one drive of a campaign; no frame is recorded."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from canshaper.campaign.draw import Setting, draw_drive, driven_axes, on_unit
from canshaper.campaign.native import NativeCrane
from canshaper.config.desk import Uncertainty
from canshaper.controller.events import RefusalEvent
from canshaper.design.lockstep import DriveOptions, Simulation, driven_part
from canshaper.errors import CampaignError
from canshaper.machine.deployment import Deployment
from canshaper.report.stroke_metrics import crane_metrics, dip
from canshaper.report.strokes import find_strokes
from canshaper_sim.axes import ALL_AXES, BRIDGE, SLEW, WITHOUT_SWAY, kind_of
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joysticks import switches_off
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from canshaper_sim.recording import AxisTrace, CraneTrace, Recording

Row = dict[str, Any]
"""Row of one drive: seed, operator, fault, drawn numbers, measures."""


# Both engines drive each drive whose seed is a multiple of this.
BOTH_OF = 50


def measured_drive(
    deployment: Deployment,
    seed: int,
    ranges: Uncertainty,
    nominal: CraneParameters | None = None,
    native: NativeCrane | None = None,
    *,
    both: bool = False,
    longest_s: float = 0.0,
    unit: Path | None = None,
) -> Row:
    """Draw a drive, drive it and measure it; see ``draw_drive``.

    A promise is broken where the gate refuses a valve frame. The gate knows demands and limits, but
    not how the controller makes a frame. A drive in C has no gate.

    Args:
        ranges: ranges of the crane's parameters.
        nominal: the crane that the ranges refer to; None for that of the file.
        native: the engine in C, for the drives that it supports; None for Python alone.
        both: drive with both engines, whatever the seed; see ``BOTH_OF``.
        longest_s: see ``draw_drive``.
        unit: path of an FMU that replaces the crane; then ``native`` has to be None.

    Raises:
        CampaignError: the two engines measured different values, though the gate refused nothing.
    """
    setting = draw_drive(deployment, seed, ranges, nominal, longest_s)
    nominal = nominal or changed_parameters([], deployment)
    if unit:
        setting = on_unit(setting, unit, nominal)
    if not (native and native.has(setting)):
        return _row(deployment, seed, setting, nominal)
    row = _row(deployment, seed, setting, nominal, native)
    if seed % BOTH_OF and not both:
        return row
    own = _row(deployment, seed, setting, nominal)
    for name, value in own.items():
        if value != row[name] and name != "engine" and not own["broken"]:
            text = f"expected the same {name} of both engines, got {value!r} and {row[name]!r}"
            raise CampaignError(f"drive {seed}: {text} in C; --engine python drives without it")
    return {**own, "engine": "both"}


def _row(
    deployment: Deployment,
    seed: int,
    setting: Setting,
    nominal: CraneParameters,
    native: NativeCrane | None = None,
) -> Row:
    """Drive a setting, also with anti-sway off if it has no fault and a switch; return the row."""
    drive = _Drive(deployment, setting, nominal, native)
    off = switches_off(deployment) and not setting.fault
    raw = _Drive(deployment, setting, nominal, native, bypass=True) if off else None
    row = {"seed": seed, "operator": setting.operator, "fault": setting.fault, **setting.factors}
    return {
        **row,
        **drive.measures,
        "raw_deg": raw.measures["residual_deg"] if raw else None,
        "broken": len(drive.refused),
        "why": drive.refused[0] if drive.refused else "",
        "swung_over": drive.swung_over,
        "engine": "native" if native else "python",
    }


class _Drive:
    """A drive of a setting, driven and measured.

    The drive ends when the grapple swings above the horizontal, where the model does not hold; its
    residual swing is then its largest swing.

    Attributes:
        measures: measures by the names of ``MEASURES``.
        refused: valve frames that the gate refused, with their times.
        swung_over: the grapple swung above the horizontal.
    """

    def __init__(
        self,
        deployment: Deployment,
        setting: Setting,
        nominal: CraneParameters,
        native: NativeCrane | None = None,
        *,
        bypass: bool = False,
    ) -> None:
        self.refused = list[str]()
        if native:
            self.measures, self.swung_over = native.drive(setting, nominal, bypass=bypass)
        else:
            tracks = _Tracks(deployment, setting, nominal)
            self.swung_over = self._simulate(deployment, setting, tracks, bypass)
            self.measures = tracks.measures(crane_only=bypass)
        if self.swung_over:
            self.measures["residual_deg"] = self.measures["peak_deg"]
            self.measures["still_s"] = setting.script.duration_s  # never still: the whole drive

    def _simulate(
        self, deployment: Deployment, setting: Setting, tracks: "_Tracks", bypass: bool
    ) -> bool:
        """Drive in Python, behind the gate; return whether the grapple swung over."""
        options: DriveOptions = {**setting.options, "bypass": bypass}
        simulation = Simulation(deployment, setting.script, **options)
        plant = simulation.plant
        for time_ms in simulation.ticks():
            tracks.add(time_ms, plant)
            for event in simulation.controller.events:
                if isinstance(event, RefusalEvent):
                    self.refused.append(f"{time_ms / 1000.0:.2f} s: {event.text}")
            if plant.crane.swung_over:
                return True
        return False


class _Tracks:
    """States of the crane, tick by tick, and their measures at the end.

    Speeds are parts of the nominal full speeds, which the operator expects of full deflection.
    """

    def __init__(self, deployment: Deployment, setting: Setting, nominal: CraneParameters) -> None:
        crane, _ = driven_axes(deployment)
        driven = driven_part(deployment, crane)
        self._moves = moves = driven.coordinates
        axes = sorted(moves, key=lambda one: ALL_AXES.index(moves[one]))
        self._dwell_s = setting.dwell_s
        self._script = setting.script
        self._tick_s = deployment.config.tick_ms / 1000.0
        self._limits = {name: driven.axes[name].config.limits.output_limits() for name in axes}
        self._full = nominal.full_speeds(kind_of(moves.values()))
        self._still_deg = deployment.config.still_deg
        self._t_s: list[float] = []
        self._commands: dict[str, list[float]] = {name: [] for name in axes}
        self._speeds: dict[str, list[float]] = {name: [] for name in axes}
        self._poses: list[tuple[float, float]] = []  # theta1, radius
        self._across: list[float] = []
        self._along: list[float] = []

    def add(self, time_ms: int, plant: PlantNode) -> None:
        """Store the state of the crane after a tick."""
        moves = self._moves
        crane, commands, speeds = plant.crane, self._commands, self._speeds
        self._t_s.append(time_ms / 1000.0)
        state = crane.state
        self._poses.append((state.theta1_rad, state.radius_m))
        # The lean of the grapple on a slope and in the wind is no swing.
        across, along = crane.rest_rad
        self._across.append(math.degrees(state.theta5_rad - across))
        self._along.append(math.degrees(state.theta6_rad - along))
        for name in commands:
            commands[name].append(plant.command(name))
            speeds[name].append(crane.speed(moves[name]))

    def measures(self, *, crane_only: bool) -> dict[str, float | None]:
        """Return the measures of the drive by the names of ``MEASURES``; None for a missing one.

        ``crane_only``: leave out the measures of the axes.
        """
        across, along = self._across, self._along
        swing = [*map(math.hypot, across, along)]
        tip = [(r_m * math.cos(theta1), r_m * math.sin(theta1)) for theta1, r_m in self._poses]
        axes = {
            name: AxisTrace(
                [self._script.command(name, time_s) for time_s in self._t_s],
                [limits.velocity(command) for command in self._commands[name]],
                [speed / self._full[self._moves[name]] for speed in self._speeds[name]],
                self._sway(self._moves[name]),
            )
            for name, limits in self._limits.items()
        }
        crane = CraneTrace(tip, tip, swing)
        recording = Recording(self._t_s, axes, crane, self._dwell_s)
        of_crane = crane_metrics(recording, crane, self._still_deg)
        measured = {
            "still_s": of_crane.still_s,
            "residual_deg": of_crane.residual_deg,
            "peak_deg": of_crane.peak_deg,
            "run_on_s": of_crane.run_on_s,
            "run_on_m": of_crane.run_on_m,
        }
        if crane_only:
            return measured
        strokes = find_strokes(recording)
        dips = [dip(axes[name], stroke) for name, own in strokes.items() for stroke in own]
        return measured | {
            "travel_error_s": max(self._travel_errors(axes), default=None),
            "dip_pct": 100.0 * max(dips, default=0.0),
        }

    def _sway(self, moved: str) -> list[float] | None:
        """Return the swing that a coordinate excites, deg; None where it excites none."""
        if moved in WITHOUT_SWAY:
            return None
        return self._across if moved in (SLEW, BRIDGE) else self._along

    def _travel_errors(self, axes: Mapping[str, AxisTrace]) -> Iterator[float]:
        """Yield |travel - demanded travel| of each axis, in s of full speed."""
        for name, axis in axes.items():
            most = self._limits[name].maximum
            commanded = math.fsum(min(max(one, -most), most) for one in axis.joystick)
            yield abs(math.fsum(axis.speed) - commanded) * self._tick_s
