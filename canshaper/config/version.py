"""The version of the file's format, and the keys that had other names before it."""

from collections.abc import Mapping

from canshaper.config.source import Source
from canshaper.errors import ConfigError, Problem

VERSION = 1

# Where a key stood (| between other names of a place, * for any) and its name in version 1. What is
# inside another key comes before that one.
MOVED: Mapping[str, str] = {
    "axes.*.stick|command.lever": "joystick",
    "axes.*.stick": "command",
    "axes.*.sets|gain_schedule.*.at": "breakpoint",
    "axes.*.sets": "gain_schedule",
    "axes.*.feels|profiles.*.sets|gain_schedule.*.at": "breakpoint",
    "axes.*.feels|profiles.*.sets": "gain_schedule",
    "axes.*.feels": "profiles",
    "levers|joysticks.*.frozen_s": "stuck_s",
    "levers": "joysticks",
    "gateway.passing": "forwarding",
    "grapple": "load_state",
    "feel": "profile",
}
# What is a section of its own now, of two axes.
GONE = "radial_compensation"


def moved_keys(source: Source) -> list[Problem]:
    """Give every key that moved its new name in the data, and return one problem for each.

    All else in the file can then be checked as if it had the new names.

    Raises:
        ConfigError: the file is of a later version; nothing else can be said of it.
    """
    version = source.data.get("version") if isinstance(source.data, dict) else None
    if type(version) is int and version > VERSION:
        text = f"expected {VERSION}, got {version}: the file is for a later release of canshaper"
        raise ConfigError([source.problem(("version",), text)])
    problems = []
    for pattern, name in MOVED.items():
        for place in [*source.places(pattern.split("."))]:
            problems.append(source.problem(place, f"moved to {name}"))
            source.rename(place, name)
    for place in [*source.places(["axes", "*", GONE])]:
        text = f"moved to motion, next to axes: {{ slew: {place[1]}, near_far: ..., radius: ... }}"
        problems.append(source.problem(place, text))
        source.data["axes"][place[1]].pop(GONE)
    return problems
