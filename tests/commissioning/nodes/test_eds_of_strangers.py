"""EDS files as other tools write them: the same node, or one line that says what to do."""

from pathlib import Path

import pytest

from canshaper.commissioning.nodes.eds import Eds
from canshaper.commissioning.nodes.node import Node
from canshaper.errors import ConfigError
from tests.commissioning.nodes.eds_files import JOYSTICK, U16, U32, eds

TEXT = eds(JOYSTICK)
BEFORE, _, _rest = TEXT.partition("[6401]")
BEHIND = "[6423]" + _rest.partition("[6423]")[2]
ARRAY = """[6401]
ParameterName=Axis
ObjectType=0x8
DataType=0x0003
AccessType=ro
PDOMapping=1
CompactSubObj=2

"""
NAMES = "[6401Name]\nNrOfEntries=2\n1=Slew\n2=Near far\n\n"
NAMED = ["Slew", "Near far", "Buttons"]


def node_of(folder: Path, content: str | bytes) -> Node:
    file = folder / "joy.eds"
    file.write_bytes(content.encode("latin-1") if isinstance(content, str) else content)
    return Node(Eds(file), 16)


def recased(upper: bool) -> str:
    """Keys in another case; names of sections as they are."""
    rows = []
    for row in TEXT.split("\r\n"):
        key, equals, value = row.partition("=")
        rows.append(f"{key.upper() if upper else key.lower()}{equals}{value}" if equals else row)
    return "\r\n".join(rows)


@pytest.mark.parametrize(
    ("content", "names"),
    [
        (TEXT, NAMED),
        (TEXT.replace("PDOMapping=1", "PDOMapping="), NAMED),
        (TEXT.replace("PDOMapping=1", "PDOMapping=\r\nLowLimit=\r\nHighLimit="), NAMED),
        (TEXT.replace("SubNumber=2", "SubNumber="), NAMED),
        (TEXT.replace("ObjectType=0x7", "ObjectType="), NAMED),
        (recased(upper=True), NAMED),
        (recased(upper=False), NAMED),
        (TEXT.replace("sub", "SUB"), NAMED),
        (TEXT.replace("[1A0", "[1a0").replace("sub", "Sub"), NAMED),
        (TEXT.encode("utf-16"), NAMED),
        (BEFORE + ARRAY + BEHIND, ["Axis", "Axis_2", "Buttons"]),
        (BEFORE + ARRAY + NAMES + BEHIND, NAMED),
        (BEFORE + ARRAY + NAMES.replace("Name]", "name]") + BEHIND, NAMED),
        (BEFORE + ARRAY.replace("Sub", "SUB").replace("=2", "=0x2") + NAMES + BEHIND, NAMED),
    ],
)
def test_the_node_is_the_same(tmp_path: Path, content: str | bytes, names: list[str]) -> None:
    node = node_of(tmp_path, content)
    assert [pdo.name for pdo in node.pdos] == ["TPDO1", "TPDO2"]
    assert [one.name for one in node.pdos[0].objects] == names
    assert [one.bits for one in node.pdos[0].objects] == [16, 16, 8]
    assert node.faults == []


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ('<?xml version="1.0"?>\n<ISO15745ProfileContainer/>\n', ":1: expected an EDS or DCF, got"),
        (b"\xef\xbb\xbf<ISO15745ProfileContainer>", " got XML; export an EDS of an XDD or XDC"),
        (
            BEFORE + ARRAY.replace("=2", "=many") + BEHIND,
            "[6401]: CompactSubObj: expected a whole number, got 'many'",
        ),
        (
            eds({0x1000: ("Device type", U32, "0x20192"), 0x6040: ("Control word", U16, "0")}),
            "joy.eds: expected a PDO with objects, got none; map some, and export the DCF",
        ),
    ],
)
def test_what_cannot_be_used_is_said(tmp_path: Path, content: str | bytes, text: str) -> None:
    with pytest.raises(ConfigError) as raised:
        node_of(tmp_path, content)
    assert text in str(raised.value)
    assert "\n" not in str(raised.value)
