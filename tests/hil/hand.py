"""A hand on protected joysticks, and the deployment reading them; plain cantools and crccheck."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import can
import cantools
from crccheck.crc import Crc8SaeJ1850

from tests.hil.machine import FILE, open_bus

LEFT, RIGHT, STOP = 0x110, 0x111, 0x112
CYCLE_S = 0.02
# What the example lacks: a checksum, direction flags, an emergency stop.
DBC_CHANGES = (
    (
        ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273',
        ' SG_ Checksum : 48|8@1+ (1,0) [0|255] "" SHAPER\n'
        ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n\n'
        "BO_ 274 EmergencyStop: 2 JOYSTICKS\n"
        ' SG_ Stop : 0|2@1+ (1,0) [0|1] "" SHAPER\n'
        ' SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273',
    ),
    (
        ' SG_ Lift : 0|16@1- (0.1,0) [-100|100] "%" SHAPER\n',
        ' SG_ Lift : 0|16@1+ (0.1,0) [0|100] "%" SHAPER\n'
        ' SG_ LiftNeutral : 40|2@1+ (1,0) [0|3] "" SHAPER\n'
        ' SG_ LiftDown : 42|2@1+ (1,0) [0|3] "" SHAPER\n'
        ' SG_ LiftUp : 44|2@1+ (1,0) [0|3] "" SHAPER\n',
    ),
    (
        'BA_ "GenMsgCycleTime" BO_ 273 20;',
        'BA_ "GenMsgCycleTime" BO_ 273 20;\nBA_ "GenMsgCycleTime" BO_ 274 20;',
    ),
)
FILE_CHANGES = (
    (
        "    alive_counter: AliveCounter\n  right:",
        "    alive_counter: AliveCounter\n"
        "    checksum: { signal: Checksum, kind: crc8_sae_j1850 }\n"
        "    stuck_s: 2\n  right:",
    ),
    ("signal: Lift,", "signal: Lift, flags: { neutral: LiftNeutral, negative: LiftDown, "
     "positive: LiftUp },"),
    (
        "axes:\n",
        "emergency_stop:\n  bus: crane\n  message: EmergencyStop\n  signal: Stop\n"
        "  timeout_ms: 100\n  alive_counter: AliveCounter\n\naxes:\n",
    ),
)  # fmt: skip

Spoil = Callable[[int, bytes], list[bytes]]


def write_deployment(folder: Path) -> Path:
    """The protected deployment with its DBC file."""
    dbc, file = folder / "protected.dbc", folder / "protected.yaml"
    dbc.write_text(_changed((FILE.parents[1] / "dbc" / "forwarder.dbc").read_text(), DBC_CHANGES))
    text = _changed(FILE.read_text(), FILE_CHANGES)
    file.write_text(text.replace("../dbc/forwarder.dbc", "protected.dbc"))
    return file


def _changed(text: str, changes: tuple[tuple[str, str], ...]) -> str:
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def with_checksum(data: bytes) -> bytes:
    """A frame of the left joystick with its checksum."""
    rest = data[:6] + data[7:]
    return data[:6] + bytes([Crc8SaeJ1850.calc(rest)]) + data[7:]


class Hand(threading.Thread):
    """Both joysticks and the emergency stop, sent every 20 ms.

    ``spoil`` is asked for what really goes out of every frame: (id, data) to a list of data.
    """

    def __init__(self, bus: can.BusABC, dbc: Path) -> None:
        super().__init__(daemon=True)
        self._bus = bus
        self._dbc = cantools.database.load_file(dbc)
        self._end = threading.Event()
        self._count = 0
        self._rounds = threading.Semaphore(0)
        self.rest()

    def rest(self) -> None:
        """Joysticks in neutral, enabled, nothing spoilt."""
        self.slew = self.lift = 0.0
        self.enable, self.reset, self.stop = 1, 0, 0
        self.frozen = False
        self.spoil: Spoil = lambda _can_id, data: [data]

    def run(self) -> None:
        while not self._end.wait(CYCLE_S):
            self._count = (self._count + 1) % 256
            for can_id, data in self._frames():
                for sent in self.spoil(can_id, data):
                    with suppress(can.CanError):  # the interface may be down
                        self._bus.send(
                            can.Message(arbitration_id=can_id, is_extended_id=False, data=sent)
                        )
            self._rounds.release()

    def wait_sent(self, rounds: int) -> None:
        """Wait until everything has been sent so many times from now on."""
        while self._rounds.acquire(blocking=False):
            pass
        for _ in range(rounds):
            self._rounds.acquire()

    def _frames(self) -> list[tuple[int, bytes]]:
        switches = {"Enable": self.enable, "AntiSwayOff": 0, "Reset": self.reset}
        switches["AliveCounter"] = self._count
        flags = {
            "LiftNeutral": int(self.lift == 0),
            "LiftDown": int(self.lift < 0),
            "LiftUp": int(self.lift > 0),
        }
        # A hand is never quite still.
        trembles = self.slew and not self.frozen
        slew = self.slew - math.copysign(0.1 * (self._count % 2), self.slew) * bool(trembles)
        left = self.encode("JoystickLeft", Slew=slew, NearFar=0, Checksum=0, **switches)
        right = self.encode("JoystickRight", Lift=abs(self.lift), Rotate=0, **flags, **switches)
        stop = self.encode("EmergencyStop", Stop=self.stop, AliveCounter=self._count)
        return [(LEFT, with_checksum(left)), (RIGHT, right), (STOP, stop)]

    def encode(self, message: str, **signals: float) -> bytes:
        return bytes(self._dbc.encode_message(message, signals))

    def close(self) -> None:
        self._end.set()
        self.join()


@contextmanager
def hand_on(channel: str, dbc: Path) -> Iterator[Hand]:
    with open_bus(channel) as bus:
        hand = Hand(bus, dbc)
        hand.start()
        try:
            yield hand
        finally:
            hand.close()
