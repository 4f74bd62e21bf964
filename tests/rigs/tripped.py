"""The shipped machine, tripped."""

from canshaper.codec.frame import Frame
from canshaper.shaping.states import State
from tests.rigs.emergency import Machine
from tests.rigs.forwarder import Rig


def tripped(machine: Rig | Machine, **switches: int) -> Rig:
    """Latched by a frame that was not sent, with the joystick back in neutral."""
    rig = machine.rig if isinstance(machine, Machine) else machine
    machine.run(3, **switches)
    machine.run(10, Slew=1000, **switches)
    rig.controller.send_failed(Frame("crane", 0x200, False, bytes(2)))
    machine.run(1, Slew=1000, **switches)
    machine.run(5, **switches)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SEND_FAILED")
    return rig
