"""The controller without buses: a scripted operator presses and lets go, the axis follows shaped.

python examples/controller_without_io.py
"""

from canshaper import Controller, load_machine
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import script_named

machine = load_machine("forwarder.yaml")
controller = Controller(machine)
operator = JoystickNode(machine, script_named("pulse-slew"))

for time_ms in range(0, 9000, machine.config.tick_ms):
    now_ns = time_ms * 1_000_000
    for frame in operator.frames(time_ms):
        controller.receive(frame, now_ns)
    frames = controller.tick(now_ns)  # what a program with a bus sends now
    for event in controller.events():
        if event.text.startswith("axis=slew"):
            print(f"{time_ms / 1000:5.2f} s {event.text}")
    if time_ms % 1000 == 0:
        output = controller.axes()["slew"].output
        print(f"{time_ms / 1000:5.2f} s {len(frames)} frames, slew at {output:+.0%}")
