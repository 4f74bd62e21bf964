"""Stretches of a log in which an axis is driven."""

from dataclasses import dataclass

import numpy as np

from canshaper.commissioning.identification.series import Array, Command, Kind, Series, binned

# A stretch begins so many periods before its first command, to know the swing that is there
# already, goes on so many after the last, and is at most about so many long.
BEFORE, AFTER, LONGEST = 1.0, 2.0, 8.0
# Commands, part of full speed, below which an axis stands.
STANDS = 0.01
# So much earlier than a stretch a command may still matter: a second of the filter's past, and the
# longest delay of a valve.
EARLIER_S = 2.0


@dataclass(frozen=True, slots=True)
class Driven:
    """One stretch: its data, and the commands that drove it."""

    source: str
    start_s: float
    time_s: Array
    value: Array
    kind: Kind
    command: Command


def driven_s(series: Series) -> float:
    """Seconds in which the axis of a series was commanded to move."""
    if series.command is None or not len(series.command.time_s):
        return 0.0
    held = np.diff(series.command.time_s, append=series.command.time_s[-1])
    return float(held[np.abs(series.command.speed) > STANDS].sum())


def stretches(series: Series, period: float) -> list[Driven]:
    """Stretches of a series with commands, each with some periods before and after them."""
    command = series.command
    if command is None or not len(command.time_s):
        return []
    moving = np.abs(command.speed) > STANDS
    ends = np.append(command.time_s[1:], command.time_s[-1])
    spans: list[list[float]] = []
    for a, b in zip(command.time_s[moving], ends[moving], strict=True):
        first, last = float(a) - BEFORE * period, float(b) + AFTER * period
        if spans and last - spans[-1][0] <= LONGEST * period:
            spans[-1][1] = last
        elif not spans or first >= spans[-1][1] - (BEFORE + AFTER) * period:
            spans.append([max(first, spans[-1][1]) if spans else first, last])
    time, value = binned(series.time_s, series.value)
    result = []
    for first, last in spans:
        inside = (time >= first) & (time <= last)
        t, v = time[inside], value[inside]
        if len(t) > 20 and t[-1] - t[0] > period and np.diff(t).max() < period / 3.0:
            start = float(t[0])
            its = _between(command, start - EARLIER_S, start + float(t[-1]))
            result.append(Driven(series.source, start, t - start, v, series.unit.kind, its))
    return result


def _between(command: Command, first_s: float, last_s: float) -> Command:
    """What is commanded in a time, with the command that holds at its start."""
    low = max(0, int(np.searchsorted(command.time_s, first_s, side="right")) - 1)
    part = slice(low, int(np.searchsorted(command.time_s, last_s, side="right")))
    return Command(command.time_s[part], command.speed[part])
