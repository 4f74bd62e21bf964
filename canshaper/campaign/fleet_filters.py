"""Candidates of a design for a fleet: a filter of each swinging axis, of one kind."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from canshaper.commissioning.robust import design_robust, keys_of_length
from canshaper.commissioning.tuned import design_tuned
from canshaper.config.filters import filter_of
from canshaper.config.limits import Sway
from canshaper.errors import DesignError
from canshaper.machine.deployment import Deployment
from canshaper.machine.stop_distance import stop_fault
from canshaper.shaping.sway import GRAVITY_M_S2

ROBUST, GFF = "robust", "gff"


class Candidate(NamedTuple):
    """Filters of all swinging axes.

    Attributes:
        kind: of them, robust or gff.
        low, high: pendulums that they cover, as parts of the lengths in the file.
        duration_s: of their impulse responses; of G_FF until a step has settled to 5 %.
    """

    kind: str
    low: float
    high: float
    duration_s: float


@dataclass(frozen=True)
class FleetFilter:
    """Filter of an axis.

    Attributes:
        axis: its name.
        section: its section of the file.
        sway: keys of the swing that it is for.
        tail_s: longer tail than that of the file.
    """

    axis: str
    section: dict[str, Any]
    sway: dict[str, float]
    tail_s: float | None = None


def swinging(deployment: Deployment) -> dict[str, Sway]:
    """Axes that are designed, with their sway data.

    Raises:
        DesignError: there is none, or one has more than one filter.
    """
    axes = {}
    for name, axis in deployment.axes.items():
        if sway := axis.config.sway:
            if axis.rope or axis.config.gain_schedule or axis.config.profiles:
                text = "expected one filter, got a rope, gain_schedule or profiles"
                raise DesignError(f"--fleet: axis {name}: {text}")
            axes[name] = sway
    if not axes:
        raise DesignError("expected an axis with sway data, got none")
    return axes


def designed(deployment: Deployment, name: str, candidate: Candidate) -> FleetFilter:
    """Design the filter of an axis.

    Raises:
        InfeasibleError: no poles keep its run-on.
    """
    config = deployment.axes[name].config
    assert config.sway
    length_m = GRAVITY_M_S2 / config.sway.mode().omega_rad_s ** 2
    low_m, high_m = candidate.low * length_m, candidate.high * length_m
    if candidate.kind == ROBUST:
        robust = design_robust(
            deployment, name, lengths_m=(low_m, high_m), duration_s=candidate.duration_s
        )
        return FleetFilter(name, robust.section, robust.task.sway)
    sway = keys_of_length(config.sway, round(0.5 * (low_m + high_m), 4))
    range_pct = round(100.0 * (high_m - low_m) / (high_m + low_m), 1)
    given = {"length_range_pct": range_pct, "max_run_on_s": candidate.duration_s}
    own = FleetFilter(name, config.filter.model_dump(), sway)
    tuned = design_tuned(fitted(deployment, [own]), name, given)
    tail_s = tuned.longer_tail[0] if tuned.longer_tail else None
    limits = config.limits.model_copy(update={"tail_s": tail_s})
    if tail_s and stop_fault(deployment, name, config.model_copy(update={"limits": limits})):
        tail_s = None
    return FleetFilter(name, tuned.section, sway, tail_s)


def fitted(deployment: Deployment, filters: Sequence[FleetFilter]) -> Deployment:
    """The machine with these filters, and with the swing that they are for."""
    axes = dict(deployment.axes)
    for one in filters:
        config = axes[one.axis].config
        assert config.sway
        limits = {"tail_s": one.tail_s} if one.tail_s else {}
        changes = {
            "filter": filter_of(**one.section),
            "sway": config.sway.model_copy(update=one.sway),
            "limits": config.limits.model_copy(update=limits),
        }
        axes[one.axis] = replace(axes[one.axis], config=config.model_copy(update=changes))
    return replace(deployment, axes=axes)
