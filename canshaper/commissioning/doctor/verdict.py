"""Findings of the doctor: figures of its runs, the checks that judge them, the verdict."""

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from canshaper.commissioning.doctor.measure import Run
from canshaper.commissioning.doctor.processes import LOOP_PRIORITY
from canshaper.daemon.follow import AFTER_NS
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import follow_fault

NS_PER_US = 1000.0

# Upper ends of the bins, us: three in a decade, 1 us to 50 s.
ENDS_US = tuple(step * 10**power for power in range(8) for step in (1, 2, 5))


@dataclass(frozen=True)
class Summary:
    """Number of times, their quantiles and the longest, us."""

    count: int
    p50: float
    p99: float
    p99_9: float
    max: float


def quantile(ordered: Sequence[int], share: float) -> int:
    """Return the least of the rising values that this share (0 to 1) of them does not exceed."""
    return ordered[max(math.ceil(share * len(ordered)), 1) - 1]


def summary(times_ns: Sequence[int]) -> Summary | None:
    """Return the quantiles of times in ns; None without times."""
    if not times_ns:
        return None
    ordered = sorted(times_ns)
    shares = (0.5, 0.99, 0.999, 1.0)
    return Summary(len(ordered), *(quantile(ordered, share) / NS_PER_US for share in shares))


def histogram(times_ns: Sequence[int]) -> dict[int, int]:
    """Return the number of times in each bin, by the upper end of the bin in us, included.

    The bins go from the first to the last that is not empty; the last bin takes longer times too.
    """
    counts = [0] * len(ENDS_US)
    for time_ns in times_ns:
        counts[min(bisect_left(ENDS_US, time_ns / NS_PER_US), len(ENDS_US) - 1)] += 1
    used = [i for i, count in enumerate(counts) if count]
    if not used:
        return {}
    return {ENDS_US[i]: counts[i] for i in range(used[0], used[-1] + 1)}


class Level(Enum):
    """Severity of a finding for the deployment."""

    OK = "ok"
    NOTE = "note"
    """To be known; neither good nor bad."""
    WARNING = "warning"
    """It works; something can be better, or could not be checked."""
    BAD = "bad"
    """Not fit until it is repaired."""


@dataclass(frozen=True)
class Finding:
    """Result of the check of a subject: what was found, and what to do, if anything."""

    subject: str
    level: Level
    found: str
    remedy: str = ""


def fit(findings: list[Finding]) -> bool:
    """Return whether no finding is bad."""
    return all(finding.level is not Level.BAD for finding in findings)


# Names of the runs.
IDLE, LOADED = "idle", "under load"
# The 99.9 % quantile as a part of the tick: good up to the first, bad above the second.
LATE_SHARES = (0.1, 0.5)
BUSY_SHARES = (0.25, 0.5)
# One in so many deadlines may be missed under load: as rare as the quantile counts.
MISSED_ONE_IN = 1000
# Reasons for which only a PC that is too slow is to blame.
OVERLOADED = frozenset(("LOOP_OVERRUN", "LOOP_STALLED"))
# States of an axis that lost its input.
LOST = frozenset(("STOPPING", "TRIPPED"))

UNIT = "canshaper@.service"
SERVICE = f"the service's unit does: {UNIT}"
AS_ROOT = f"measure as root, with the priority that {UNIT} has"
REAL_TIME = "see kernel, huge pages, governor, idle states and virtual machine below"


def measured_findings(deployment: Deployment, runs: dict[str, Run]) -> list[Finding]:
    """Judge all runs, by their names; priority and memory by the first of them."""
    tick_ns = deployment.config.tick_ms * 1_000_000
    findings = [check(next(iter(runs.values()))) for check in (policy, memory)]
    checks: tuple[Callable[[str, Run, int], Finding], ...] = (lateness, deadlines, processing)
    for name, run in runs.items():
        findings += [check(name, run, tick_ns) for check in checks]
        findings.append(joystick(name, run, deployment))
        findings.append(motion(name, run, list(deployment.axes)))
    return [*findings, *waiting(deployment)]


def waiting(deployment: Deployment) -> list[Finding]:
    """Note how long joystick frames wait for a tick that could follow them, or that it does."""
    config = deployment.config
    subject = "wait for the tick"
    if config.tick:
        text = f"ticks follow {config.tick.follow}, but not in what is measured here"
        return [Finding(subject, Level.NOTE, text)]
    joysticks = deployment.joysticks.items()
    names = [name for name, one in joysticks if follow_fault(config, one) is None]
    if not names:
        return []
    text = f"up to {config.tick_ms} ms, half of that on average; it could be {AFTER_NS / 1e6:g} ms"
    return [Finding(subject, Level.NOTE, text, f"tick: {{ follow: {names[0]} }}")]


def _share_finding(
    subject: str, times_ns: list[int], shares: tuple[float, float], tick_ns: int, remedy: str
) -> Finding:
    """Judge the 99.9 % quantile: good up to the first share of the tick, bad above the second."""
    at_ns = quantile(sorted(times_ns), 0.999)
    good, worst = shares
    part = at_ns / tick_ns
    measured = f"p99.9 {at_ns / 1000:.0f} us, {100 * part:.1f} % of the tick"
    if part <= good:
        return Finding(subject, Level.OK, measured)
    if part <= worst:
        text = f"{measured}; good is up to {100 * good:g} %"
        return Finding(subject, Level.WARNING, text, remedy)
    return Finding(subject, Level.BAD, f"{measured}; expected is up to {100 * worst:g} %", remedy)


def _held_up(run: Run) -> str:
    """Return what to do where other processes kept the loop from running."""
    return AS_ROOT if run.policy else REAL_TIME


def lateness(name: str, run: Run, tick_ns: int) -> Finding:
    """Judge how late the ticks come."""
    return _share_finding(f"lateness {name}", run.late_ns, LATE_SHARES, tick_ns, _held_up(run))


def processing(name: str, run: Run, tick_ns: int) -> Finding:
    """Judge how much of its tick the loop needs."""
    remedy = _held_up(run)
    if quantile(sorted(run.tick_ns), 0.5) > BUSY_SHARES[0] * tick_ns:  # it does so by itself
        remedy = "a faster processor, a longer tick_ms or fewer axes"
    return _share_finding(f"whole tick {name}", run.tick_ns, BUSY_SHARES, tick_ns, remedy)


def deadlines(name: str, run: Run, tick_ns: int) -> Finding:
    """Judge missed deadlines: nothing was computed, and the valves held their last command."""
    subject = f"deadlines {name}"
    of = len(run.late_ns) + run.missed
    measured = f"{run.missed} of {of} missed"
    if run.missed == 0:
        return Finding(subject, Level.OK, measured)
    seldom = run.missed * MISSED_ONE_IN <= of
    level = Level.WARNING if seldom and name == LOADED else Level.BAD
    text = f"{measured}, the latest tick {max(run.late_ns) / 1e6:.1f} ms late"
    return Finding(subject, level, text, _held_up(run))


def joystick(name: str, run: Run, deployment: Deployment) -> Finding:
    """Judge the time from joystick to valve beyond the wait for the next valve frame."""
    subject = f"joystick to valve {name}"
    times = summary(run.joystick_ns)
    if times is None:
        text = "no valve frame answered a joystick"
        return Finding(subject, Level.BAD, text, "measure longer: --seconds")
    tick_ms = deployment.config.tick_ms
    longest_ms = tick_ms * max(axis.period_ticks for axis in deployment.axes.values())
    text = f"p99.9 {times.p99_9 / 1000:.1f} ms, of which up to {longest_ms} ms wait for the cycle"
    if times.p99_9 <= 1000.0 * (longest_ms + LATE_SHARES[1] * tick_ms):
        return Finding(subject, Level.OK, text)
    return Finding(subject, Level.WARNING, f"{text}: more than that explains", _held_up(run))


def motion(name: str, run: Run, axes: list[str]) -> Finding:
    """Check that every axis moved as on the machine, and that none stopped."""
    subject = f"axes {name}"
    stops = Counter(f"{axis} {state} {why}" for axis, state, why in run.events if state in LOST)
    text = ", ".join(f"{what} ({count})" for what, count in stops.items())
    if OVERLOADED & {reason for _, _, reason in run.events}:
        return Finding(subject, Level.BAD, f"the loop was too late: {text}", _held_up(run))
    if stops:
        remedy = "these joysticks are a program of this PC: it was too late with their frames"
        return Finding(subject, Level.WARNING, f"stopped: {text}", remedy)
    still = [axis for axis in axes if axis not in run.moved]
    if still:
        observed = f"not in motion: {', '.join(still)}; measured with a neutral output"
        return Finding(subject, Level.WARNING, observed, "measure longer: --seconds")
    return Finding(subject, Level.OK, "all in motion, none stopped")


def policy(run: Run) -> Finding:
    """Check that the loop has a real-time priority."""
    subject = "scheduling"
    if run.policy is None:
        return Finding(subject, Level.OK, f"SCHED_FIFO with priority {LOOP_PRIORITY}")
    observed = f"measured without SCHED_FIFO: {run.policy} (RLIMIT_RTPRIO)"
    return Finding(subject, Level.WARNING, observed, f"measure as root; {SERVICE}")


def memory(run: Run) -> Finding:
    """Check that the loop's memory cannot be written out."""
    subject = "memory"
    if run.memory is None:
        return Finding(subject, Level.OK, "locked")
    observed = f"measured without locked memory: {run.memory}"
    return Finding(subject, Level.WARNING, observed, f"measure as root; {SERVICE}")
