"""Slew and near-far of a crane as one motion, bound to the DBC."""

from dataclasses import dataclass

from canshaper.codec.status import AIM, ReportedAim, StatusCodec
from canshaper.config.limits import Motion, Radius
from canshaper.config.source import Place
from canshaper.machine.identity import bind_status
from canshaper.machine.inputs import BoundValue, bind_radius
from canshaper.machine.lookup import Lookup


@dataclass(frozen=True)
class BoundMotion:
    """A motion with its messages.

    Attributes:
        config: the motion.
        radius: of its radius, where that is measured.
        aim: of its aim point, where that is sent, every so many ticks.
    """

    config: Motion
    radius: BoundValue[Radius] | None = None
    aim: StatusCodec[ReportedAim] | None = None
    aim_ticks: int = 0


def bind_motions(lookup: Lookup) -> dict[str, BoundMotion]:
    """Bind every motion, by name; an axis is part of one at most."""
    moved: dict[str, str] = {}
    motions = {}
    for name, motion in lookup.config.motion.items():
        place: Place = ("motion", name)
        for key in ("slew", "near_far"):
            _check_axis(lookup, (*place, key), getattr(motion, key), moved, turns=key == "slew")
        _check_crane(lookup, (*place, "near_far"), motion)
        slewing = lookup.config.axes[motion.slew].slewing if motion.slew in moved else None
        if slewing and motion.radius_m and motion.radius_m > slewing.largest_radius_m:
            text = f"expected up to largest_radius_m of {motion.slew}, {slewing.largest_radius_m:g}"
            lookup.diagnostics.add((*place, "radius_m"), f"{text}, got {motion.radius_m:g}")
        radius = bind_radius(lookup, (*place, "radius"), motion.radius) if motion.radius else None
        aim = bind_status(lookup, (*place, "aim"), motion.aim, AIM)
        motions[name] = BoundMotion(motion, radius, *aim)
    return motions


def _check_axis(
    lookup: Lookup, place: Place, name: str | None, moved: dict[str, str], *, turns: bool
) -> None:
    if name is None:
        return
    add, axes = lookup.diagnostics.add, lookup.config.axes
    at = ".".join(str(part) for part in place)
    if not lookup.diagnostics.check_axis(place, name, axes):
        return
    if name in moved:
        add(place, f"expected an axis that is in no other motion, got {name!r} of {moved[name]}")
    moved.setdefault(name, at)
    for key in ("sway", "slewing") if turns else ("sway",):
        if getattr(axes[name], key) is None:
            add(place, f"expected an axis with {key}, got {name!r} without")


def _check_crane(lookup: Lookup, place: Place, motion: Motion) -> None:
    """Check that axes with the usual names, such as front_slew, are of the same crane."""
    slew, near_far = motion.slew, motion.near_far
    if near_far is None or not (slew.endswith("slew") and near_far.endswith("near_far")):
        return
    crane = slew.removesuffix("slew")
    if near_far.removesuffix("near_far") != crane:
        text = f"expected an axis of the same crane as {slew!r}, got {near_far!r}"
        lookup.diagnostics.add(place, text)
