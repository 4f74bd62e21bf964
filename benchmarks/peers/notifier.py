"""A gateway as most would write it first: python-can's Notifier, cantools, one message to another.

notifier.py CHANNEL DBC
"""

import signal
import sys

import can
import cantools

database = cantools.database.load_file(sys.argv[2])
joystick = database.get_message_by_name("JoystickLeft")
valve = database.get_message_by_name("SlewCommand")


class Gateway(can.Listener):
    """Joystick to valve."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.count = 0

    def on_message_received(self, msg: can.Message) -> None:
        if msg.arbitration_id != joystick.frame_id:
            return
        values = joystick.decode(msg.data)
        velocity = 0.9 * values["Slew"] if values["Enable"] == "On" else 0.0
        self.count = (self.count + 1) % 256
        data = valve.encode({"Velocity": velocity, "AliveCounter": self.count})
        self.bus.send(can.Message(arbitration_id=valve.frame_id, is_extended_id=False, data=data))


bus = can.Bus(interface="socketcan", channel=sys.argv[1])
notifier = can.Notifier(bus, [Gateway(bus)])
print("ready", flush=True)
signal.pause()
