"""A cab with several enable switches."""

from collections.abc import Callable

from canshaper.checksums.algorithms import SAE_J1850
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.shaping.states import Reason, State
from canshaper_sim.hand import Hand, Held
from tests.rigs.files import Machine

SEAT_DBC = """BO_ 288 Seat: 2 JOYSTICKS
 SG_ Seated : 0|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Door : 2|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Count : 4|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Check : 8|8@1+ (1,0) [0|255] "" SHAPER

BO_ 289 Ecu: 1 JOYSTICKS
 SG_ Mode : 0|8@1+ (1,0) [0|255] "" SHAPER

"""
SEAT_KEYS = (
    "alive_counter: Count, checksum: { signal: Check, kind: crc8_sae_j1850 }, timeout_ms: 200"
)
SWITCHES = f"""switches:
  seat: {{ bus: crane, message: Seat, signal: Seated, {SEAT_KEYS} }}
  door: {{ bus: crane, message: Seat, signal: Door, {SEAT_KEYS} }}
  mode: {{ bus: crane, message: Ecu, signal: Mode, code: 3, timeout_ms: 300 }}

axes:
"""
LEFT = "enable: Enable"
TICK_MS = 20


class Cab:
    """The controller behind its gate, and an operator who has switches of every kind."""

    def __init__(self, machine: Machine) -> None:
        self.deployment = machine.load()
        self.controller = Controller(self.deployment)
        self.gated = GatedController(self.controller)
        self.hand = Hand(self.deployment)
        self.time_ms = 0
        self.sent: dict[int, bytes] = {}
        self.change: Callable[[Frame], Frame | None] = lambda frame: frame
        self.events: list[str] = []

    def drive(self, time_ms: int, slew: float = 0.0, *, enable: bool = True) -> None:
        for _ in range(time_ms // TICK_MS):
            self.time_ms += TICK_MS
            for frame in self.hand.frames(self.time_ms, Held({"slew": slew}, enable=enable)):
                if changed := self.change(frame):
                    self.gated.receive(changed, self.time_ms * 1_000_000)
            for frame in self.gated.tick(self.time_ms * 1_000_000):
                self.sent[frame.can_id] = frame.data
            events = self.controller.events
            self.events += [e.text for e in events]
            assert not any("output=refused" in text for text in self.events), self.events
            events.clear()

    @property
    def slew(self) -> tuple[State, Reason]:
        axis = self.controller.axes["slew"].axis
        return axis.state, axis.reason

    @property
    def moves(self) -> bool:
        return self.sent[512][0] != 0


def without(can_id: int) -> Callable[[Frame], Frame | None]:
    return lambda frame: None if frame.can_id == can_id else frame


def seat(seated: int, door: int, *, right_sum: bool = True) -> Callable[[Frame], Frame]:
    """The message of seat and door with other switches."""

    def change(frame: Frame) -> Frame:
        if frame.can_id != 288:
            return frame
        first = bytes((frame.data[0] & 0xF0 | door << 2 | seated,))
        return frame._replace(data=first + bytes((SAE_J1850.of(first) ^ (not right_sum),)))

    return change


def right_enable(code: int) -> Callable[[Frame], Frame]:
    return enable_of(273, code)


def enable_of(joystick: int, code: int) -> Callable[[Frame], Frame]:
    def change(frame: Frame) -> Frame:
        if frame.can_id != joystick:
            return frame
        return frame._replace(
            data=frame.data[:4] + bytes((frame.data[4] & ~3 | code,)) + frame.data[5:]
        )

    return change
