"""Nodes by their EDS: their PDOs as canopen itself decodes them, what is to be set, bad files."""

import random
from collections.abc import Sequence
from pathlib import Path

import canopen
import cantools
import pytest

from canshaper.commissioning.nodes import messages
from canshaper.commissioning.nodes.eds import Eds
from canshaper.commissioning.nodes.node import Mapped, Node
from canshaper.commissioning.nodes.parameters import (
    MessageTiming,
    heartbeat_ms,
    missing,
    parameters,
)
from canshaper.errors import ConfigError
from tests.commissioning.nodes.eds_files import (
    INCLINOMETER,
    JOYSTICK,
    U8,
    U32,
    VALVE,
    eds,
    mapping,
    pdo,
    write,
)

I8, BOOL, U16, I24, I32, REAL32, U64 = 0x02, 0x01, 0x06, 0x10, 0x04, 0x08, 0x1B
ALL_TYPES = {
    0x1000: ("Device type", U32, "0"),
    0x1800: pdo("TPDO1", "$NODEID+0x180", "20"),
    0x1801: pdo("TPDO2", "$NODEID + 0x280", "20", 254),
    0x1802: pdo("TPDO3", "0x20000380+$NODEID", None),
    0x1803: pdo("TPDO4", "0x40000480+$NODEID", "20"),
    0x1A00: mapping((0x2000, 1, 8), (0x2000, 3, 24), (0x2000, 4, 16), (0x2000, 2, 1)),
    0x1A01: mapping((0x2000, 5, 32), (0x2000, 6, 32)),
    0x1A02: mapping((0x2000, 7, 64)),
    0x1A03: mapping((0x2000, 4, 16), (0x2000, 4, 16), (0x2000, 1, 8)),
    0x2000: [
        ("x", I8, ""),
        ("y", BOOL, ""),
        ("Z axis/raw", I24, ""),
        ("2nd", U16, ""),
        ("x y z", I32, ""),
        ("f", REAL32, ""),
        ("u", U64, ""),
    ],
}


ONE = {key: JOYSTICK[key] for key in JOYSTICK if key not in (0x1801, 0x1A01)}


def node_of(folder: Path, objects: dict, node: int = 5, name: str = "node.eds") -> Node:
    return Node(Eds(write(folder / name, objects)), node)


def canopens(path: Path, node: int) -> Sequence[canopen.pdo.base.PdoMap]:
    """Every PDO, as canopen reads it, which takes no empty numbers in DeviceInfo."""
    path.write_bytes(path.read_bytes().replace(b"VendorNumber=", b"VendorNumber=0"))
    remote = canopen.Network().add_node(canopen.RemoteNode(node, str(path)))
    remote.rpdo.read(from_od=True)
    remote.tpdo.read(from_od=True)
    return [*remote.rpdo.values(), *remote.tpdo.values()]


@pytest.mark.parametrize("objects", [JOYSTICK, VALVE, INCLINOMETER, ALL_TYPES])
def test_pdos_are_those_that_canopen_decodes(objects: dict, tmp_path: Path) -> None:
    node = node_of(tmp_path, objects)
    file = tmp_path / "node.dbc"
    file.write_text(messages.dbc(messages.messages(node, "n", ())))
    ours = cantools.database.load_file(file)
    theirs = canopens(tmp_path / "node.eds", 5)
    assert len(ours.messages) == len(theirs) == len(node.pdos)
    rng = random.Random(1)
    for one in theirs:
        message = next(m for m in ours.messages if m.frame_id == one.cob_id)
        for _ in range(100):
            one.data = bytearray(rng.randbytes(message.length))
            decoded = message.decode(one.data, decode_choices=False, scaling=False)
            values = [decoded[s.name] for s in sorted(message.signals, key=lambda s: s.start)]
            assert repr(values) == repr([int(v.raw) if v.length == 1 else v.raw for v in one])


def test_ids_timers_and_lengths_are_those_of_the_file(tmp_path: Path) -> None:
    parsed = messages.messages(node_of(tmp_path, ALL_TYPES), "n", ())
    assert [(m.name, m.frame_id, m.is_extended_frame, m.cycle_time, m.length) for m in parsed] == [
        ("n_TPDO1", 0x185, False, 20, 7),
        ("n_TPDO2", 0x285, False, 20, 8),
        ("n_TPDO3", 0x385, True, None, 8),
        ("n_TPDO4", 0x485, False, 20, 5),
    ]
    assert [s.name for s in parsed[0].signals] == ["X", "ZAxisRaw", "S2nd", "Y"]
    assert [s.name for s in parsed[3].signals] == ["Record20002nd_1", "Record20002nd_2", "X"]


def test_each_bit_of_switches_is_a_signal_and_profiles_give_units(tmp_path: Path) -> None:
    joystick = node_of(tmp_path, JOYSTICK, 0x10)
    assert messages.bytes_of(joystick) == {"Buttons": True}
    stick, _ = messages.messages(joystick, "left", ["Buttons"], 20)
    assert [(s.name, s.start, s.length) for s in stick.signals[2:]] == [
        (f"Buttons_{bit + 1}", 32 + bit, 1) for bit in range(8)
    ]
    assert (stick.cycle_time, [one.on for one in joystick.pdos]) == (20, [True, False])
    command = messages.messages(node_of(tmp_path, VALVE), "v", ())[0]
    set_point = command.get_signal_by_name("SetPoint")
    assert (set_point.minimum, set_point.maximum) == (-16384, 16384)
    slope = messages.messages(node_of(tmp_path, INCLINOMETER), "s", ())[0].signals[0]
    assert (slope.scale, slope.unit, slope.is_signed) == (0.01, "deg", True)


def test_a_name_with_its_parents_is_not_the_own_name_of_another() -> None:
    named = (("Value", "Analogue"), ("Value", "Digital"), ("Analogue value", "Raw"))
    objects = [Mapped(n, of, 0x2000, 1, 0, 8, False, False, None, None) for n, of in named]
    assert messages.labels(objects) == ["AnalogueValue_1", "DigitalValue", "AnalogueValue"]


def test_a_dcf_has_its_node_id_and_its_values(tmp_path: Path) -> None:
    text = eds(VALVE, 0x21).replace(
        "DefaultValue=100\r\n", "DefaultValue=0\r\nParameterValue=250\r\n"
    )
    file = tmp_path / "valve.dcf"
    file.write_bytes(b"\xef\xbb\xbf" + text.replace("test", "ventil für").encode())
    read = Eds(file)
    assert read.node == 0x21
    node = Node(read, 0x21)
    assert [p.event_timer_ms for p in node.pdos] == [0, 250, 50]
    assert heartbeat_ms(node) == 625


def test_what_has_to_be_set_is_what_differs(tmp_path: Path) -> None:
    guarded = JOYSTICK | {
        0x100C: ("Guard time", U16, "100"),
        0x1014: ("COB-ID EMCY", U32, "0x80000090"),
        0x1800: pdo("TPDO1", "$NODEID+0x180", "50", 1),
    }
    node = node_of(tmp_path, guarded, 0x10)
    used = [(node.pdos[0], MessageTiming(20, 100))]
    assert [(one.where, one.value) for one in parameters("left", node, used)] == [
        ("1017h:0", 200),
        ("100Ch:0", 0),
        ("1014h:0", 0x90),
        ("1800h:2", 255),
        ("1800h:5", 20),
        ("6423h:0", 1),
        ("1010h:1", 0x65766173),
    ]
    off = [(node.pdos[1], MessageTiming(20, 100))]
    assert ("1801h:1", 0x290) in [(p.where, p.value) for p in parameters("left", node, off)]
    valve = node_of(tmp_path, VALVE, 0x20)
    command, status, _ = valve.pdos
    used = [(command, MessageTiming(20, 300)), (status, MessageTiming(100, 300))]
    assert [(one.where, one.value) for one in parameters("slew", valve, used)] == [("1400h:5", 300)]
    assert list(missing(valve, used)) == []


def test_what_a_node_has_not_is_said(tmp_path: Path) -> None:
    bare = {key: VALVE[key] for key in VALVE if key not in (0x1014, 0x1017)}
    bare |= {0x1400: pdo("RPDO1", "$NODEID+0x200", None), 0x1800: pdo("T", "$NODEID+0x180", None)}
    node = node_of(tmp_path, bare)
    used = [(node.pdos[0], MessageTiming(20, 300)), (node.pdos[1], MessageTiming(100, 300))]
    assert list(missing(node, used)) == [
        "has no heartbeat (1017h); it is not supervised",
        "reports no errors of its own (no 1014h)",
        "RPDO1 has no event timer (1400h:5): it keeps its last command when we are silent",
        "TPDO1 has no event timer (1800h:5): expected every 100 ms by other means",
    ]
    assert heartbeat_ms(node) is None
    assert parameters("v", node, used) == []


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (
            {0x1A00: mapping(*[(0x6401, 1, 16)] * 5)},
            "joy.eds:{line}: [1A00sub5]: expected a mapping of 8 bytes at most, got 80 bits",
        ),
        (
            {0x1A00: mapping((0x7000, 3, 16))},
            "joy.eds:{line}: [1A00sub1]: expected an object of the file, got 7000h:3",
        ),
        (
            {0x1800: pdo("TPDO1", "0x583", "20")},
            "joy.eds:{line}: [1800sub1]: expected the identifier of a PDO, got 0x583, SDO",
        ),
        (
            {0x1800: pdo("TPDO1", "TBD", "20")},
            "joy.eds:{line}: [1800sub1]: expected a whole number, got 'TBD'",
        ),
        (
            {0x1A00: [("Object 1", U8, "")]},
            "joy.eds:{line}: [1A00sub1]: expected object 1 of 1 that are mapped, got none",
        ),
        (
            {0x1800: pdo("TPDO1", "0x80000000", "20"), 0x1801: pdo("T", "0x190", "1"), 0x1A01: []},
            "joy.eds: expected a PDO with objects, got TPDO1 without identifier (1800h:1), TPDO2"
            " empty (1A01h:0); map some, and export the DCF",
        ),
    ],
)
def test_pdos_that_cannot_be_are_named_with_section_and_line(
    change: dict, fault: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError) as raised:
        node_of(tmp_path, ONE | change, name="joy.eds")
    text = eds(ONE | change)
    section = fault.partition("[")[2].partition("]")[0]
    line = text[: text.index(f"[{section}]")].count("\n") + 1 if section else 0
    assert str(raised.value) == f"{tmp_path}/{fault.format(line=line)}"


def test_one_bad_pdo_does_not_stop_the_others(tmp_path: Path) -> None:
    node = node_of(tmp_path, VALVE | {0x1A01: mapping((0x6301, 1, 16), (0x9999, 0, 8))})
    assert [one.name for one in node.pdos] == ["RPDO1", "TPDO1"]
    (fault,) = node.faults
    assert "[1A01sub2]: expected an object of the file, got 9999h:0" in str(fault)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (b"", "expected objects, such as [1000], got none; not an EDS or DCF"),
        (b"\x7fELF\x02\x00\x01", ":1: expected sections of KEY=VALUE, each once"),
        (b"hello\nworld", ":1: expected sections of KEY=VALUE, each once, as an EDS or DCF has"),
        (b"[1000]\nnothing here\n", ":2: expected sections of KEY=VALUE"),
        (b"[1000]\nA=1\nA=2\n", ":3: expected sections of KEY=VALUE"),
        (b"[1000]\nA=1\n[1000]\n", ":3: expected sections of KEY=VALUE"),
        (b"[FileInfo]\nFileName=x\n", "expected objects, such as [1000], got none"),
        (b"\n[1000]\nObjectType=0x7\n", ":2: [1000]: expected ParameterName, got none"),
        (b"[1000]\nParameterName=a\n", ":1: [1000]: expected DataType, got none"),
        (b"[1000]\nParameterName=a\nObjectType=x\n", "[1000]: ObjectType: expected a whole number"),
        (
            b"[1800sub1]\nParameterName=a\nDataType=7\nAccessType=rw\n",
            ":1: [1800sub1]: expected a section [1800] as well, got none",
        ),
        (
            b"[DeviceComissioning]\nNodeID=x\n[1000]\nParameterName=a\nDataType=7\nAccessType=ro\n",
            ":1: [DeviceComissioning]: NodeID: expected a whole number, got 'x'",
        ),
    ],
)
def test_a_file_that_is_none_is_reported_in_one_line(
    text: bytes, fault: str, tmp_path: Path
) -> None:
    file = tmp_path / "joy.eds"
    file.write_bytes(text)
    with pytest.raises(ConfigError) as raised:
        Eds(file)
    assert str(raised.value).startswith(f"{file}:")
    assert fault in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("seed", range(300))
def test_garbled_files_are_read_or_refused(seed: int, tmp_path: Path) -> None:
    """Lines lost, doubled or cut: an answer in words, never another exception."""
    rng = random.Random(seed)
    lines = eds(rng.choice([JOYSTICK, VALVE, ALL_TYPES]), 16).splitlines()
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(lines))
        what = rng.randrange(4)
        if what == 0:
            del lines[at]
        elif what == 1:
            lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
        elif what == 2:
            lines.insert(at, rng.choice(lines))
        else:
            lines[at] = (
                lines[at].partition("=")[0] + "=" + rng.choice(["", "-1", "0xFFFFFFFF", "a"])
            )
    file = tmp_path / "joy.eds"
    file.write_text("\n".join(lines))
    try:
        node = Node(Eds(file), 16)
    except ConfigError as error:
        assert str(error).startswith(f"{file}")  # either is good
        return
    parsed = messages.messages(node, "n", messages.bytes_of(node))
    assert messages.dbc(parsed)
    parameters("n", node, [(one, MessageTiming(20, 100)) for one in node.pdos])
