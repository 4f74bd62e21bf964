"""Sway data from findings: one value, one in the middle, or a set for each state."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from canshaper.commissioning.identification.verdict import Finding
from canshaper.machine.deployment import Deployment

# Difference of pendulum lengths, +- %, up to which one value in the middle is what we recommend
# without a signal of the grapple; the robust shaper covers it.
ONE_VALUE_PCT = 30.0
# Up to here the difference needs no sets either.
SAME_PCT = 8.0

Sway = dict[str, float]  # values for the section ``sway``


@dataclass(frozen=True, slots=True)
class Advice:
    """Recommendation from the findings of an axis."""

    axis: str
    text: str  # one sentence for people
    sway: Sway = field(default_factory=dict)  # empty where nothing can be used
    spread_pct: float = 0.0  # lengths of the pendulum around that value, +- %
    cover_pct: int = 0  # range of lengths for the robust shaper, +- %; 0 where one value will do
    # Value of the load state or None, label and sway, where sets are recommended.
    gain_schedule: list[tuple[float | None, str, Sway]] = field(default_factory=list)


def advice_on(findings: Sequence[Finding], deployment: Deployment | None) -> list[Advice]:
    """Return the advice on each axis."""
    axes = dict.fromkeys(f.axis for f in findings)
    return [_advise(axis, [f for f in findings if f.axis == axis], deployment) for axis in axes]


def _advise(axis: str, findings: Sequence[Finding], deployment: Deployment | None) -> Advice:
    """Put the findings of one axis together, one for each state of the grapple.

    The full speed of the deployment is kept where none was measured.
    """
    section = deployment.axes[axis].config.sway if deployment else None
    speed_m_s = section.full_speed_m_s if section else None
    has_grapple = bool(deployment and deployment.load_state)
    states = [(f, _values(f, speed_m_s)) for f in findings if f.usable]
    if not states:
        reasons = " ".join(dict.fromkeys(text for f in findings for text in f.poor[:1]))
        return Advice(axis, f"{axis}: nothing that can be used. {reasons}".strip())
    values = [v for _, v in states]
    if len(values) == 1:
        text = f"Use sway: {flow(values[0])} for {axis}."
        if missing := len(findings) - 1:
            text += f" {missing} of {len(findings)} states could not be used."
        return Advice(axis, text, values[0])
    sway, spread = _middle(values)
    names = ", ".join(f"{f.label or 'one'} {v['period_s']:.2f} s" for f, v in states)
    if spread <= SAME_PCT:
        text = f"One value is enough for {axis} ({names}): use sway: {flow(sway)}."
        return Advice(axis, text, sway, spread)
    cover = math.ceil(spread + 3.0)
    if has_grapple or spread > ONE_VALUE_PCT:
        text = (
            f"The lengths differ by ±{spread:.0f} % ({names}): give {axis} a gain schedule,"
            f" a breakpoint for each state{'' if has_grapple else ', with a load_state signal'};"
            f" until then sway: {flow(sway)}."
        )
        return Advice(axis, text, sway, spread, cover, [(f.at, f.label, v) for f, v in states])
    text = (
        f"Use sway: {flow(sway)} for {axis}, in the middle of {names}, with the robust shaper"
        f" for ±{cover} % length."
    )
    return Advice(axis, text, sway, spread, cover)


def _values(finding: Finding, speed_m_s: float | None) -> Sway:
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


def _middle(values: Sequence[Sway]) -> tuple[Sway, float]:
    """Sway data in the middle of several, and how far their lengths are from it, +- %."""
    lengths = [v["period_s"] ** 2 for v in values]
    low, high = min(lengths), max(lengths)
    ratio = sum(v["damping_ratio"] for v in values) / len(values)
    sway = {"period_s": round(math.sqrt(0.5 * (low + high)), 4), "damping_ratio": round(ratio, 4)}
    if speeds := [v["full_speed_m_s"] for v in values if "full_speed_m_s" in v]:
        sway["full_speed_m_s"] = round(sum(speeds) / len(speeds), 3)
    return sway, 100.0 * (high - low) / (high + low)


def headlines(findings: Sequence[Finding], advice: Sequence[Advice]) -> list[str]:
    """Recommendations for a picture that has the numbers of each finding: those that say more."""
    texts = []
    for one in advice:
        mine = [finding for finding in findings if finding.axis == one.axis]
        if len(mine) != 1 or not mine[0].usable:
            texts.append(one.text)
    return texts


def flow(values: Sway) -> str:
    """The values as they stand in a deployment file."""
    return "{ " + ", ".join(f"{k}: {v:g}" for k, v in values.items()) + " }"
