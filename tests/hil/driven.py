"""The daemon of the forwarder on vcan0, ready and in motion."""

import time

import can

from tests.hil.machine import Accept, Joysticks, wait_for, wait_for_one

SLEW = 0x200


def drive(bus: can.BusABC, joysticks: Joysticks) -> None:
    """Full motion; once more where an emulated machine that stood still has tripped the axis."""
    for _ in range(5):
        ready(bus, joysticks)
        joysticks.values["Slew"] = 100.0
        expected: dict[str, Accept] = {
            "SlewCommand": lambda v: v["Velocity"] > 90.0,
            "SlewStatus": lambda s: str(s["Reason"]) == "LOOP_STALLED",
        }
        if wait_for_one(bus, expected)[0] == "SlewCommand":
            return
    raise AssertionError("the machine stands still too often")


def ready(bus: can.BusABC, joysticks: Joysticks) -> None:
    """Neutral, and presses of reset until one counts."""
    joysticks.values["Slew"] = 0.0
    joysticks.silent = False
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        joysticks.switches["Reset"] ^= 1
        while bus.recv(0):  # what was sent while no one read says nothing of now
            pass
        for _ in range(3):
            status = wait_for(bus, "SlewStatus", lambda s: True)
        if str(status["State"]) == "READY" and status["RawCommand"] == 0:
            joysticks.switches["Reset"] = 0
            return
    raise AssertionError(f"not ready: {status}")
