"""DBC files as other tools write them: read right, or refused with the line and what to write."""

from pathlib import Path

import pytest

from canshaper.machine.database import load_dbc

DEFINITION = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 20;\n'
DBC = f"""VERSION ""

BU_: ECU OTHER

BO_ 272 Joystick: 4 ECU
 SG_ Slew : 0|8@1- (1,0) [-100|100] "%" OTHER
 SG_ Reset : 8|1@1+ (1,0) [0|1] "" OTHER

BO_ 273 Unused: 1 ECU
 SG_ Spare : 0|8@1+ (1,0) [0|255] "" OTHER

CM_ BO_ 272 "Knüppel";
{DEFINITION}BA_ "GenMsgCycleTime" BO_ 272 40;
"""
HAS = "not a DBC file that can be used: "
WHOLE = "Joystick: GenMsgCycleTime: expected a whole number of ms, got "


def loaded(folder: Path, content: str | bytes) -> tuple[int | None, str]:
    """Cycle of the message; or what is wrong."""
    path = folder / "a.dbc"
    path.write_bytes(content.encode("cp1252") if isinstance(content, str) else content)
    file, wrong = load_dbc(path, {"Joystick"})
    if file is None:
        return None, "\n".join(str(one).removeprefix(f"{folder}/") for one in wrong)
    (message,) = file.messages
    assert [signal.name for signal in message.signals] == ["Slew", "Reset"]
    return message.cycle_time, ""


def declared(kind: str, default: str, value: str) -> str:
    content = DBC.replace("INT 0 65535", kind).replace('Time" 20;', f'Time" {default};')
    return content.replace("BO_ 272 40;", f"BO_ 272 {value};")


@pytest.mark.parametrize(
    ("content", "cycle_ms"),
    [
        (DBC, 40),
        (declared("FLOAT 0 65535", "20", "40"), 40),
        (declared("FLOAT 0 65535", "20.0", "40.000"), 40),
        (declared("STRING", '"20"', '"40"'), 40),
        (declared("STRING", '""', '" 40.0 "'), 40),
        (declared("HEX 0 65535", "20", "40"), 40),
        (declared("INT 0 65535", "0", "0"), None),
        (DBC.replace('"%" OTHER', '"%"'), 40),
        (DBC.replace('"" OTHER', '""').replace('"%" OTHER', '"%" '), 40),
        (DBC.replace('"%" OTHER', '"%"\n   OTHER'), 40),
        (DBC.replace("Joystick: 4 ECU", "Joystick: 4"), 40),
        (DBC.replace("\n", "\r\n").replace(" OTHER\r", "\r"), 40),
        (DBC.encode("utf-8-sig"), 40),
        (DBC.encode("utf-16"), 40),
        (DBC.encode("utf-16-be"), 40),
        (DBC.replace("\n", "\r\n").encode("utf-16-le"), 40),
    ],
)
def test_it_is_read(tmp_path: Path, content: str | bytes, cycle_ms: int | None) -> None:
    assert loaded(tmp_path, content) == (cycle_ms, "")


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (declared("FLOAT 0 65535", "20", "40.5"), f"a.dbc:5: {WHOLE}40.5"),
        (declared("STRING", '"20"', '"40 ms"'), f"a.dbc:5: {WHOLE}'40 ms'"),
        (declared("INT -100 65535", "20", "-20"), f"a.dbc:5: {WHOLE}-20"),
        (
            DBC.replace(DEFINITION, ""),
            f'a.dbc:13: {HAS}expected BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535; before it',
        ),
        (
            DBC + 'BA_ "Maker" "A and B";\n',
            f'a.dbc:16: {HAS}expected BA_DEF_ "Maker" STRING; before it',
        ),
        (
            DBC + 'BA_ "Level" SG_ 272 Slew 3;\n',
            f'a.dbc:16: {HAS}expected BA_DEF_ SG_ "Level" INT 0 65535; before it',
        ),
        (
            DBC.replace(" SG_ Reset", ' SG_ Slew : 16|8@1- (1,0) [0|1] "" OTHER\n SG_ Reset'),
            f"a.dbc:7: {HAS}Joystick has the signal Slew twice: rename one",
        ),
        (
            DBC
            + 'BA_DEF_ SG_ "GenSigStartValue" STRING;\nBA_ "GenSigStartValue" SG_ 272 Slew "1";',
            f"a.dbc:17: {HAS}expected GenSigStartValue as INT, HEX or FLOAT",
        ),
    ],
)
def test_it_is_refused_with_its_line(tmp_path: Path, content: str, text: str) -> None:
    assert loaded(tmp_path, content) == (None, text)
