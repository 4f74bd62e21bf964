"""The recorded drive: an operator on the simulated crane, with what happens on a machine.

The enable switch is released in motion, the joysticks fall silent for longer than their timeout,
the anti-sway switch is used, a joystick reports an error, and a node sends what no one knows.
"""

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper_sim.axes import LIFT, NEAR_FAR, SLEW
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script, Stroke
from tests.golden.replay import CONFIG, TICK_NS, line, ticks

LEFT, RIGHT, TIP = 0x110, 0x111, 0x401
# How long before the tick a frame comes.
BEFORE_NS = {LEFT: 13_000_000, RIGHT: 8_000_000, TIP: 4_000_000}

SCRIPT = Script(
    "golden",
    (
        Stroke(SLEW, 0.5, 3.0, 0.83),
        Stroke(NEAR_FAR, 1.1, 2.6, 0.71),
        Stroke(LIFT, 2.0, 1.5, 0.67),
        Stroke(SLEW, 5.6, 3.6, -0.77),
        Stroke(NEAR_FAR, 6.2, 1.3, -0.9),
        Stroke(LIFT, 10.0, 2.0, -0.58),
        Stroke(SLEW, 10.9, 2.2, 0.63),
        Stroke(NEAR_FAR, 11.6, 1.2, 0.53),
        Stroke(SLEW, 13.1, 1.6, -0.41),
        Stroke(LIFT, 15.0, 0.8, 0.93),
        Stroke(NEAR_FAR, 15.2, 1.0, 1.0),
    ),
    18.0,
)


def record() -> list[str]:
    """The frames of the joysticks and of the tip, as they came."""
    deployment = load_deployment(CONFIG / "forwarder-robust.yaml")
    controller = Controller(deployment)
    joysticks, plant = JoystickNode(deployment, SCRIPT), PlantNode(deployment)
    rows: list[str] = []
    feedback: list[Frame] = []
    for now_ns, missed in ticks():
        for late in range(missed, -1, -1):
            due_ns = now_ns - late * TICK_NS
            time_s = due_ns / 1e9
            frames = [_changed(frame, time_s) for frame in joysticks.frames(due_ns // 1_000_000)]
            tip = [frame for frame in feedback if frame.can_id == TIP]
            for frame in (*(f for f in frames if f), *tip, *_strange(time_s)):
                at_ns = due_ns - BEFORE_NS.get(frame.can_id, 0)
                rows.append(line(at_ns, frame))
                controller.receive(frame, at_ns)
            if not late:
                for frame in controller.tick(now_ns, missed):
                    plant.receive(frame)
            plant.advance(TICK_NS / 1e9)
            feedback = plant.feedback()
    return rows


def _changed(frame: Frame, time_s: float) -> Frame | None:
    """A joystick's frame as it really comes; None where it is lost."""
    data = bytearray(frame.data)
    if frame.can_id == LEFT:
        if 8.0 <= time_s < 8.4:
            return None
        if 3.0 <= time_s < 3.2:
            data[4] &= ~0x03  # Enable
        if 5.0 <= time_s < 5.2:
            data[4] |= 0x10  # Reset
        if 13.4 <= time_s < 14.2:
            data[4] |= 0x04  # AntiSwayOff
    if frame.can_id == RIGHT and 11.0 <= time_s < 11.1:
        data[0:2] = (32766).to_bytes(2, "little")  # the joystick's code for an error
    return frame._replace(data=bytes(data))


def _strange(time_s: float) -> list[Frame]:
    return [Frame("crane", 0x1ABCDEF0, True, b"\x01\x02")] if 12.0 <= time_s < 12.1 else []
