"""The installed service between a hand and a crane, judged by what is on the bus."""

from itertools import pairwise
from pathlib import Path

from tests.hil.machine import DBC, FILE, candump, logged, message_name, open_bus, service, wait_for
from tests.systemd.unit import Unit

DWELL_S = 2.5  # after the release, as in the reports of the demo
# The same pulse without anti-sway leaves more than 10 degrees: tests/hil/test_closed_loop.py.
MOST_DEG = 1.5
# A machine that stands still for longer than the timeout of the joystick in the deployment: the
# axis stops, as it must, and there is nothing to judge. The daemon names it too.
HELD_UP_S = 0.1
HELD_UP = {"LOOP_OVERRUN", "LOOP_STALLED"}
DRIVES = 5


def drive(folder: Path) -> list[tuple[float, str, dict]]:
    """A pulse of the near-far axis: time, name and signals of everything on the bus."""
    log = folder / "drive.log"
    with candump(log, "vcan0"), service(folder / "sim.log", "sim", str(FILE)) as sim:
        with open_bus("vcan0") as bus:
            wait_for(bus, "GrappleSway", lambda _: True)
        script = ["--script", "pulse-near_far"]
        with service(folder / "hand.log", "operator", str(FILE), *script) as hand:
            assert hand.process.wait() == 0, hand.text()
        assert sim.process.poll() is None, sim.text()
    received = []
    for message in logged(log):
        name = message_name(message)
        assert name is not None
        received.append((message.timestamp, name, dict(DBC.decode_message(name, message.data))))
    return received


def test_after_a_pulse_the_grapple_hangs_still(forwarder: Unit, tmp_path: Path) -> None:
    for _ in range(DRIVES):
        received = drive(tmp_path)
        joysticks = [t for t, name, _ in received if name == "JoystickLeft"]
        longest_s = max(later - t for t, later in pairwise(joysticks))
        reported = [str(s["Reason"]) for _, name, s in received if name == "NearFarStatus"]
        if longest_s < HELD_UP_S and not HELD_UP & {*reported}:
            break
        print(f"once more: {longest_s:.2f} s between two frames of the hand; {sorted({*reported})}")
        forwarder.systemctl("restart")  # a stall is latched
    released = max(t for t, name, s in received if name == "JoystickLeft" and s["NearFar"] != 0.0)
    swings = [(t, max(map(abs, s.values()))) for t, name, s in received if name == "GrappleSway"]
    after = [swing for t, swing in swings if t > released + DWELL_S]
    fastest = max(s["RadialSpeed"] for _, name, s in received if name == "TipVelocity")
    assert fastest > 0.95, sorted({*reported})  # of 1 m/s
    assert max(swing for _, swing in swings) > 2 * MOST_DEG
    assert len(after) > 10
    assert max(after) < MOST_DEG
    assert forwarder.number("NRestarts") == 0
