"""Report of an identification: lines, JSON, advice on the sway data, writing it."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from canshaper.commissioning.identification.series import Value
from canshaper.commissioning.identification.verdict import SwingFinding
from canshaper.commissioning.origins import confirmed
from canshaper.config.limits import Sway
from canshaper.edit.edit import Change, FileValue, change, flow, note
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.stop_distance import stop_fault
from canshaper.report.console import axis_title

# Without a signal of the grapple one value in the middle is recommended up to this difference of
# pendulum lengths, +- %: the robust shaper covers it.
ONE_VALUE_PCT = 30.0
# Up to this difference, +- %, one value is enough with any filter.
SAME_PCT = 8.0

SwayNumbers = dict[str, float]  # values for the section ``sway``


@dataclass(frozen=True, slots=True)
class Advice:
    """Recommendation from the findings of an axis."""

    axis: str
    text: str  # one sentence for people
    sway: SwayNumbers = field(default_factory=dict)  # empty where nothing can be used
    spread_pct: float = 0.0  # lengths of the pendulum around that value, +- %
    cover_pct: int = 0  # range of lengths for the robust shaper, +- %; 0 where one value will do
    # Value of the load state or None, label and sway, where sets are recommended.
    gain_schedule: list[tuple[float | None, str, SwayNumbers]] = field(default_factory=list)


def advice_on(findings: Sequence[SwingFinding], deployment: Deployment | None) -> list[Advice]:
    """Return the advice on each axis."""
    axes = dict.fromkeys(f.axis for f in findings)
    return [_advise(axis, [f for f in findings if f.axis == axis], deployment) for axis in axes]


def _advise(axis: str, findings: Sequence[SwingFinding], deployment: Deployment | None) -> Advice:
    """Put the findings of one axis together, one for each state of the grapple.

    The full speed of the deployment is kept where none was measured.
    """
    section = deployment.axes[axis].config.sway if deployment else None
    speed_m_s = section.full_speed_m_s if section else None
    has_grapple = bool(deployment and deployment.load_state)
    states = [(f, _values(f, speed_m_s)) for f in findings if f.usable]
    if not states:
        reasons = " ".join(dict.fromkeys(text for f in findings for text in f.problems[:1]))
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


def _values(finding: SwingFinding, speed_m_s: float | None) -> SwayNumbers:
    """Return period, damping ratio (clamped) and full speed of a finding, rounded for the file.

    Args:
        finding: what a log showed.
        speed_m_s: full speed where the log showed none; None leaves it out.
    """
    assert finding.period_s and finding.damping_ratio
    values = {
        "period_s": round(finding.period_s.value, 4),
        "damping_ratio": round(min(max(finding.damping_ratio.value, 0.0), 0.95), 4),
    }
    speed = finding.full_speed_m_s.value if finding.full_speed_m_s else speed_m_s
    if speed is not None:
        values["full_speed_m_s"] = round(speed, 3)
    return values


def _middle(values: Sequence[SwayNumbers]) -> tuple[SwayNumbers, float]:
    """Return the sway of the middle length of findings, and how far lengths are from it, +- %."""
    lengths = [v["period_s"] ** 2 for v in values]
    low, high = min(lengths), max(lengths)
    ratio = sum(v["damping_ratio"] for v in values) / len(values)
    sway = {"period_s": round(math.sqrt(0.5 * (low + high)), 4), "damping_ratio": round(ratio, 4)}
    if speeds := [v["full_speed_m_s"] for v in values if "full_speed_m_s" in v]:
        sway["full_speed_m_s"] = round(sum(speeds) / len(speeds), 3)
    return sway, 100.0 * (high - low) / (high + low)


def headlines(findings: Sequence[SwingFinding], advice: Sequence[Advice]) -> list[str]:
    """Return the recommendations that say more than the numbers of one finding, for the picture."""
    texts = []
    for one in advice:
        mine = [finding for finding in findings if finding.axis == one.axis]
        if len(mine) != 1 or not mine[0].usable:
            texts.append(one.text)
    return texts


def lines(finding: SwingFinding) -> list[str]:
    """Return the lines of a finding: its numbers, the data that they rest on, remarks."""
    texts = [heading(finding)]
    if (fit := finding.free) is not None:
        first = max(float(s.envelope[0]) for s in fit.segments)
        noise = statistics.median(s.noise for s in fit.segments)
        factor, unit = fit.segments[0].segment.kind.shown
        unit = f" {unit}" if unit else ""
        texts.append(
            f"  {len(fit.segments)} free decay{'s' * (len(fit.segments) != 1)},"
            f" {fit.swings:.1f} swings, from {first * factor:.3g}{unit} on, noise"
            f" {noise * factor:.2g}{unit}"
        )
    if (driven := finding.driven) is not None:
        texts.append(
            f"  {len(driven.stretches)} driven stretch{'es' * (len(driven.stretches) != 1)}:"
            f" {100 * max(driven.explained, 0.0):.0f} % explained by the commands,"
            f" {driven.delay_s:.2f} s late"
        )
    if finding.at is not None:
        texts.append(f"  load state: {finding.at:g}")
    return texts + finding.remarks()


def heading(finding: SwingFinding) -> str:
    """Return name and numbers of a finding, if any: "Slew, empty: period 2.356 ± 0.002 s, ..."."""
    name = axis_title(finding.axis) + (f", {finding.label}" if finding.label else "")
    if finding.period_s is None or finding.damping_ratio is None:
        return f"{name}: nothing found"
    period, ratio = finding.period_s, finding.damping_ratio
    text = (
        f"{name}: period {period.value:.3f} ± {period.half:.3f} s,"
        f" damping ratio {ratio.value:.4f} ± {ratio.half:.4f}"
    )
    if speed := finding.full_speed_m_s:
        text += f", full speed {speed.value:.2f} ± {speed.half:.2f} m/s"
    return finding.marked(text)


def set_lines(advice: Advice) -> list[str]:
    """Return the lines of ``gain_schedule`` for the file; each breakpoint still needs a filter."""
    texts = ["    gain_schedule:"]
    for at, label, sway in sorted(advice.gain_schedule, key=lambda s: (s[0] is None, s[0])):
        shown = "?" if at is None else f"{at:g}"
        texts.append(f"      - breakpoint: {shown} # {label or 'value of the grapple signal'}")
        texts.append(f"        sway: {flow(sway)}")
        texts.append("        filter: # design it for this sway data")
    return texts


def as_dict(findings: Sequence[SwingFinding], advice: Sequence[Advice]) -> dict[str, Any]:
    """Return findings and advice as JSON data."""
    return {
        "findings": [
            {
                "axis": f.axis,
                "label": f.label,
                "at": f.at,
                "usable": f.usable,
                "period_s": _interval(f.period_s),
                "damping_ratio": _interval(f.damping_ratio),
                "full_speed_m_s": _interval(f.full_speed_m_s),
                "free_decays": len(f.free.segments) if f.free else 0,
                "swings": round(f.free.swings, 2) if f.free else None,
                "problems": f.problems,
                "notes": f.notes,
            }
            for f in findings
        ],
        "axes": {
            a.axis: {
                "sway": a.sway,
                "spread_pct": round(a.spread_pct, 2),
                "gain_schedule": [
                    {"at": at, "label": label, "sway": sway} for at, label, sway in a.gain_schedule
                ],
                "recommendation": a.text,
            }
            for a in advice
        },
    }


def _interval(value: Value | None) -> dict[str, float] | None:
    """Return a value with its interval of 95 %; None for none."""
    if value is None:
        return None
    return {"value": value.value, "low": value.value - value.half, "high": value.value + value.half}


def write_sway(
    deployment: Deployment,
    findings: Sequence[SwingFinding],
    advice: Sequence[Advice],
    origin: dict[str, Any],
) -> list[str]:
    """Write the sway data and origin of each axis whose findings are all usable; return these.

    Raises:
        UsageError: an axis has no section for it, follows its rope, or would travel on for too
            long with it.
        ConfigError: the file cannot be changed.
    """
    changes: list[Change] = []
    measured: list[str] = []
    usable = [a for a in advice if all(f.usable for f in findings if f.axis == a.axis)]
    for one in usable:
        config, shown = deployment.axes[one.axis].config, f"sway: {flow(one.sway)}"
        if config.sway is None:
            text = f"expected a section sway to write to, got none; put in {shown}"
            raise UsageError(f"axis {one.axis}: {text}")
        if config.sway.length:
            text = "expected an axis with a period, got one that follows its rope (sway.length)"
            raise UsageError(f"axis {one.axis}: {text}: the measured length says how it swings")
        faster = config.model_copy(update={"sway": Sway.model_validate(one.sway)})
        if fault := stop_fault(deployment, one.axis, faster):
            text = f"with {shown}, limits.stop_distance_m: {fault}; change the limits first"
            raise UsageError(f"axis {one.axis}: {text}")
        gone = config.sway.model_dump(exclude_none=True).keys() - one.sway.keys()
        values: dict[str, FileValue] = {**dict.fromkeys(sorted(gone)), **one.sway}
        values["origin"] = origin
        changes.append((("axes", one.axis, "sway"), values, note("identify")))
        speed_stays = config.sway.full_speed_m_s == one.sway["full_speed_m_s"]
        same = {"full_speed_m_s"} if speed_stays else set()
        measured += (f"axes.{one.axis}.sway.{key}" for key in values.keys() - same)
    change(deployment.path, [*changes, *confirmed(deployment.path, measured)])
    return [one.axis for one in usable]
