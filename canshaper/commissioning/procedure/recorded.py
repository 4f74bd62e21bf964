"""The log of a drive as a recording: what was asked and sent, and how the grapple swung."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from canshaper.codec.frame import Frame
from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.series import Array, Kind, Series
from canshaper.commissioning.procedure.traffic import read_traffic
from canshaper.errors import IdentificationError
from canshaper.machine.deployment import Deployment
from canshaper.recording.log import LogFile
from canshaper_sim.crane import CraneParameters
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import AxisTrace, CraneTrace, Recording

MOST_SILENT_S = 0.5  # a fifth of the swing of most grapples


def simulated_recording(
    log: Path, deployment: Deployment, parameters: CraneParameters
) -> Recording:
    """A drive of the simulated crane, which says how it moves.

    Raises:
        LogError: the log cannot be read.
    """
    recorder = Recorder(deployment, parameters)
    buses = {bus.channel: name for name, bus in deployment.config.buses.items()}
    for one in LogFile(log):
        if bus := buses.get(one.channel):
            frame = Frame(bus, one.can_id, one.extended, one.data)
            recorder.receive(frame, one.time_ns / 1e9)
    return recorder.recording()


def machine_recording(log: Path, deployment: Deployment, signals: Mapping[str, str]) -> Recording:
    """A drive of a machine, with the signals that show its swing.

    The speed of an axis is taken to be what was sent to its valve. A rate is an angle by the period
    of the swing. The total swing is that of all signals together; where the tip is, no one says.

    Args:
        log: of the drive.
        deployment: the machine.
        signals: MESSAGE.SIGNAL of the swing by axis; at least one. Axes may share one.

    Raises:
        IdentificationError: a signal is not in the log, shows no angle and no rate, or was silent.
        LogError: the log cannot be read.
    """
    sensors = {name: s for name in signals if (s := deployment.axes[name].sway_sensor)}
    sources = {n: one.config.source for n, one in sensors.items() if one.name == signals[n]}
    swings = read_can(log, "", signals, deployment.messages, deployment=deployment, sources=sources)
    traffic = read_traffic(log, deployment)
    time_s = next(iter(swings.values())).time_s
    planes: dict[str, list[float]] = {}
    axes = {}
    for name, axis in traffic.axes.items():
        sent = swings[name].command if name in swings else None
        sent_s, speed = (sent.time_s, sent.speed) if sent else axis.valve.arrays()
        velocity = _held(time_s, sent_s, speed)
        sway = None
        if name in swings:
            _check_complete(name, swings[name], traffic.duration_s)
            sway = planes[signals[name]] = _angle_deg(deployment, name, swings[name], time_s)
        axes[name] = AxisTrace(_held(time_s, *axis.joystick.arrays()), velocity, velocity, sway)
    begin_s = float(time_s[0])
    total = [math.hypot(*angles) for angles in zip(*planes.values(), strict=True)]
    crane = CraneTrace([], [], total)
    return Recording([float(value) - begin_s for value in time_s], axes, crane)


def _check_complete(name: str, series: Series, duration_s: float) -> None:
    """Check that the sensor did not fall silent: a gap would show no swing.

    Raises:
        IdentificationError: it has a gap.
    """
    edges = np.concatenate(([0.0], series.time_s, [duration_s]))
    number = int(np.argmax(np.diff(edges)))
    gap_s = float(edges[number + 1] - edges[number])
    if gap_s > MOST_SILENT_S:
        text = f"{series.source}: no value for {gap_s:.1f} s from {edges[number]:.1f} s on"
        remedy = "is the sensor on, and the swing within its range? Do it again"
        raise IdentificationError(f"{name}: {text}: {remedy}")


def _held(at_s: Array, time_s: Array, value: Array) -> list[float]:
    """Values at these times, each held until the next; zero before the first."""
    if not len(time_s):
        return [0.0] * len(at_s)
    number = np.searchsorted(time_s, at_s, side="right") - 1
    return [float(value[k]) if k >= 0 else 0.0 for k in number]


def _angle_deg(deployment: Deployment, name: str, series: Series, at_s: Array) -> list[float]:
    if series.unit.kind is Kind.OTHER:
        text = (
            f"{series.source}: expected an angle or its rate, got {series.unit.text or 'no unit'}"
        )
        raise IdentificationError(f"{name}: {text}; nothing else is compared in degrees")
    value = series.value - np.median(series.value)
    sway = deployment.axes[name].config.sway
    if series.unit.kind is Kind.RATE and sway:
        value = value * sway.mode().period_s / (2.0 * math.pi)
    return [math.degrees(v) for v in np.interp(at_s, series.time_s, value)]
