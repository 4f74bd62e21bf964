"""Sway data from findings: one value, one in the middle, or a set for each state."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from canshaper.commissioning.identification.decay import Value
from canshaper.commissioning.identification.verdict import Finding
from canshaper.errors import IdentificationError

# Difference of pendulum lengths, +- %, up to which one value in the middle is what we recommend
# without a signal of the grapple; the robust shaper covers it.
ONE_VALUE_PCT = 30.0
# Up to here the difference needs no sets either.
SAME_PCT = 8.0


@dataclass(frozen=True, slots=True)
class Advice:
    """Recommendation from the findings of an axis.

    Attributes:
        axis: its name.
        sway: values for the section ``sway``; empty where nothing can be used.
        spread_pct: lengths of the pendulum around that value, +- %.
        cover_pct: range of lengths for the robust shaper, +- %; 0 where one value will do.
        gain_schedule: (value of the load state or None, label, sway) where sets are recommended.
        text: one sentence for people.
    """

    axis: str
    sway: dict[str, float]
    spread_pct: float
    cover_pct: int
    gain_schedule: list[tuple[float | None, str, dict[str, float]]]
    text: str


def advise(
    axis: str, findings: Sequence[Finding], speed_m_s: float | None, *, has_grapple: bool = False
) -> Advice:
    """Put the findings of one axis together.

    Args:
        axis: its name.
        findings: one for each state of the grapple.
        speed_m_s: full speed in the deployment, kept where none was measured.
        has_grapple: whether the deployment has a signal of the grapple.
    """
    usable = [f for f in findings if f.usable]
    if not usable:
        reasons = " ".join(dict.fromkeys(text for f in findings for text in f.poor[:1]))
        return Advice(axis, {}, 0.0, 0, [], f"{axis}: nothing that can be used. {reasons}".strip())
    values = [_values(f, speed_m_s) for f in usable]
    if len(usable) == 1:
        text = f"Use sway: {flow(values[0])} for {axis}."
        missing = len(findings) - 1
        if missing:
            text += f" {missing} of {len(findings)} states could not be used."
        return Advice(axis, values[0], 0.0, 0, [], text)
    lengths = [v["period_s"] ** 2 for v in values]
    low, high = min(lengths), max(lengths)
    middle = 0.5 * (low + high)
    spread = 100.0 * (high - low) / (high + low)
    ratio = sum(v["damping_ratio"] for v in values) / len(values)
    sway = {"period_s": round(math.sqrt(middle), 4), "damping_ratio": round(ratio, 4)}
    speeds = [v["full_speed_m_s"] for v in values if "full_speed_m_s" in v]
    if speeds:
        sway["full_speed_m_s"] = round(sum(speeds) / len(speeds), 3)
    names = ", ".join(
        f"{f.label or 'one'} {v['period_s']:.2f} s" for f, v in _pairs(usable, values)
    )
    if spread <= SAME_PCT:
        text = f"One value is enough for {axis} ({names}): use sway: {flow(sway)}."
        return Advice(axis, sway, spread, 0, [], text)
    cover = math.ceil(spread + 3.0)
    sets = [(f.at, f.label, v) for f, v in _pairs(usable, values)]
    if has_grapple or spread > ONE_VALUE_PCT:
        text = (
            f"The lengths differ by ±{spread:.0f} % ({names}): give {axis} a gain schedule,"
            f" a breakpoint for each state{'' if has_grapple else ', with a load_state signal'};"
            f" until then sway: {flow(sway)}."
        )
        return Advice(axis, sway, spread, cover, sets, text)
    text = (
        f"Use sway: {flow(sway)} for {axis}, in the middle of {names}, with the robust shaper"
        f" for ±{cover} % length."
    )
    return Advice(axis, sway, spread, cover, [], text)


def headlines(findings: Sequence[Finding], advice: Sequence[Advice]) -> list[str]:
    """Recommendations for a picture that has the numbers of each finding: those that say more."""
    texts = []
    for one in advice:
        mine = [finding for finding in findings if finding.axis == one.axis]
        if len(mine) != 1 or not mine[0].usable:
            texts.append(one.text)
    return texts


def flow(values: dict[str, float]) -> str:
    """The values as they stand in a deployment file."""
    return "{ " + ", ".join(f"{k}: {v:g}" for k, v in values.items()) + " }"


def _pairs(
    findings: Sequence[Finding], values: Sequence[dict[str, float]]
) -> list[tuple[Finding, dict[str, float]]]:
    return list(zip(findings, values, strict=True))


def _values(finding: Finding, speed_m_s: float | None) -> dict[str, float]:
    """Sway data of a finding as it is written."""
    assert finding.period_s and finding.damping_ratio
    values = {
        "period_s": round(finding.period_s.value, 4),
        "damping_ratio": round(min(max(finding.damping_ratio.value, 0.0), 0.95), 4),
    }
    speed = finding.full_speed_m_s.value if finding.full_speed_m_s else speed_m_s
    if speed is not None:
        values["full_speed_m_s"] = round(speed, 3)
    return values


# What a hand adds at either end, and an eye to an angle, as standard deviations.
_HAND_S = 0.15
_EYE_PART = 0.1
_FACTOR = 1.96


def stopwatch(
    swings: float, seconds: float, first_deg: float, last_deg: float
) -> tuple[Value, Value]:
    """Period of small swings in s, and damping ratio.

    Args:
        swings: full swings (there and back) that were counted.
        seconds: that they took.
        first_deg: amplitude at the start, from rest to one side, degrees.
        last_deg: amplitude at the end.

    Raises:
        IdentificationError: a number makes no swing, or too few swings were counted.
    """
    if not swings >= 3:
        raise IdentificationError(f"--swings: expected 3 or more, better 10, got {swings:g}")
    if not 0.15 <= seconds / swings <= 12.0:
        text = f"{seconds / swings:g} s, of {seconds:g} s for {swings:g} swings"
        raise IdentificationError(f"--seconds: expected 0.15 to 12 s a swing, got {text}")
    if not 0.0 < last_deg <= first_deg <= 60.0:
        raise IdentificationError(
            "--first, --last: expected up to 60 degrees, the last one above 0 and not larger than"
            f" the first, got {first_deg:g} and {last_deg:g}"
        )
    decrement = (math.log(first_deg) - math.log(last_deg)) / swings
    ratio = decrement / math.hypot(2.0 * math.pi, decrement)
    # Mean of (1 + A^2/16) over the counted swings: the amplitude falls exponentially.
    square = math.radians(first_deg) ** 2
    if decrement > 0.0:
        square *= -math.expm1(-2.0 * decrement * swings) / (2.0 * decrement * swings)
    period = seconds / swings / (1.0 + square / 16.0)
    period_half = _FACTOR * math.sqrt(2.0) * _HAND_S / swings
    ratio_half = _FACTOR * math.sqrt(2.0) * _EYE_PART / (2.0 * math.pi * swings)
    return Value(period, period_half), Value(ratio, ratio_half)
