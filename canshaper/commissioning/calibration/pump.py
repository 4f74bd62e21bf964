"""Flow of the pump, from two axes that are driven alone, then at once; shown and written.

The part of its speed alone that each axis keeps shows how much the pump delivers, and how the valve
shares it. Speeds stand for flows: the valve curve of the file says which part of full speed a
command asks for. Unit is the full axis flow: what an axis with a share of 1 takes at full speed.
"""

import math
import statistics
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from canshaper.commissioning.calibration.ramp import speed_signal
from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.origins import confirmed, written_line
from canshaper.edit.edit import change
from canshaper.errors import CalibrationError, IdentificationError, UsageError
from canshaper.machine.deployment import Deployment

# An axis stands below this part of full speed, is held from this part of its largest demand on, and
# is not slowed down where it keeps this part of its speed alone.
STANDS, HELD, KEPT = 0.01, 0.95, 0.95
# A held speed has settled after SETTLING_S; from then on its means over BIN_S count as independent.
# For five of them 2.8 standard errors make an interval of 95 %; ERRORS is more, as commands and
# speeds have steps.
SETTLING_S, BIN_S, LEAST_BINS, ERRORS, LEAST_HALF = 0.5, 0.1, 5, 3.0, 0.01
# An axis alone shows whether it gets faster up to its largest demand: by its speed at demands
# between these parts of the largest one, which change by no more than SLOW within SLOW_S.
LOWER, SLOW, SLOW_S, SATURATED = (0.7, 0.85), 0.2, 0.3, 0.9
# Axes slow down alike where the parts of their speeds that they keep differ by no more.
ALIKE = 0.1
# States of an axis; the last three are multiplied by its direction, 1 or -1.
STANDING, BETWEEN, AT_MOST, UP, DOWN = 0, 9, 1, 2, 3

Moment = Sequence[float]
"""Time in s, rising; then of each axis its demand, part of full speed, and its speed."""

Drives = Sequence[Sequence[Moment]]
Mean = tuple[float, float]
"""A value and half the width of its interval of 95 %."""


class PumpFlow(NamedTuple):
    """Both axes at once, each in one direction.

    Attributes:
        ways: their directions, 1 or -1.
        kept: part of its speed alone that each of them keeps.
        asked: flow that they ask for, full axis flows.
        flow: flow that they get, full axis flows.
    """

    ways: tuple[int, int]
    kept: list[Mean]
    asked: float
    flow: Mean


# Demands and speeds of each axis, means over BIN_S, by the states of both.
Bins = list[tuple[float, float]]
Seen = Mapping[tuple[int, ...], tuple[Bins, Bins]]


def measured(drives: Drives, axes: Sequence[str], shares: Mapping[str, float]) -> list[PumpFlow]:
    """Measure the flow for each pair of directions with enough data, the least flow first.

    Args:
        drives: moments of each axis alone, and of both at once.
        axes: names of the two.
        shares: what each takes at full speed, full axis flows.

    Raises:
        CalibrationError: a drive is missing, or shows no steady speed or no flow.
    """
    seen = _seen(drives)
    directions = []
    for one, other in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        needed = seen[one, STANDING][0], seen[STANDING, other][1], *seen[one, other]
        if min(map(len, needed)) >= LEAST_BINS:
            directions.append(_direction(axes, (one, other), seen, shares))
    if not directions:
        text = f"expected {axes[0]} alone, {axes[1]} alone and both at once, in the same directions"
        raise CalibrationError(f"{text}, each held for two seconds at its largest command")
    return sorted(directions, key=lambda one: one.flow)


def _direction(
    axes: Sequence[str], ways: tuple[int, int], seen: Seen, shares: Mapping[str, float]
) -> PumpFlow:
    kept, asked, rises = [], [], True
    for i, (name, way) in enumerate(zip(axes, ways, strict=True)):
        alone = [seen[(s * way, 0) if i == 0 else (0, s * way)][i] for s in (AT_MOST, UP, DOWN)]
        zero = statistics.fmean([speed for _, speed in seen[STANDING, STANDING][i]] or [0.0])
        own, own_half = _gain(alone[0], zero)
        both, both_half = _gain(seen[ways][i], zero)
        if abs(own) <= 2.0 * own_half:
            text = f"{name} alone: expected a steady speed, got {own:.3g} ± {own_half:.2g} of full"
            raise CalibrationError(f"{text}; is that its feedback, and is it at no end?")
        # A lag makes it slower on the way up, and faster on the way down.
        lower = [_gain(bins, zero)[0] for bins in alone[1:] if bins]
        rises = rises and len(lower) == 2
        if len(lower) == 2 and abs(own) < SATURATED * abs(statistics.fmean(lower)):
            full, part = 100.0 * abs(alone[0][0][0]), 100.0 * LOWER[0]
            text = f"{name} alone hardly gets faster up to {full:.0f} % of full speed: its valve or"
            cure = f"drive both up to {part:.0f} % of that only (--top), or calibrate the valve"
            raise CalibrationError(f"{text} the pump gives no more, so no flow is known; {cure}")
        half = math.hypot(both_half, both / own * own_half) / abs(own)
        kept.append((both / own, max(half, LEAST_HALF)))
        asked.append(shares[name] * statistics.fmean(abs(demand) for demand, _ in seen[ways][i]))
    got = [(share * part, share * half) for share, (part, half) in zip(asked, kept, strict=True)]
    flow, half = sum(part for part, _ in got), math.hypot(*(half for _, half in got))
    if not rises and flow - half <= max(asked) / KEPT:
        text = f"flow at most {flow:.2f}, what one axis takes, which may lack oil alone too"
        cure = "drive each alone slowly up to its largest command and back, as calibrate does"
        raise CalibrationError(f"{text}; {cure}")
    return PumpFlow(ways, kept, sum(asked), (flow, half))


def _gain(bins: Bins, zero: float) -> Mean:
    gains = [(speed - zero) / demand for demand, speed in bins]
    spread = statistics.stdev(gains) if len(gains) > 1 else 0.0
    return statistics.fmean(gains), ERRORS * spread / math.sqrt(len(gains))


def _seen(drives: Drives) -> Seen:
    every = list(zip([0.0] * 5, *chain(*drives), strict=True))
    most = [{1: max(one), -1: -min(one)} for one in every[1::2]]
    bins: dict[tuple[int, ...], list[Moment]] = defaultdict(list)
    number = 0
    for drive in drives:
        states: tuple[int, ...] = ()
        since_s, before = 0.0, 0
        for moment in drive:
            time_s = moment[0]
            while time_s - drive[before][0] > SLOW_S:
                before += 1
            now = tuple(map(_state, moment[1::2], drive[before][1::2], most))
            if now != states:
                states, since_s, number = now, time_s, number + 1
            settled = time_s - since_s >= SETTLING_S or {UP, DOWN} & {*map(abs, now)}
            if settled:
                bins[*now, number, int((time_s - since_s) / BIN_S)].append(moment)
    seen: Seen = defaultdict(lambda: ([], []))
    for (one, other, *_), part in bins.items():
        _, *means = map(statistics.fmean, zip(*part, strict=True))
        for axis, demand, speed in zip(seen[one, other], means[::2], means[1::2], strict=True):
            axis.append((demand, speed))
    return seen


def _state(demand: float, before: float, most: Mapping[int, float]) -> int:
    """Return the state of an axis by its demand now, SLOW_S ago, and at most in each direction."""
    way, change = 1 if demand > 0.0 else -1, abs(demand) - abs(before)
    if abs(demand) < STANDS:
        return STANDING
    if abs(demand) >= HELD * most[way]:
        return AT_MOST * way
    if LOWER[0] <= abs(demand) / most[way] <= LOWER[1] and abs(change) <= SLOW:
        return (DOWN if change < 0.0 else UP) * way
    return BETWEEN


def pair_of(deployment: Deployment, axes: Sequence[str]) -> tuple[str, ...]:
    """Return the two axes that are named, else the first two with a filter; else UsageError."""
    filtered = [n for n, one in deployment.config.axes.items() if one.filter.kind != "off"]
    names = tuple(dict.fromkeys(axes)) or tuple(filtered[:2])
    if len(names) != 2 or not {*names} <= deployment.axes.keys():
        got, there = ", ".join(names) or "none", ", ".join(deployment.axes)
        raise UsageError(f"--together: expected two axes, got {got}; there are {there}")
    return names


def pump_lines(
    deployment: Deployment, axes: Sequence[str], drives: Drives, origin: dict[str, Any] | None
) -> list[str]:
    """Return the flow of the pump as lines, from drives of two axes: each alone, and both at once.

    A flow that is too little for both is written into the file, if there is an ``origin`` for it.

    Raises:
        CalibrationError: see ``measured``.
        ConfigError: the file cannot be changed.
    """
    oil = deployment.config.hydraulics
    shares = {name: oil.shares.get(name, 1.0) if oil else 1.0 for name in deployment.axes}
    directions, lines = measured(drives, axes, shares), []
    for ways, kept, asked, (flow, half) in reversed(directions):
        each = zip(axes, ways, kept, strict=True)
        parts = (f"{name} {'-+'[way > 0]} {v:.0%} ± {h:.0%}" for name, way, (v, h) in each)
        of = f"flow {flow:.2f} ± {half:.2f} of {asked:.2f} full axis flows"
        lines.append(f"at once, of the speed alone: {', '.join(parts)}: {of}")
    # A budget that is too small costs speed, one that is too large leaves swing.
    least = math.floor(100.0 * (flow - half)) / 100.0
    if all(part >= KEPT for direction in directions for part, _ in direction.kept):
        if asked < KEPT * sum(shares[name] for name in axes):
            cure = "measure again with a larger --top, or limits.max_pct"
            return [*lines, f"flow at least {least:g}: that little does not load the pump; {cure}"]
        every = f"hydraulics: {{ flow: {sum(shares.values()):g} }}"
        lines.append(f"enough oil for both: flow at least {least:g}; no hydraulics section needed")
        return [*lines, f"  where all axes have enough, {every} tells canshaper check so"]
    (low, slower), (high, faster) = sorted(zip((part for part, _ in kept), axes, strict=True))
    how = "neither alike nor one alone: does something else take oil, or move the load?"
    if high - low <= ALIKE:
        how = "the valve shares the flow: both slow down alike"
    elif high >= KEPT:
        how = f"plain load sensing: {slower} starves, {faster} keeps its speed"
    by = ", ".join(f"{name} {shares[name]:g}" for name in axes)
    lines += [how, f"hydraulics: {{ flow: {least:g} }} # lower end; shares: {by}"]
    if origin:
        values: dict[str, Any] = {"flow": least, "origin": origin}
        written = (("hydraulics",), values, "") if oil else ((), {"hydraulics": values}, "")
        change(deployment.path, [written, *confirmed(deployment.path, ["hydraulics.flow"])])
        lines.append(written_line(deployment.path))
    return lines


def drives_in(
    deployment: Deployment,
    logs: Sequence[Path],
    axes: Sequence[str],
    speeds: Mapping[str, str],
    channel: str | None,
) -> Drives:
    """Return the moments of two axes in each log; see ``read_can`` and ``speed_signal``.

    Raises:
        IdentificationError: commands or speeds of an axis are not in a log.
        LogError: a log cannot be read.
        UsageError: no signal with the speed of an axis is known.
    """
    names = {axis: ".".join(speed_signal(deployment, axis, speeds.get(axis))) for axis in axes}
    drives = []
    for path in logs:
        shown = read_can(path, names, deployment.messages, deployment=deployment, channel=channel)
        columns = [time_s := shown[axes[0]].time_s]
        for name, one in shown.items():
            if one.command is None or not len(one.time_s):
                raise IdentificationError(f"{path}: expected commands and speeds of {name}")
            columns.append(np.interp(time_s, one.command.time_s, one.command.speed))
            columns.append(np.interp(time_s, one.time_s, one.value))
        drives.append(np.stack(columns, axis=1).tolist())
    return drives
