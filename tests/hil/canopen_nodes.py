"""Nodes of another maker, on the library ``canopen``: joysticks, valves, a drive, an inclinometer.

Object dictionary, states and emergency codes of the valve of CiA 408 are those of the public
description of a PVED-CC Series 5; its state machine is that of the VDMA profile. Which object is in
which PDO is each machine's own, by ``Parts``.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import canopen
from canopen.nmt import NMT_STATES

JOYSTICKS = {"left": 0x10, "right": 0x11}
VALVES = {"slew": 0x20, "near_far": 0x21, "lift": 0x22}
INIT, DISABLED, HOLD, ACTIVE, FAULT_HOLD = 0x8, 0x9, 0xB, 0xF, 0x3
UP = {INIT: DISABLED, DISABLED: HOLD, HOLD: ACTIVE}
FLOW_COMMAND_LATE = 0x8003
I8, I16, I32, U8, U16, U32 = 0x02, 0x03, 0x04, 0x05, 0x06, 0x07
CONTROL_WORD, STATUS_WORD, DEVICE_MODE = (0x6040, 0, 16), (0x6041, 0, 16), (0x6042, 0, 8)
SET_POINT, POSITION, PRESSURE = (0x6300, 1, 16), (0x6301, 1, 16), (0x6380, 1, 16)
TARGET_VELOCITY, ACTUAL_VELOCITY = (0x60FF, 0, 32), (0x606C, 0, 32)
SLOPE_LONG, SLOPE_LATERAL = (0x6010, 0, 16), (0x6020, 0, 16)
OVER_CAN = 1  # the device mode in which the set point of the PDO counts
Object = tuple[int, int, int]  # index, subindex, bits
Pdos = dict[str, tuple[int, list[Object]]]
"""COB-ID without the node's number, and mapped objects, of r1 to r4 and t1 to t4."""
OBJECTS = {
    CONTROL_WORD: ("Device control word", U16),
    STATUS_WORD: ("Device status word", U16),
    DEVICE_MODE: ("Device mode", I8),
    SET_POINT: ("Vpoc set point", I16),
    POSITION: ("Vpoc actual value", I16),
    PRESSURE: ("Vprc set point", I16),
    TARGET_VELOCITY: ("Target velocity", I32),
    ACTUAL_VELOCITY: ("Velocity actual value", I32),
    SLOPE_LONG: ("Slope long16", I16),
    SLOPE_LATERAL: ("Slope lateral16", I16),
    (0x6401, 1, 16): ("Read analogue input", I16),
    (0x6401, 2, 16): ("Read analogue input", I16),
    (0x6000, 1, 8): ("Read input", U8),
}
JOYSTICK: Pdos = {"t1": (0x180, [(0x6401, 1, 16), (0x6401, 2, 16), (0x6000, 1, 8)])}
INCLINOMETER: Pdos = {"t1": (0x180, [SLOPE_LONG, SLOPE_LATERAL])}
DRIVE: Pdos = {"r1": (0x200, [TARGET_VELOCITY]), "t2": (0x280, [ACTUAL_VELOCITY])}
VALVE: Pdos = {
    "r1": (0x200, [CONTROL_WORD, SET_POINT]),
    "t1": (0x180, [STATUS_WORD]),
    "t2": (0x280, [POSITION]),
}
VALVE_WITH_MODE: Pdos = {**VALVE, "r1": (0x200, [CONTROL_WORD, SET_POINT, DEVICE_MODE])}
SERVO_VALVE: Pdos = {
    "r4": (0x500, [CONTROL_WORD, SET_POINT, PRESSURE]),
    "t1": (0x180, [STATUS_WORD, POSITION]),
}


@dataclass(frozen=True)
class Parts:
    """Nodes on the bus of a machine.

    Attributes:
        valves: PDOs of each valve of CiA 408.
        joysticks: whether they are of CiA 401.
        drive: node number of a drive of CiA 402 that slews in place of a valve.
        inclinometer: node number of one of CiA 410.
    """

    valves: Pdos
    joysticks: bool = True
    drive: int | None = None
    inclinometer: int | None = None


JOYSTICK_CYCLE_S, STATUS_CYCLE_S = 0.02, 0.1
STATES = {name: number for number, name in NMT_STATES.items()}


def write_eds(path: Path, pdos: Pdos) -> str:
    """A description with these PDOs and the objects in them."""
    sections = {
        "DeviceInfo": {"NrOfRXPDO": 4, "NrOfTXPDO": 4},
        "1017": entry("Producer heartbeat time", U16, 0),  # by hand: no BCM in every kernel
    }
    optional = [0x1017]
    for key, (cob_id, mapped) in pdos.items():
        base = {"r": 0x1400, "t": 0x1800}[key[0]] + int(key[1]) - 1
        records = {
            base: [(U32, f"$NODEID+{cob_id:#x}"), (U8, 255)],
            base + 0x200: [(U32, (index << 16) + (sub << 8) + bits) for index, sub, bits in mapped],
        }
        for index, values in records.items():
            add_record(sections, index, f"PDO {index:04X}", values)
            optional.append(index)
    objects = {one: OBJECTS[one] for _, mapped in pdos.values() for one in mapped}
    for (index, sub, _), (name, kind) in objects.items():
        if sub:
            add_record(sections, index, name, [(kind, 0)] * sub)
        else:
            sections[f"{index:04X}"] = entry(name, kind, 0)
        optional.append(index)
    sections["MandatoryObjects"] = {"SupportedObjects": 0}
    listed = {str(i): hex(index) for i, index in enumerate(optional, 1)}
    sections["OptionalObjects"] = {"SupportedObjects": len(optional), **listed}
    text = "\n".join(
        f"[{name}]\n" + "\n".join(f"{k}={v}" for k, v in values.items()) + "\n"
        for name, values in sections.items()
    )
    path.write_text(text)
    return str(path)


def entry(name: str, kind: int, value: object) -> dict[str, object]:
    return {
        "ParameterName": name,
        "ObjectType": "0x7",
        "DataType": hex(kind),
        "AccessType": "rw",
        "DefaultValue": value,
        "PDOMapping": 1,
    }


def add_record(sections: dict, index: int, name: str, values: list[tuple[int, object]]) -> None:
    sections[f"{index:04X}"] = {
        "ParameterName": name,
        "ObjectType": "0x9",
        "SubNumber": len(values) + 1,
    }
    for sub, (kind, value) in enumerate([(U8, len(values)), *values]):
        sections[f"{index:04X}sub{sub}"] = entry(f"{name} {sub}", kind, value)


class Unit:
    """A node with its PDOs; what it sends it has in ``values``, by index and subindex."""

    def __init__(self, network: canopen.Network, number: int, folder: Path, pdos: Pdos) -> None:
        eds = write_eds(folder / f"{number:02x}.eds", pdos)
        self.node = network.create_node(canopen.LocalNode(number, eds))
        self.node.tpdo.read(from_od=True)
        self.node.rpdo.read(from_od=True)
        self._sent = [self.node.tpdo[int(key[1])] for key in pdos if key[0] == "t"]
        for key in pdos:
            if key[0] == "r":
                self.node.rpdo[int(key[1])].add_callback(self._received)
        self.values: dict[tuple[int, int], int] = {}
        self.silent = self.dead = False

    def boot(self) -> None:
        """Power on, or a reset of the node."""
        self.node.nmt.state = "INITIALISING"  # which sends the boot-up message
        self.node.nmt.state = "PRE-OPERATIONAL"

    def fall_silent(self) -> None:
        """No PDO from it any more, and no heartbeat; it still receives."""
        self.silent = self.dead = True

    def send(self) -> None:
        """Its PDOs, as its event timers and every change have it."""
        if self.node.nmt.state == "OPERATIONAL" and not self.silent:
            for pdo in self._sent:
                for variable in pdo:
                    variable.raw = self.values.get((variable.index, variable.subindex), 0)
                pdo.transmit()

    def _received(self, pdo: canopen.pdo.base.PdoMap) -> None:
        if self.node.nmt.state == "OPERATIONAL":
            self.apply({(variable.index, variable.subindex): variable.raw for variable in pdo})

    def apply(self, received: dict[tuple[int, int], int]) -> None:
        """Act on a PDO."""


class Joystick(Unit):
    """CiA 401: two analogue inputs and a byte of switches in one PDO, sent by its event timer."""

    x = y = 0
    switches = 1

    def send(self) -> None:
        self.values = {(0x6401, 1): self.x, (0x6401, 2): self.y, (0x6000, 1): self.switches}
        super().send()


class Drive(Unit):
    """CiA 402 in profile velocity mode, brought to "operation enabled" by its own master."""

    spool = 0

    def apply(self, received: dict[tuple[int, int], int]) -> None:
        self.spool = received[TARGET_VELOCITY[:2]]
        self.values[ACTUAL_VELOCITY[:2]] = self.spool


class Valve(Unit):
    """CiA 408: follows its set point in the state ACTIVE, which it is commanded to step by step."""

    stuck = False

    def boot(self) -> None:
        self.state, self.spool, self._word = INIT, 0, 0
        self.words: list[int] = []
        super().boot()

    def fault(self, code: int) -> None:
        """The spool goes to neutral, the ready bit away, and that is reported."""
        self.state, self.spool = FAULT_HOLD, 0
        self.node.emcy.send(code, 0x81)
        self.send()

    def apply(self, received: dict[tuple[int, int], int]) -> None:
        word, set_point = received[CONTROL_WORD[:2]], received[SET_POINT[:2]]
        if not self.words or word != self.words[-1]:
            self.words.append(word)
        before = self.state
        if before == FAULT_HOLD:
            if (self._word, word) == (FAULT_HOLD, HOLD) and not self.stuck:
                self.state = HOLD
                self.node.emcy.reset()
        elif UP.get(before) == word or (word in (INIT, *UP) and word < before):
            self.state = word
        self._word = word
        over_can = received.get(DEVICE_MODE[:2], OVER_CAN) == OVER_CAN
        self.spool = set_point if self.state == ACTIVE and over_can else 0
        if self.state != before:
            self.send()

    def send(self) -> None:
        self.values = {STATUS_WORD[:2]: self.state, POSITION[:2]: self.spool}
        super().send()


class Machine(threading.Thread):
    """Nodes of one bus, at their cycles: by default two joysticks and three valves."""

    def __init__(self, folder: Path, parts: Parts | None = None, **bus: object) -> None:
        super().__init__(daemon=True)
        self.network = canopen.Network()
        self.network.connect(**bus)
        parts = parts or Parts(VALVE)
        numbers = JOYSTICKS if parts.joysticks else {}
        self.joysticks = {
            n: Joystick(self.network, i, folder, JOYSTICK) for n, i in numbers.items()
        }
        valves = {n: i for n, i in VALVES.items() if parts.drive is None or n != "slew"}
        self.valves = {n: Valve(self.network, i, folder, parts.valves) for n, i in valves.items()}
        self.drive: Drive | None = None
        self.inclinometer: Unit | None = None
        if parts.drive is not None:
            self.drive = Drive(self.network, parts.drive, folder, DRIVE)
        if parts.inclinometer is not None:
            self.inclinometer = Unit(self.network, parts.inclinometer, folder, INCLINOMETER)
        self._quick = [u for u in (*self.joysticks.values(), self.inclinometer) if u]
        self._slow = [u for u in (*self.valves.values(), self.drive) if u]
        self.units = [*self._quick, *self._slow]
        for unit in self.units:
            unit.boot()
        self._ended = threading.Event()

    def run(self) -> None:
        passed = 0.0
        while not self._ended.wait(JOYSTICK_CYCLE_S):
            for unit in self._quick:
                unit.send()
            passed += JOYSTICK_CYCLE_S
            if passed >= STATUS_CYCLE_S:
                passed = 0.0
                for unit in self._slow:
                    unit.send()
                for unit in self.units:
                    if not unit.dead:
                        nmt = unit.node.nmt
                        self.network.send_message(0x700 + nmt.id, [STATES[nmt.state]])

    def end(self) -> None:
        self._ended.set()
        self.join()
        self.network.disconnect()


@contextmanager
def machine_on(folder: Path, parts: Parts | None = None, **bus: object) -> Iterator[Machine]:
    machine = Machine(folder, parts, **bus)
    machine.start()
    try:
        yield machine
    finally:
        machine.end()
