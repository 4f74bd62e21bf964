"""Nodes of another maker: joysticks of CiA 401 and valves of CiA 408 on the library ``canopen``.

Object dictionary, states, emergency codes and PDOs of the valve are those of the public description
of a PVED-CC Series 5; its state machine is that of the VDMA profile.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import canopen
from canopen.nmt import NMT_STATES

JOYSTICKS = {"left": 0x10, "right": 0x11}
VALVES = {"slew": 0x20, "near_far": 0x21, "lift": 0x22}
INIT, DISABLED, HOLD, ACTIVE, FAULT_HOLD = 0x8, 0x9, 0xB, 0xF, 0x3
UP = {INIT: DISABLED, DISABLED: HOLD, HOLD: ACTIVE}
FLOW_COMMAND_LATE = 0x8003
U8, I16, U16, U32 = 0x05, 0x03, 0x06, 0x07
JOYSTICK_CYCLE_S, STATUS_CYCLE_S = 0.02, 0.1
STATES = {name: number for number, name in NMT_STATES.items()}


def write_eds(
    path: Path, pdos: dict[str, tuple[int, list[tuple[int, int, int]]]], objects: dict
) -> str:
    """A description with these PDOs (COB-ID, mapped objects) and objects (name, type)."""
    sections = {
        "DeviceInfo": {"NrOfRXPDO": 1, "NrOfTXPDO": 2},
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
    for (index, sub), (name, kind) in objects.items():
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


class Joystick:
    """CiA 401: two analogue inputs and a byte of switches in one PDO, sent by its event timer."""

    def __init__(self, network: canopen.Network, number: int, eds: str) -> None:
        self.node = network.create_node(canopen.LocalNode(number, eds))
        self.node.tpdo.read(from_od=True)
        self._pdo = self.node.tpdo[1]
        self.x = self.y = 0
        self.switches = 1
        self.dead = False

    def cycle(self) -> None:
        if self.node.nmt.state == "OPERATIONAL":
            for variable, value in zip(self._pdo, (self.x, self.y, self.switches), strict=False):
                variable.raw = value
            self._pdo.transmit()


class Valve:
    """CiA 408: follows its set point in the state ACTIVE, which it is told to step by step."""

    def __init__(self, network: canopen.Network, number: int, eds: str) -> None:
        self.node = network.create_node(canopen.LocalNode(number, eds))
        self.node.tpdo.read(from_od=True)
        self.node.rpdo.read(from_od=True)
        self.node.rpdo[1].add_callback(self._told)
        self.silent = self.stuck = self.dead = False
        self.boot()

    def boot(self) -> None:
        """Power on, or a reset of the node."""
        self.state, self.spool, self._word = INIT, 0, 0
        self.words: list[int] = []
        self.node.nmt.state = "INITIALISING"  # which sends the boot-up message
        self.node.nmt.state = "PRE-OPERATIONAL"

    def fault(self, code: int) -> None:
        """The spool goes to neutral, the ready bit away, and it is told."""
        self.state, self.spool = FAULT_HOLD, 0
        self.node.emcy.send(code, 0x81)
        self.report()

    def _told(self, pdo: canopen.pdo.base.PdoMap) -> None:
        if self.node.nmt.state != "OPERATIONAL":
            return
        word, set_point = (variable.raw for variable in pdo)
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
        self.spool = set_point if self.state == ACTIVE else 0
        if self.state != before:
            self.report()

    def report(self) -> None:
        """Status word and spool, as its event timer and every change have it."""
        if self.node.nmt.state == "OPERATIONAL" and not self.silent:
            for number, value in ((1, self.state), (2, self.spool)):
                self.node.tpdo[number][0].raw = value
                self.node.tpdo[number].transmit()


class Machine(threading.Thread):
    """Two joysticks and three valves on one bus, at their cycles."""

    def __init__(self, folder: Path, **bus: object) -> None:
        super().__init__(daemon=True)
        self.network = canopen.Network()
        self.network.connect(**bus)
        eds = write_eds(
            folder / "joystick.eds",
            {"t1": (0x180, [(0x6401, 1, 16), (0x6401, 2, 16), (0x6000, 1, 8)])},
            {(0x6401, 2): ("Read analogue input", I16), (0x6000, 1): ("Read input", U8)},
        )
        valve = write_eds(
            folder / "valve.eds",
            {
                "r1": (0x200, [(0x6040, 0, 16), (0x6300, 1, 16)]),
                "t1": (0x180, [(0x6041, 0, 16)]),
                "t2": (0x280, [(0x6301, 1, 16)]),
            },
            {
                (0x6040, 0): ("Device control word", U16),
                (0x6041, 0): ("Device status word", U16),
                (0x6042, 0): ("Device mode", U8),
                (0x6300, 1): ("Vpoc set point", I16),
                (0x6301, 1): ("Vpoc actual value", I16),
            },
        )
        self.joysticks = {n: Joystick(self.network, i, eds) for n, i in JOYSTICKS.items()}
        for joystick in self.joysticks.values():
            joystick.node.nmt.state = "INITIALISING"
            joystick.node.nmt.state = "PRE-OPERATIONAL"
        self.valves = {n: Valve(self.network, i, valve) for n, i in VALVES.items()}
        self._ended = threading.Event()

    def run(self) -> None:
        passed = 0.0
        while not self._ended.wait(JOYSTICK_CYCLE_S):
            for joystick in self.joysticks.values():
                joystick.cycle()
            passed += JOYSTICK_CYCLE_S
            if passed >= STATUS_CYCLE_S:
                passed = 0.0
                for valve in self.valves.values():
                    valve.report()
                for unit in (*self.joysticks.values(), *self.valves.values()):
                    if not unit.dead:
                        nmt = unit.node.nmt
                        self.network.send_message(0x700 + nmt.id, [STATES[nmt.state]])

    def end(self) -> None:
        self._ended.set()
        self.join()
        self.network.disconnect()


@contextmanager
def machine_on(folder: Path, **bus: object) -> Iterator[Machine]:
    machine = Machine(folder, **bus)
    machine.start()
    try:
        yield machine
    finally:
        machine.end()
