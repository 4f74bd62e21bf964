"""The deployments of config/ as they are, and copies of them to reload: changed, or with more."""

import functools
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

from canshaper.config.load import load_config
from tests.faults.machine import Machine
from tests.faults.variants import COUNTER, JOYSTICK_COUNTER, Variant, write
from tests.rigs.files import ROOT, text_of

CONFIG = ROOT / "config"
NAMES = (
    "forwarder",
    "forwarder-robust",
    "forwarder-gff",
    "forwarder-sensor",
    "forwarder-joints",
    "j1939-forwarder",
    "j1939-profiles",
    "j1939-rollers",
    "ecu-forwarder",
    "j1939-sensor",
    "canopen-forwarder",
    "canopen-sensor",
    "gateway-forwarder",
    "two-cranes",
    "canfd-forwarder",
    "canfd-sensor",
    "js6000-forwarder",
    "pvedcc-forwarder",
    "moog-forwarder",
    "cia402-forwarder",
    "remote-forwarder",
    "forwarder-pump",
    "forwarder-load",
    "bridge-crane",
    "bridge-crane-hook",
    "excavator",
    "multicopter",
    "tower-crane",
    "telehandler",
)
CHECKSUM = "checksum: { signal: Checksum, kind: crc8_sae_j1850 }"
MADE = {
    "gateway-protected": Variant(
        "gateway-forwarder",
        {
            COUNTER: f"{COUNTER}    qualify: 2\n    {CHECKSUM}\n",
            "fallback: neutral": "fallback: stop",  # the kernel puts no checksum there
            "alive_counter: AliveCounter }": f"alive_counter: AliveCounter, {CHECKSUM} }}",
        },
        {JOYSTICK_COUNTER: JOYSTICK_COUNTER + ' SG_ Checksum : 48|8@1+ (1,0) [0|255] "" SHAPER\n'},
    ),
}
"""No shipped file has a gateway whose frames have checksums."""


@dataclass(frozen=True)
class Shipped:
    """A deployment of config/.

    Attributes:
        machine: what its files say.
        adjustable: the same with numbers that may be set while it runs: keys, least and most.
        changed: another one to reload, that allows no more than this one.
        refiltered: one with other filters.
    """

    machine: Machine
    file: Path
    adjustable: Path
    ranges: dict[str, tuple[float, float]]
    changed: Path
    refiltered: Path


@functools.cache
def directory() -> tempfile.TemporaryDirectory[str]:
    """Where the copies are."""
    return tempfile.TemporaryDirectory(prefix="canshaper-shipped-")


@functools.cache
def shipped(name: str) -> Shipped:
    """A deployment by the name of its file."""
    file = write(name, MADE[name]) if name in MADE else CONFIG / f"{name}.yaml"
    machine = Machine(name, file)
    ranges = _ranges(machine)
    numbers = "".join(f"    {key}: [{low}, {high}]\n" for key, (low, high) in ranges.items())
    control = f"\ncontrol:\n  adjustable:\n{numbers}"
    text = text_of(file)
    changed = text.replace("rise_per_s: 5,", "max_pct: 70, rise_per_s: 4,")
    changed = changed.replace("rise_per_s: 1,", "max_pct: 70, rise_per_s: 0.8,")
    assert "max_pct: 70" in changed
    refiltered = re.sub(r"kind: gff, a1: [\d.]+, a2: [\d.]+", "kind: zv", text)
    refiltered = re.sub(r"kind: off\b", "kind: first_order, time_constant_s: 0.1", refiltered)
    copies = {"adjustable": text + control, "changed": changed, "refiltered": refiltered}
    paths = {}
    for kind, copy in copies.items():
        paths[kind] = Path(directory().name) / f"{name}-{kind}.yaml"
        paths[kind].write_text(copy, encoding="utf-8")
    return Shipped(
        machine, file, paths["adjustable"], ranges, paths["changed"], paths["refiltered"]
    )


def _ranges(machine: Machine) -> dict[str, tuple[float, float]]:
    """Numbers of every axis, and ranges in which it never moves quicker than by its file.

    Profiles, gain schedules and measured lengths choose the numbers of an axis that has some.
    """
    ranges: dict[str, tuple[float, float]] = {}
    for name, axis in machine.axes.items():
        config = load_config(machine.path)[0].axes[name]
        if config.profiles or config.gain_schedule or (config.sway and config.sway.length):
            continue
        rise_per_s = config.limits.rise_per_s
        ranges[f"axes.{name}.limits.rise_per_s"] = (0.4 * rise_per_s, rise_per_s)
        if axis.filter == "gff":
            numbers = config.filter.parameters()
            ranges[f"axes.{name}.filter.a1"] = (0.85 * numbers["a1"], 1.13 * numbers["a1"])
            ranges[f"axes.{name}.filter.a2"] = (0.67 * numbers["a2"], 1.33 * numbers["a2"])
    return ranges
