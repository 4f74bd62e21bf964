"""A simulated crane on a bus: full slew for a second, then what the crane says of itself.

    python examples/plant_on_bus.py                      (python-can's virtual bus, of one process)
    python examples/plant_on_bus.py socketcan vcan0

There another process could be the sender, such as ``canshaper run forwarder.yaml``.
"""

import sys

import can
import cantools

from canshaper import Frame, load_machine
from canshaper.shipped import data_directory
from canshaper_sim.plant import PlantNode

interface, channel = sys.argv[1:] or ("virtual", "crane")
machine = load_machine("forwarder.yaml")
database = cantools.database.load_file(data_directory() / "dbc" / "forwarder.dbc")
plant = PlantNode(machine)
valve = machine.axes["slew"].valve_message

with can.Bus(channel, interface=interface) as bus, can.Bus(channel, interface=interface) as other:
    for step in range(100):  # of 10 ms
        fields = {"Velocity": 100.0, "AliveCounter": step % 256}
        data = valve.encode(fields)
        other.send(can.Message(arbitration_id=valve.frame_id, is_extended_id=False, data=data))
        while (received := bus.recv(timeout=0)) is not None:
            key = ("crane", received.arbitration_id, received.is_extended_id)
            plant.receive(Frame(*key, bytes(received.data)))
        plant.advance(0.01)
    for frame in plant.feedback():
        bus.send(can.Message(arbitration_id=frame.can_id, is_extended_id=False, data=frame.data))
        print(hex(frame.can_id), database.decode_message(frame.can_id, frame.data))
