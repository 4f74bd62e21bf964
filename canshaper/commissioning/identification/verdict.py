"""Verdict on the signals of an axis: its swing, and whether the data is enough to use."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from canshaper.commissioning.identification.decay import (
    LARGEST_RAD,
    DecayFit,
    DecayProblem,
    fit_decay,
)
from canshaper.commissioning.identification.driven import DrivenFit, fit_driven
from canshaper.commissioning.identification.segments import SETTLING_S, FreeSwings, find_free
from canshaper.commissioning.identification.series import Series, Value
from canshaper.commissioning.identification.swing import SAMPLES, clipped, mixed
from canshaper.design.tuning.modes import SECOND_PERIODS

# Fewer full swings show no damping.
LEAST_SWINGS = 3.0
# Widest intervals that may be used: of the period as a part of it; of the damping ratio as a part
# of it, or absolute. 3 % of the period are 6 % of the length, which every filter but ZV tolerates.
WIDEST_PERIOD = 0.03
WIDEST_RATIO, WIDEST_RATIO_ABS = 0.4, 0.01
# Largest swing for which the correction for amplitude holds, rad.
LARGE_RAD = math.radians(60.0)
# Part of the driven swing that the commands have to explain; more where no free swing is good.
LEAST_EXPLAINED = 0.8
LEAST_EXPLAINED_ALONE = 0.9
# Periods at which the search for a driven swing starts, s; each covers some 30 % around it.
STARTS_S = (1.2, 1.7, 2.3, 3.2, 4.5)
SWING_FREELY = (
    "drive the axis shortly, let go of the joysticks so that it swings by some 10 degrees, and"
    " touch nothing for ten swings"
)


@dataclass
class AxisFinding:
    """Finding of a measurement of one axis.

    Attributes:
        problems: why nothing of it may be used, each with what to do; empty where it may be used.
        notes: what else a person should know.
    """

    axis: str
    problems: list[str] = field(default_factory=list, kw_only=True)
    notes: list[str] = field(default_factory=list, kw_only=True)

    @property
    def usable(self) -> bool:
        """Whether the data is enough."""
        return not self.problems

    def marked(self, heading: str) -> str:
        """Return a heading that says so where the data is not enough."""
        return heading if self.usable else f"{heading} (not enough data)"

    def remarks(self) -> list[str]:
        """Return the notes and the problems as lines."""
        notes = [f"  note: {text}" for text in self.notes]
        return notes + [f"  not enough data: {text}" for text in self.problems]


@dataclass
class SwingFinding(AxisFinding):
    """Swing of one axis in one state of the grapple, or timed by hand without any signal."""

    label: str  # state of the grapple, may be ""
    at: float | None  # value of the grapple's signal, where it is known
    series: list[Series]
    free: DecayFit | None = None  # free swings, where there are any
    driven: DrivenFit | None = None  # driven swing, where commands are known
    period_s: Value | None = None  # of small damped swings; None where nothing was found
    damping_ratio: Value | None = None
    full_speed_m_s: Value | None = None  # of the tip; None where that was not seen

    @property
    def usable(self) -> bool:
        """Whether period and damping are known well enough."""
        return super().usable and self.period_s is not None


def identify(
    axis: str, label: str, series: Sequence[Series], about_s: float | None = None
) -> SwingFinding:
    """Return the finding of an axis, of its signals in one state of the grapple.

    ``about_s`` is the approximate period, s; None where it is not known.
    """
    values = [s.at for s in series if s.at is not None]
    finding = SwingFinding(axis, label, float(np.median(values)) if values else None, list(series))
    finding.notes += dict.fromkeys(note for one in series for note in one.notes)
    good, useless = [], []
    for one in series:
        if text := _useless(one):
            useless.append(f"{one.source}: {text}")
        else:
            good.append(one)
    _free(finding, good, about_s)
    _driven(finding, good, about_s)
    if finding.period_s is None:
        finding.problems = useless or [_no_swing(good)]
    else:
        finding.notes += useless
        finding.problems = _faults(finding)
        if finding.free:
            finding.notes += _doubts(finding.free, usable=finding.usable)
            if finding.usable:
                finding.notes += _second(finding.free, good)
    return finding


def _useless(series: Series) -> str | None:
    """Return why a signal cannot show a swing; None where it may."""
    if len(series.time_s) < 3 * SAMPLES:
        return f"only {len(series.time_s)} values; log for at least ten swings"
    if float(np.ptp(series.value)) == 0.0:
        return f"it stands at {series.value[0]:g}; is it the right signal, and the sensor on?"
    if (step := float(np.median(np.diff(series.time_s)))) > 0.25:
        return (
            f"expected {SAMPLES} values or more a swing, got one every {step:.2g} s: log it at"
            " 10 Hz or faster"
        )
    return None


def _no_swing(series: Sequence[Series]) -> str:
    """Return what to do where no swing was found in signals that may show one."""
    if flat := clipped(series[0], None):
        return flat
    names = ", ".join(s.source for s in series)
    for idle in (s.idle for s in series if s.idle is not None):
        if not any(b - a > SETTLING_S + 4.0 for a, b in idle):
            return f"{names}: never left to swing freely for two swings: {SWING_FREELY}"
    return f"{names}: no decaying swing found: {SWING_FREELY}. Is it the right signal?"


def _free(finding: SwingFinding, series: Sequence[Series], about_s: float | None) -> None:
    """Fit the free swings of all signals together, into the finding."""
    swinging = [(s, f) for s in series if (f := find_free(s, about_s))]
    if not swinging:
        return
    best = max((f for _, f in swinging), key=lambda f: f.worth)
    segments = []
    for one, swings in swinging:
        alike = abs(swings.period_s / best.period_s - 1.0) <= 0.1
        if fitting := swings if alike else find_free(one, best.period_s):
            segments += fitting.segments
    fit = fit_decay(segments, best.period_s, best.damping_ratio)
    finding.free, finding.period_s, finding.damping_ratio = fit, fit.period_s, fit.damping_ratio


def _driven(finding: SwingFinding, series: Sequence[Series], about_s: float | None) -> None:
    """Fit the driven swings into the finding: full speed, and what no free swing showed."""
    if not any(s.driven_s for s in series):
        return
    trusted = finding.free if finding.free and not _faults(finding) else None
    starts = (about_s,) if about_s else STARTS_S
    fit = fit_driven(series, (trusted.period_s.value,) if trusted else starts, trusted)
    if fit is None:
        return
    finding.driven = fit
    if fit.explained < LEAST_EXPLAINED:
        finding.notes.append(
            f"no full speed: the commands explain only {100 * max(fit.explained, 0):.0f} % of"
            " the driven swing; drive this axis alone, in single strokes"
        )
        return
    if trusted is None and fit.explained > LEAST_EXPLAINED_ALONE:
        finding.free = None
        finding.period_s, finding.damping_ratio = fit.period_s, fit.damping_ratio
        finding.notes.append("from driven motion, as no free swing was good enough")
    if fit.full_speed_m_s is None:
        finding.notes.append("no full speed: the signal is no angle and no rate of one")
    elif fit.full_speed_m_s.relative < 0.3:
        finding.full_speed_m_s = fit.full_speed_m_s


def _second(first: DecayFit, series: Sequence[Series]) -> list[str]:
    """Return a note on a quicker swing in the residual of the first one, if there is one."""
    omega = 2.0 * math.pi / first.period_s.value
    x = np.array([omega, omega * first.damping_ratio.value])
    best: FreeSwings | None = None
    for one in series:
        time, left = [one.time_s[:0]], [one.value[:0]]
        for fit in first.segments:
            own, at = fit.segment, one.time_s - fit.segment.start_s
            inside = (at >= 0.0) & (at <= own.time_s[-1])
            if own.source == one.source and inside.any():
                basis, _ = DecayProblem([own], [float(fit.envelope[0])]).basis(0, x, at[inside])
                amounts, *_ = np.linalg.lstsq(basis, one.value[inside], rcond=None)
                time.append(one.time_s[inside])
                left.append(one.value[inside] - basis @ amounts)
        swings = find_free(replace(one, time_s=np.concatenate(time), value=np.concatenate(left)))
        if swings and (best is None or swings.worth > best.worth):
            best = swings
    if best is None or best.period_s > SECOND_PERIODS * first.period_s.value:
        return []
    second = fit_decay(best.segments, best.period_s, best.damping_ratio)
    period, ratio = second.period_s, second.damping_ratio
    vague = period.relative > WIDEST_PERIOD or ratio.half > max(
        WIDEST_RATIO * ratio.value, WIDEST_RATIO_ABS
    )
    if vague or second.swings < LEAST_SWINGS:
        return []
    option = f"{period.value:.3f},{max(ratio.value, 0.0):.3f},20"
    return [
        f"a second swing of {period.value:.3f} s, such as of a hook with its load:"
        f" canshaper robust --second {option} leaves it in peace"
    ]


def _doubts(fit: DecayFit, *, usable: bool) -> list[str]:
    """Return notes where damping differs between swings, or some are too large for the model."""
    notes = []
    if fit.friction and usable:
        (large, at_large), (small, at_small) = fit.friction
        factor, unit = fit.segments[0].segment.kind.shown
        unit = unit or "units"
        why = "dry friction" if at_small > at_large else "damping that grows with the swing"
        notes.append(
            f"the damping ratio changes from {at_large:.3f} at {large * factor:.2g} {unit} to"
            f" {at_small:.3f} at {small * factor:.2g} {unit}: {why}; the value given lies between"
        )
    largest = max(s.angle_rad for s in fit.segments)
    if LARGE_RAD < largest < LARGEST_RAD:
        notes.append(
            f"swings of {math.degrees(largest):.0f} degrees are beyond the model: use smaller ones"
        )
    return notes


def _faults(finding: SwingFinding) -> list[str]:
    """Return why period and damping cannot be used."""
    period, ratio, fit = finding.period_s, finding.damping_ratio, finding.free
    assert period is not None and ratio is not None
    faults = []
    if fit is not None:
        if fit.swings < LEAST_SWINGS:
            faults.append(
                f"expected {LEAST_SWINGS:g} swings or more, better ten, got {fit.swings:.1f}:"
                f" {SWING_FREELY}"
            )
        largest = max(s.angle_rad for s in fit.segments)
        if largest >= LARGEST_RAD:
            faults.append(
                f"a swing of {math.degrees(largest):.3g} degrees: is the unit of the signal right?"
            )
        if text := mixed(fit):
            faults.append(text)
        faults += [text for s in finding.series if (text := clipped(s, fit))][:1]
    if period.relative > WIDEST_PERIOD:
        faults.append(
            f"expected the period to {100 * WIDEST_PERIOD:g} %, got it to"
            f" {100 * period.relative:.1f} %: {_remedy(fit)}"
        )
    elif ratio.half > max(WIDEST_RATIO * ratio.value, WIDEST_RATIO_ABS):
        faults.append(
            f"expected the damping ratio to {100 * WIDEST_RATIO:g} %, got {ratio.value:.3f}"
            f" to {ratio.half:.3f}: {_remedy(fit)}"
        )
    elif ratio.value <= ratio.half:
        faults.append(
            f"no decay is seen (damping ratio {ratio.value:.3f} ± {ratio.half:.3f}): was it driven"
            f" all the time? {SWING_FREELY.capitalize()}"
        )
    return faults


def _remedy(fit: DecayFit | None) -> str:
    """Return what makes intervals narrower."""
    if fit is None:
        return SWING_FREELY
    best = max(fit.segments, key=lambda s: float(s.envelope[0]))
    factor, unit = best.segment.kind.shown
    first, noise = float(best.envelope[0]) * factor, best.noise * factor
    if noise > 0.2 * first:
        unit = unit or "units"
        return f"swings of {first:.2g} {unit} in a noise of {noise:.2g}; {SWING_FREELY}"
    return f"log more swings, best several times; {SWING_FREELY}"
