"""EDS files in the form of CiA 306, written out for the tests: a joystick, a valve, a sensor."""

from collections.abc import Mapping, Sequence
from pathlib import Path

U8, U16, U32, I16 = 0x05, 0x06, 0x07, 0x03
OFF = 1 << 31
Entry = tuple[str, int, str]  # ParameterName, DataType, DefaultValue
Objects = Mapping[int, Entry | Sequence[Entry]]


def pdo(name: str, cob_id: str, timer: str | None, kind: int = 255) -> list[Entry]:
    """Communication parameters; without ``timer`` there is no subindex 5."""
    entries = [("COB-ID", U32, cob_id), ("Transmission type", U8, str(kind))]
    if timer is not None:
        entries += [("Inhibit time", U16, "0"), ("Reserved", U8, "0"), ("Event timer", U16, timer)]
    return entries


def mapping(*objects: tuple[int, int, int]) -> list[Entry]:
    """Mapping of (index, subindex, bits)."""
    return [
        (f"Object {n}", U32, f"0x{index:04X}{sub:02X}{bits:02X}")
        for n, (index, sub, bits) in enumerate(objects, 1)
    ]


JOYSTICK = {
    0x1000: ("Device type", U32, "0x00050191"),
    0x1010: [("Save all parameters", U32, "1")],
    0x1014: ("COB-ID EMCY", U32, "$NODEID+0x80"),
    0x1017: ("Producer heartbeat time", U16, "0"),
    0x1800: pdo("TPDO1", "$NODEID+0x180", "0"),
    0x1801: pdo("TPDO2", "0x80000280+$NODEID", "0"),
    0x1A00: mapping((0x6401, 1, 16), (0x6401, 2, 16), (0x6000, 1, 8)),
    0x1A01: mapping((0x6401, 1, 16)),
    0x6000: [("Buttons", U8, "")],
    0x6401: [("Slew", I16, ""), ("Near far", I16, "")],
    0x6423: ("Analogue input global interrupt enable", 0x01, "0"),
}
VALVE = {
    0x1000: ("Device type", U32, "0x00000198"),
    0x1014: ("COB-ID EMCY", U32, "$NODEID+0x80"),
    0x1017: ("Producer heartbeat time", U16, "100"),
    0x1400: pdo("RPDO1", "$NODEID+0x200", "0"),
    0x1600: mapping((0x6040, 0, 16), (0x6300, 1, 16)),
    0x1800: pdo("TPDO1", "$NODEID+0x180", "100"),
    0x1801: pdo("TPDO2", "$NODEID+0x280", "50"),
    0x1A00: mapping((0x6041, 0, 16)),
    0x1A01: mapping((0x6301, 1, 16)),
    0x6040: ("Device control word", U16, "0"),
    0x6041: ("Device status word", U16, "0"),
    0x6300: [("Set point", I16, "0")],
    0x6301: [("Actual value", I16, "0")],
}
INCLINOMETER = {
    0x1000: ("Device type", U32, "0x0002019A"),
    0x1017: ("Producer heartbeat time", U16, "200"),
    0x1800: pdo("TPDO1", "$NODEID+0x180", "20"),
    0x1A00: mapping((0x6010, 0, 16), (0x6020, 0, 16)),
    0x6000: ("Resolution", U16, "10"),
    0x6010: ("Slope long16", I16, ""),
    0x6020: ("Slope lateral16", I16, ""),
}


def eds(objects: Objects, node: int | None = None) -> str:
    """Text of an EDS; of a DCF, where there is a node id."""
    lines = ["[FileInfo]", "FileName=test.eds", "EDSVersion=4.0", ""]
    lines += ["[DeviceInfo]", "VendorName=", "VendorNumber=", "BaudRate_250=1", "NrOfTXPDO=2", ""]
    if node is not None:
        lines += ["[DeviceComissioning]", f"NodeID={node}", "NodeName=test", ""]
    lines += ["[MandatoryObjects]", "SupportedObjects=1", "1=0x1000", ""]
    for index, entry in objects.items():
        if isinstance(entry, tuple):
            lines += [f"[{index:04X}]", *_variable(entry), ""]
            continue
        lines += [f"[{index:04X}]", f"ParameterName=Record {index:04X}", "ObjectType=0x9"]
        lines += [f"SubNumber={len(entry) + 1}", ""]
        lines += [f"[{index:04X}sub0]", *_variable(("Entries", U8, str(len(entry)))), ""]
        for sub, one in enumerate(entry, 1):
            lines += [f"[{index:04X}sub{sub:X}]", *_variable(one), ""]
    return "\r\n".join(lines)


def _variable(entry: Entry) -> list[str]:
    name, kind, value = entry
    lines = [f"ParameterName={name}", "ObjectType=0x7", f"DataType=0x{kind:04X} ; a type"]
    return [*lines, "AccessType=rw", f"DefaultValue={value}", "PDOMapping=1"]


def write(path: Path, objects: Objects, node: int | None = None) -> Path:
    """Write it."""
    path.write_text(eds(objects, node), encoding="latin-1", newline="")
    return path
