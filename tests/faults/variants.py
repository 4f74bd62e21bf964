"""The machines that are driven: the shipped ones as they are, and changed copies of them.

A copy is made by replacing text, and every text to be replaced must be there.
"""

import functools
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.faults.machine import Machine
from tests.rigs.files import ROOT

LIMITS = "limits: { deadband_pct: 5, rise_per_s: 5, fall_per_s: 5, tail_s: 2.0, stop_s: 2.0"
ROBUST_LIMITS = LIMITS.replace(
    "tail_s: 2.0, stop_s: 2.0", "reversal: brake_shaped, tail_s: 2.2, stop_s: 2.2"
)
LIFT_LIMITS = LIMITS.replace("2.0", "0.2")
SLEW_FILTER = "filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
NEAR_FAR_FILTER = "filter: { kind: gff, a1: 0.708, a2: 0.12 } # near-far"
LIFT_FILTER = "filter: { kind: off }"
RADIUS = "radius: { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 200 }"
COUNTER = "    alive_counter: AliveCounter\n"
BUS = "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }"
SLEW = ' SG_ Slew : 0|16@1- (0.1,0) [-100|100] "%" SHAPER\n'
JOYSTICK_COUNTER = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
NETWORK_END = "BO_ 1024 GrappleSway: 4 PLANT"


def limits(text: str) -> str:
    return f"limits: {{ deadband_pct: 5, {text}"


@dataclass(frozen=True)
class Variant:
    """A copy of a shipped deployment with text replaced."""

    file: str
    yaml: dict[str, str] = field(default_factory=dict)
    dbc: dict[str, str] = field(default_factory=dict)


VARIANTS = {
    "forwarder": Variant("forwarder"),
    "robust": Variant("forwarder-robust"),
    "joints": Variant("forwarder-joints"),
    # Tail and stop end while the filter still asks for much, each before the other once.
    "short": Variant(
        "forwarder",
        {
            LIMITS: limits(
                "max_pct: 80, min_pct: 3, rise_per_s: 2, fall_per_s: 3, tail_s: 0.3, stop_s: 0.24"
            ),
            LIFT_LIMITS: limits(
                "max_pct: 60, rise_per_s: 1, fall_per_s: 8, tail_s: 0.1, stop_s: 0.16"
            ),
        },
    ),
    "short-robust": Variant(
        "forwarder-robust",
        {
            ROBUST_LIMITS: limits("rise_per_s: 4, fall_per_s: 2, tail_s: 0.4, stop_s: 0.6"),
            RADIUS: "radius_m: 6.0",
            LIFT_LIMITS: limits("max_pct: 90, tail_s: 0.2, stop_s: 0.14"),
        },
    ),
    # Valves of 40 and 60 ms, joysticks of 10 ms.
    "slow-valves": Variant(
        "forwarder",
        {
            LIMITS: limits("tail_s: 0.8, stop_s: 0.4"),
            "timeout_ms: 100": "timeout_ms: 60",
        },
        {
            "BO_ 272 20;": "BO_ 272 10;",
            "BO_ 273 20;": "BO_ 273 10;",
            "BO_ 512 20;": "BO_ 512 40;",
            "BO_ 513 20;": "BO_ 513 60;",
        },
    ),
    # What an owner may allow; and limits that never act.
    "allowing": Variant(
        "forwarder",
        {
            LIMITS: limits("tail_s: 0.5, stop_s: 0.5, allow_faster: true, allow_reverse: true"),
            LIFT_LIMITS: limits("rise_per_s: 100, fall_per_s: 100, tail_s: 0, stop_s: 0.1"),
        },
    ),
    # Filters of others; joysticks without counter and reset on a bus of their own.
    "plain": Variant(
        "forwarder",
        {
            BUS: BUS + "\n  joysticks: { interface: socketcan, channel: vcan1 }",
            "    bus: crane\n    message: Joystick": "    bus: joysticks\n    message: Joystick",
            COUNTER: "",
            "    reset: Reset\n": "",
            SLEW_FILTER: "filter: { kind: s_curve, rate_per_s: 4, jerk_per_s2: 40 }\n",
            NEAR_FAR_FILTER: "filter: { kind: zv } # near-far",
            LIFT_FILTER: "filter: { kind: first_order, time_constant_s: 0.1 }",
            LIMITS: limits("tail_s: 1.4, stop_s: 1.0, rise_per_s: 3, fall_per_s: 6"),
        },
    ),
    # A joystick of J1939-71: a magnitude, and flags for its direction.
    "flags": Variant(
        "forwarder",
        {
            "signal: Slew, neutral_pct: 2": "signal: Slew, flags:"
            " { neutral: SlewNeutral, negative: SlewNegative, positive: SlewPositive }",
            LIMITS: limits("tail_s: 0.5, stop_s: 0.6"),
        },
        {
            SLEW: ' SG_ SlewNeutral : 0|2@1+ (1,0) [0|3] "" SHAPER\n'
            ' SG_ SlewNegative : 2|2@1+ (1,0) [0|3] "" SHAPER\n'
            ' SG_ SlewPositive : 4|2@1+ (1,0) [0|3] "" SHAPER\n'
            ' SG_ Slew : 6|10@1+ (0.1,0) [0|100] "%" SHAPER\n',
            'VAL_ 272 Slew 32766 "Error" 32767': 'VAL_ 272 Slew 1022 "Error" 1023',
        },
    ),
    # Everything that can protect an input.
    "protected": Variant(
        "forwarder",
        {
            COUNTER: COUNTER
            + "    alive_max_step: 2\n    qualify: 2\n    stuck_s: 1.0\n"
            + "    checksum: { signal: Checksum, kind: crc8_sae_j1850 }\n",
            LIMITS: limits("tail_s: 0.6, stop_s: 0.5"),
            "axes:\n": "emergency_stop:\n  bus: crane\n  message: EmergencyStop\n"
            "  signal: Stop\n  timeout_ms: 140\n  alive_counter: AliveCounter\n"
            "  checksum: { signal: Checksum, kind: xor }\n\naxes:\n",
        },
        {
            JOYSTICK_COUNTER: JOYSTICK_COUNTER
            + ' SG_ Checksum : 48|8@1+ (1,0) [0|255] "" SHAPER\n',
            NETWORK_END: "BO_ 256 EmergencyStop: 3 PLANT\n"
            ' SG_ Stop : 0|2@1+ (1,0) [0|3] "" SHAPER\n'
            ' SG_ AliveCounter : 8|4@1+ (1,0) [0|15] "" SHAPER\n'
            ' SG_ Checksum : 16|8@1+ (1,0) [0|255] "" SHAPER\n\n' + NETWORK_END,
            "BO_ 273 20;\n": 'BO_ 273 20;\nBA_ "GenMsgCycleTime" BO_ 256 50;\n',
        },
    ),
    "switches": Variant("ecu-forwarder"),
}
NAMES = list(VARIANTS)


@functools.cache
def _directory() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="canshaper-faults-")


@functools.cache
def machine(name: str) -> tuple[Machine, Deployment]:
    """A machine as its files say, and as canshaper has loaded it."""
    path = write(name, VARIANTS[name])
    return Machine(name, path), load_deployment(path)


def write(name: str, variant: Variant) -> Path:
    """Write the files of a variant; return the deployment's."""
    path = Path(_directory().name) / f"{name}.yaml"
    text = (ROOT / "config" / f"{variant.file}.yaml").read_text(encoding="utf-8")
    dbc = "forwarder-joints" if variant.file == "forwarder-joints" else "forwarder"
    network = (ROOT / "dbc" / f"{dbc}.dbc").read_text(encoding="cp1252")
    text = _replaced(text, {**variant.yaml, f"../dbc/{dbc}.dbc": str(path.with_suffix(".dbc"))})
    text = text.replace("../dbc/", f"{ROOT}/dbc/")
    path.write_text(text, encoding="utf-8")
    network = _replaced(network, variant.dbc)
    path.with_suffix(".dbc").write_text(network, encoding="cp1252")
    return path


def _replaced(text: str, pieces: dict[str, str]) -> str:
    for old, new in pieces.items():
        assert old in text, old
        text = text.replace(old, new)
    return text
