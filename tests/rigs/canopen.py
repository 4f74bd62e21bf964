"""The shipped CANopen machine under test: its nodes by plain cantools, ids as CiA 301 has them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cantools

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from tests.rigs.files import ROOT, machine_file, read

FILE, DBC_FILE = "canopen-forwarder.yaml", "canopen-cia401-cia408.dbc"
TICK_NS = 20_000_000
JOYSTICKS = {"left": 0x10, "right": 0x11}
VALVES = {"slew": 0x20, "near_far": 0x21, "lift": 0x22}
NODES = {**JOYSTICKS, **VALVES}
OURS = 0x7E
BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
INIT, DISABLED, HOLD, ACTIVE, RESET = 0x8, 0x9, 0xB, 0xF, 0x3
UP = {INIT: DISABLED, DISABLED: HOLD, HOLD: ACTIVE}


def write_variant(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    """The shipped deployment with pieces replaced."""
    return machine_file(tmp_path, FILE, *changes)


class ValveNode:
    """State machine of a valve: one step up when commanded the next state, down at once.

    ``faulty`` clears the ready bit until an edge from 0x3 to 0xB; ``stuck`` keeps it cleared.
    """

    def __init__(self) -> None:
        self.state = INIT
        self.word = 0
        self.stuck = False
        self.silent = False

    def fault(self, *, stuck: bool = False) -> None:
        self.state, self.stuck = RESET, stuck

    def command(self, word: int) -> None:
        if self.state == RESET:
            if not self.stuck and (self.word, word) == (RESET, HOLD):
                self.state = HOLD
        elif UP.get(self.state) == word or (word in (INIT, *UP) and word < self.state):
            self.state = word
        elif word == RESET and self.state > HOLD:
            self.state = HOLD
        self.word = word


class CanopenRig:
    """A controller with its clock, two joysticks and three valves."""

    def __init__(self, path: Path = ROOT / "config" / FILE) -> None:
        self.deployment = read(path)
        self.controller = Controller(self.deployment)
        self.dbc: Any = cantools.database.load_file(ROOT / "dbc" / DBC_FILE)
        self.bus = "crane"
        self.now_ns = 0
        self.valves = {axis: ValveNode() for axis in VALVES}
        self.states = dict.fromkeys(NODES, OPERATIONAL)
        self.sent: list[Frame] = []
        self.texts: list[str] = []

    def receive(self, can_id: int, data: bytes) -> None:
        self.controller.receive(Frame(self.bus, can_id, False, data), self.now_ns)

    def heartbeat(self, node: str, state: int) -> None:
        self.receive(0x700 + NODES[node], bytes((state,)))

    def emergency(self, node: str, code: int, register: int = 0x81) -> None:
        self.receive(0x80 + NODES[node], code.to_bytes(2, "little") + bytes((register, *5 * (0,))))

    def status(self, axis: str, state: int) -> None:
        self.receive(0x180 + VALVES[axis], state.to_bytes(2, "little"))

    def tick(self) -> dict[str, dict[str, int]]:
        """One tick; raw signals of what the valves were sent, by axis."""
        self.sent = list(self.controller.tick(self.now_ns))
        self.now_ns += TICK_NS
        self.texts += [event.text for event in self.controller.events]
        self.controller.events.clear()
        return {axis: self.command(axis) for axis in VALVES}

    def command(self, axis: str) -> dict[str, int]:
        (data,) = (f.data for f in self.sent if f.can_id == 0x200 + VALVES[axis])
        found: dict[str, int] = self.dbc.decode_message(
            0x200 + VALVES[axis], data, decode_choices=False, scaling=False
        )
        return found

    def run(self, ticks: int = 1, **raw: int) -> dict[str, dict[str, int]]:
        """Ticks in which every node sends what it has to; joysticks and switches raw."""
        received: dict[str, dict[str, int]] = {}
        for _ in range(ticks):
            for name in ("Left", "Right"):
                message = self.dbc.get_message_by_name(f"Joystick{name}")
                values = dict.fromkeys((s.name for s in message.signals), 0) | {"Enable": 1}
                mine = {k: v for k, v in raw.items() if k in values}
                data = message.encode({**values, **mine}, scaling=False, strict=False)
                if self.states[name.lower()] == OPERATIONAL:
                    self.receive(message.frame_id, data)
            for node, state in self.states.items():
                if state >= 0:  # -1: it is silent
                    self.heartbeat(node, state)
            for axis, valve in self.valves.items():
                if not valve.silent:
                    self.status(axis, valve.state)
            received = self.tick()
            for axis, command in received.items():
                self.valves[axis].command(command["ControlWord"])
        return received

    def until(self, accept: Callable[[], bool], ticks: int = 400, **raw: int) -> int:
        """Run until that is so; how many ticks it took."""
        for passed in range(ticks):
            if accept():
                return passed
            self.run(**raw)
        raise AssertionError(f"not within {ticks} ticks: {self.axis()}")

    def ready(self) -> "CanopenRig":
        self.until(lambda: all(self.axis(a)[0] == "READY" for a in VALVES))
        return self

    def moving(self) -> "CanopenRig":
        """Slew and lift at work."""
        self.ready()
        received = self.run(25, Slew=30000, Lift=20000)
        assert received["slew"]["SetPoint"] > 3000
        assert received["lift"]["SetPoint"] > 3000
        return self

    def axis(self, name: str = "slew") -> tuple[str, str]:
        axis = self.controller.axes[name].axis
        return axis.state.name, axis.reason.name

    @property
    def commands(self) -> list[bytes]:
        """NMT commands of the last tick."""
        return [f.data for f in self.sent if f.can_id == 0]

    @property
    def last_fault(self) -> str:
        return self.controller.counters.last_fault.name
