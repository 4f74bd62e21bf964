"""A small machine whose every message is protected by AUTOSAR E2E, or by counter and checksum."""

from pathlib import Path

from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment

IDS = list(range(0x10, 0x20))

DBC = """VERSION ""

BU_: JOYSTICKS SHAPER VALVES

BO_ 64 Stop: 3 JOYSTICKS
 SG_ Pressed : 16|2@1+ (1,0) [0|3] "" SHAPER

BO_ 272 Joystick: 8 JOYSTICKS
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" SHAPER
 SG_ Seq : 8|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Top : 12|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Slew : 16|16@1- (0.1,0) [-100|100] "%" SHAPER
 SG_ NearFar : 39|16@0- (0.1,0) [-100|100] "%" SHAPER
 SG_ Enable : 48|2@1+ (1,0) [0|1] "" SHAPER
 SG_ Alive : 56|8@1+ (1,0) [0|255] "" SHAPER

BO_ 512 Valves: 6 SHAPER
 SG_ Low : 12|4@1+ (1,0) [0|15] "" VALVES
 SG_ Slew : 16|8@1- (0.8,0) [-100|100] "%" VALVES
 SG_ NearFar : 24|8@1- (0.8,0) [-100|100] "%" VALVES
 SG_ Alive : 32|5@1+ (1,0) [0|31] "" VALVES
 SG_ Check : 40|8@1+ (1,0) [0|255] "" VALVES

BO_ 768 SlewStatus: 8 SHAPER
 SG_ State : 12|4@1+ (1,0) [0|15] "" JOYSTICKS
 SG_ Reason : 16|8@1+ (1,0) [0|255] "" JOYSTICKS
 SG_ RawCommand : 24|8@1- (1,0) [-100|100] "%" JOYSTICKS
 SG_ ShapedCommand : 32|8@1- (1,0) [-100|100] "%" JOYSTICKS
 SG_ PredictedSway : 40|8@1- (1,0) [-100|100] "deg" JOYSTICKS

BO_ 784 ShaperStatus: 7 SHAPER
 SG_ LastFault : 0|8@1+ (1,0) [0|255] "" JOYSTICKS
 SG_ MissedDeadlines : 8|8@1+ (1,0) [0|255] "" JOYSTICKS
 SG_ WrongLength : 16|4@1+ (1,0) [0|15] "" JOYSTICKS
 SG_ UnknownId : 20|4@1+ (1,0) [0|15] "" JOYSTICKS
 SG_ ErrorFrames : 24|8@1+ (1,0) [0|255] "" JOYSTICKS
 SG_ InvalidSignals : 32|8@1+ (1,0) [0|255] "" JOYSTICKS
 SG_ SendFailures : 40|4@1+ (1,0) [0|15] "" JOYSTICKS
 SG_ Alive : 44|3@1+ (1,0) [0|7] "" JOYSTICKS
 SG_ Check : 55|8@0+ (1,0) [0|255] "" JOYSTICKS

BO_ 1025 TipPosition: 4 JOYSTICKS
 SG_ Radius : 16|16@1+ (0.001,0) [0|60] "m" SHAPER

BO_ 1026 Short: 1 JOYSTICKS
 SG_ Radius : 0|8@1+ (0.2,0) [0|50] "m" SHAPER

BO_ 1027 Half: 4 JOYSTICKS
 SG_ Radius : 11|13@1+ (0.01,0) [0|60] "m" SHAPER

BO_ 1028 Big: 4 JOYSTICKS
 SG_ Radius : 11|12@0+ (0.02,0) [0|60] "m" SHAPER

BO_ 1029 Apart: 4 JOYSTICKS
 SG_ Radius : 23|16@0+ (0.001,0) [0|60] "m" SHAPER

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 64 20;
BA_ "GenMsgCycleTime" BO_ 272 20;
BA_ "GenMsgCycleTime" BO_ 512 20;
BA_ "GenMsgCycleTime" BO_ 768 100;
BA_ "GenMsgCycleTime" BO_ 784 100;
BA_ "GenMsgCycleTime" BO_ 1025 20;
"""

JOYSTICK = "{ profile: p01, data_id: 0x123, data_id_mode: both }"
STOP = "{ profile: p01, data_id: 0xA42, data_id_mode: nibble }"
VALVES = f"{{ profile: p02, data_ids: {IDS} }}"
STATUS = "{ profile: p01, data_id: 0x234, data_id_mode: alternating }"
RADIUS = "{ profile: p01, data_id: 0x77, data_id_mode: low }"

YAML = f"""version: 1
buses:
  crane: {{ interface: socketcan, channel: vcan0 }}
dbc: [machine.dbc]
joysticks:
  hand:
    bus: crane
    message: Joystick
    timeout_ms: 100
    enable: Enable
    e2e: {JOYSTICK}
    qualify: 2
motion:
  crane:
    slew: slew
    near_far: near_far
    radius:
      bus: crane
      message: TipPosition
      signal: Radius
      timeout_ms: 100
      e2e: {RADIUS}
axes:
  slew:
    command: {{ joystick: hand, signal: Slew }}
    valve:
      bus: crane
      message: Valves
      signal: Slew
      timeout_ms: 200
      e2e: {VALVES}
    status:
      bus: crane
      message: SlewStatus
      e2e: {STATUS}
    sway: {{ period_s: 2.356, damping_ratio: 0.038, full_speed_m_s: 1.5 }}
    slewing: {{ full_speed_rad_s: 0.5, largest_radius_m: 9.6 }}
    filter: {{ kind: gff, a1: 0.708, a2: 0.12 }}
  near_far:
    command: {{ joystick: hand, signal: NearFar }}
    valve:
      bus: crane
      message: Valves
      signal: NearFar
      timeout_ms: 200
      e2e: {VALVES}
    sway: {{ length_m: 1.2, damping_nms: 120, mass_kg: 300, full_speed_m_s: 1.0 }}
    filter: {{ kind: gff, a1: 0.708, a2: 0.12 }}
emergency_stop:
  bus: crane
  message: Stop
  signal: Pressed
  timeout_ms: 100
  e2e: {STOP}
status:
  bus: crane
  message: ShaperStatus
  alive_counter: Alive
  checksum: {{ signal: Check, kind: crc8_sae_j1850 }}
"""


def load(directory: Path, *changes: tuple[str, str]) -> Deployment:
    """The machine with the first of each piece of its deployment file replaced by another."""
    text = YAML
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    (directory / "machine.yaml").write_text(text, encoding="utf-8")
    (directory / "machine.dbc").write_text(DBC, encoding="cp1252")
    return load_deployment(directory / "machine.yaml")


def problems(directory: Path, *changes: tuple[str, str]) -> list[str]:
    """Problems of the changed machine, without the directory."""
    try:
        load(directory, *changes)
    except ConfigError as error:
        return [str(p).replace(f"{directory}/", "") for p in error.problems]
    return []


def line_of(piece: str) -> int:
    """Line of the first such piece in the unchanged deployment file."""
    return YAML[: YAML.index(piece)].count("\n") + 1
