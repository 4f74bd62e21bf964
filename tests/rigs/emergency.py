"""A machine with an emergency stop on its bus."""

from typing import Any

from canshaper.codec.frame import Frame
from canshaper.shaping.states import State
from tests.rigs.forwarder import Make

VALVES = ("SlewCommand", "NearFarCommand", "LiftCommand")
AXES = ("slew", "near_far", "lift")
STOP_ID = 0x40
# timeout_ms, 60 ms: the last frame counts in so many ticks after its own.
FRESH_TICKS = 3
LAST = "status: { bus: crane, message: ShaperStatus }"
STOP = (
    "emergency_stop: { bus: crane, message: Stop, signal: Pressed, timeout_ms: 60,"
    " alive_counter: Count }\n"
)

CYCLE = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
DBC = {
    "BO_ 512 SlewCommand": (
        "BO_ 64 Stop: 3 JOYSTICKS\n"
        ' SG_ Pressed : 0|2@1+ (1,0) [0|3] "" SHAPER\n'
        ' SG_ Count : 8|8@1+ (1,0) [0|255] "" SHAPER\n'
        ' SG_ Check : 16|8@1+ (1,0) [0|255] "" SHAPER\n'
        "\nBO_ 512 SlewCommand"
    ),
    CYCLE: CYCLE + CYCLE.replace("272", "64"),
}


class Machine:
    """A rig with an emergency stop that sends every tick."""

    def __init__(self, make: Make, stop: str = STOP, **more: dict[str, str]) -> None:
        yaml = {LAST: stop + LAST, **more.get("yaml", {})}
        self.rig = make(yaml, {**DBC, **more.get("dbc", {})})
        self._count = 0

    def stop(self, pressed: int, *, step: int = 1, error: int = 0) -> Frame:
        """The next frame of the stop, with the sum of its bytes."""
        self._count = (self._count + step) % 256
        check = (pressed + self._count + error) % 256
        return Frame("crane", STOP_ID, False, bytes([pressed, self._count, check]))

    def run(self, ticks: int = 1, pressed: int = 0, **raw: int) -> dict[str, dict[str, Any]]:
        sent: dict[str, dict[str, Any]] = {}
        for _ in range(ticks):
            self.rig.receive(self.stop(pressed))
            sent = self.rig.run(1, **raw)
        return sent

    def moving(self, **raw: int) -> "Machine":
        """Slew in full motion, lift too; the near-far axis is ready."""
        self.run(3, **raw)
        sent = self.run(50, Slew=1000, Lift=1000, **raw)
        assert sent["SlewCommand"]["Velocity"] > 50
        assert sent["LiftCommand"]["Velocity"] > 50
        return self

    def states(self) -> list[tuple[State, str]]:
        return [(self.rig.state(axis), self.rig.reason(axis)) for axis in AXES]


def still(sent: dict[str, dict[str, Any]]) -> bool:
    return all(sent[v]["Velocity"] == 0 for v in VALVES)


PRESSED = [(State.TRIPPED, "EMERGENCY_STOP")] * 3
READY = [(State.READY, "JOYSTICK_NEUTRAL")] * 3
