"""Findings into the deployment file: what to do with them, and the section ``sway`` written."""

from collections.abc import Sequence
from typing import Any

from canshaper.commissioning.identification.recommend import Advice, advise, flow
from canshaper.commissioning.identification.verdict import Finding
from canshaper.config.limits import Sway
from canshaper.config.origin import note
from canshaper.edit.edit import set_values
from canshaper.edit.flow import Value
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.stopping import stop_fault


def advice_on(findings: Sequence[Finding], deployment: Deployment | None) -> list[Advice]:
    """What to do, of each axis."""
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
    for one in usable:
        sway = deployment.axes[one.axis].config.sway
        assert sway is not None
        gone = sway.model_dump(exclude_none=True).keys() - one.sway.keys()
        values: dict[str, Value] = {**dict.fromkeys(sorted(gone)), **one.sway}
        values["origin"] = origin
        set_values(deployment.path, ("axes", one.axis, "sway"), values, note("identify"))
    return [one.axis for one in usable]
