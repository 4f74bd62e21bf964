"""Valve messages of a machine: with a direction by codes, and one for several axes."""

from typing import Any

import cantools

from tests.rigs.files import Machine

# ISO 11783-7 auxiliary valve command 0; the reserved bits and bytes 6 to 8 have no signals.
DBC = """VERSION ""

BU_: SHAPER VALVE

BO_ 2365468926 AVC0: 8 SHAPER
 SG_ PortFlow : 0|8@1+ (0.4,0) [0|100] "%" VALVE
 SG_ ResolutionMode : 8|2@1+ (1,0) [0|3] "" VALVE
 SG_ State : 16|4@1+ (1,0) [0|15] "" VALVE
 SG_ FailSafe : 22|2@1+ (1,0) [0|3] "" VALVE
 SG_ ExtFlow : 24|16@1+ (0.0015625,0) [0|100] "%" VALVE

BO_ 1280 Block: 8 SHAPER
 SG_ First : 0|8@1- (0.8,0) [-100|100] "%" VALVE
 SG_ Second : 15|8@0- (0.8,0) [-100|100] "%" VALVE
 SG_ Third : 16|8@1+ (0.4,0) [0|100] "%" VALVE
 SG_ ThirdState : 24|2@1+ (1,0) [0|3] "" VALVE
 SG_ Falling : 32|8@1- (-1,2) [-100|100] "%" VALVE
 SG_ Count : 60|4@1+ (1,0) [0|15] "" VALVE

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_ SG_ "GenSigStartValue" FLOAT -100000 100000;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "GenMsgCycleTime" BO_ 2365468926 20;
BA_ "GenMsgCycleTime" BO_ 1280 20;
BA_ "VFrameFormat" BO_ 2365468926 3;
BA_ "GenSigStartValue" SG_ 2365468926 FailSafe 0;
BA_ "GenSigStartValue" SG_ 1280 Falling 2;
VAL_ 2365468926 State 0 "Block" 1 "Extend" 2 "Retract" 3 "Float" 15 "DontCare" ;
"""
network: Any = cantools.database.load_string(DBC, "dbc")
CODES = "direction: { signal: State, neutral: 0, positive: 1, negative: 2 }"
ALIVE = " alive_counter: AliveCounter"
NODE = "j1939: { address: 0x9C, name: { identity_number: 1, manufacturer_code: 1 } }"


def with_valves(machine: Machine, *valves: tuple[str, str]) -> Machine:
    """The shipped machine with a second DBC file and other valves of some axes."""
    (machine.directory / "valves.dbc").write_text(DBC, encoding="cp1252")
    machine.in_yaml("[machine.dbc]", "[machine.dbc, valves.dbc]")
    for axis, valve in valves:
        machine.in_yaml(f"message: {axis}Command, signal: Velocity, timeout_ms: 200,{ALIVE}", valve)
    if "AVC0" in machine.yaml:
        machine.in_yaml("bitrate: 250000", f"bitrate: 250000, {NODE}")
    return machine
