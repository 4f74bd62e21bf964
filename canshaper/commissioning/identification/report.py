"""Report of an identification, and its lines in the file."""

import math
import statistics
from collections.abc import Sequence
from typing import Any

from canshaper.commissioning.assumed import confirmed
from canshaper.commissioning.identification.decay import Value
from canshaper.commissioning.identification.recommend import Advice, advise, flow
from canshaper.commissioning.identification.series import Kind
from canshaper.commissioning.identification.verdict import Finding
from canshaper.config.limits import Sway
from canshaper.config.origin import note
from canshaper.edit.edit import Change, FileValue, change
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.stopping import stop_fault
from canshaper.report.table import axis_title


def lines(finding: Finding) -> list[str]:
    """A finding for people, one line a fact."""
    text_lines = [heading(finding), *(f"  {text}" for text in _basis(finding))]
    text_lines += [f"  note: {note}" for note in finding.notes]
    text_lines += [f"  not enough data: {fault}" for fault in finding.poor]
    return text_lines


def heading(finding: Finding) -> str:
    """Name and numbers of a finding: "Slew, empty: period 2.356 ± 0.002 s, ..."."""
    name = axis_title(finding.axis) + (f", {finding.label}" if finding.label else "")
    if finding.period_s is None or finding.damping_ratio is None:
        return f"{name}: nothing found"
    period, ratio = finding.period_s, finding.damping_ratio
    text = (
        f"{name}: period {period.value:.3f} ± {period.half:.3f} s,"
        f" damping ratio {ratio.value:.4f} ± {ratio.half:.4f}"
    )
    if finding.full_speed_m_s:
        speed = finding.full_speed_m_s
        text += f", full speed {speed.value:.2f} ± {speed.half:.2f} m/s"
    return text if finding.usable else f"{text} (not enough data)"


def _basis(finding: Finding) -> list[str]:
    """Return the data that the numbers rest on, for people."""
    texts = []
    if (fit := finding.free) is not None:
        first = max(float(s.envelope[0]) for s in fit.segments)
        noise = statistics.median(s.noise for s in fit.segments)
        kind = fit.segments[0].segment.kind
        factor = 1.0 if kind is Kind.OTHER else math.degrees(1.0)
        unit = {Kind.ANGLE: " degrees", Kind.RATE: " degrees/s"}.get(kind, "")
        texts.append(
            f"{len(fit.segments)} free decay{'s' * (len(fit.segments) != 1)},"
            f" {fit.swings:.1f} swings, from {first * factor:.3g}{unit} on, noise"
            f" {noise * factor:.2g}{unit}"
        )
    if (driven := finding.driven) is not None:
        texts.append(
            f"{len(driven.stretches)} driven stretch{'es' * (len(driven.stretches) != 1)}:"
            f" {100 * max(driven.explained, 0.0):.0f} % explained by the commands,"
            f" {driven.delay_s:.2f} s late"
        )
    if finding.at is not None:
        texts.append(f"load state: {finding.at:g}")
    return texts


def set_lines(advice: Advice) -> list[str]:
    """The lines of ``gain_schedule`` for the deployment file; each still needs its filter."""
    if not advice.gain_schedule:
        return []
    text_lines = ["    gain_schedule:"]
    for at, label, sway in sorted(advice.gain_schedule, key=lambda s: (s[0] is None, s[0])):
        shown = "?" if at is None else f"{at:g}"
        text_lines.append(f"      - breakpoint: {shown} # {label or 'value of the grapple signal'}")
        text_lines.append(f"        sway: {flow(sway)}")
        text_lines.append("        filter: # design it for this sway data")
    return text_lines


def as_dict(findings: Sequence[Finding], advice: Sequence[Advice]) -> dict[str, Any]:
    """Everything as JSON takes it."""
    return {
        "findings": [
            {
                "axis": f.axis,
                "label": f.label,
                "at": f.at,
                "usable": f.usable,
                "period_s": _value(f.period_s),
                "damping_ratio": _value(f.damping_ratio),
                "full_speed_m_s": _value(f.full_speed_m_s),
                "free_decays": len(f.free.segments) if f.free else 0,
                "swings": round(f.free.swings, 2) if f.free else None,
                "too_poor": f.poor,
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


def _value(value: Value | None) -> dict[str, float] | None:
    """Value and its interval of 95 %."""
    if value is None:
        return None
    return {"value": value.value, "low": value.value - value.half, "high": value.value + value.half}


def advice_on(findings: Sequence[Finding], deployment: Deployment | None) -> list[Advice]:
    """Return the advice on each axis."""
    return [
        advise(
            name,
            [f for f in findings if f.axis == name],
            _speed(deployment, name),
            has_grapple=bool(deployment and deployment.load_state),
        )
        for name in dict.fromkeys(f.axis for f in findings)
    ]


def _speed(deployment: Deployment | None, axis: str) -> float | None:
    """Full speed that the deployment has."""
    sway = deployment.axes[axis].config.sway if deployment else None
    return sway.full_speed_m_s if sway else None


def write_sway(
    deployment: Deployment,
    findings: Sequence[Finding],
    advice: Sequence[Advice],
    origin: dict[str, Any],
) -> list[str]:
    """Write what is known of each axis, and where from; the axes that were written.

    Raises:
        UsageError: an axis has no section for it, or would travel on for too long with it.
        ConfigError: the file cannot be changed.
    """
    usable = [a for a in advice if all(f.usable for f in findings if f.axis == a.axis)]
    for one in usable:
        config = deployment.axes[one.axis].config
        if config.sway is None:
            raise UsageError(
                f"axis {one.axis}: expected a section sway to write to, got none; put in sway:"
                f" {flow(one.sway)}"
            )
        faster = config.model_copy(update={"sway": Sway.model_validate(one.sway)})
        if fault := stop_fault(deployment, one.axis, faster):
            raise UsageError(
                f"axis {one.axis}: with sway: {flow(one.sway)}, limits.stop_distance_m: {fault};"
                " change the limits first"
            )
    changes: list[Change] = []
    measured: list[str] = []
    for one in usable:
        sway = deployment.axes[one.axis].config.sway
        assert sway is not None
        gone = sway.model_dump(exclude_none=True).keys() - one.sway.keys()
        values: dict[str, FileValue] = {**dict.fromkeys(sorted(gone)), **one.sway}
        values["origin"] = origin
        changes.append((("axes", one.axis, "sway"), values, note("identify")))
        same = {"full_speed_m_s"} if sway.full_speed_m_s == one.sway["full_speed_m_s"] else set()
        measured += (f"axes.{one.axis}.sway.{key}" for key in values.keys() - same)
    change(deployment.path, [*changes, *confirmed(deployment.path, measured)])
    return [one.axis for one in usable]
