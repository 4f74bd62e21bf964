"""What an error frame says of a bus: classes in its id, controller state in its second byte.

Source: linux/can/error.h.
"""

from canshaper.codec.frame import BusState, FrameFault

CLASS_CONTROLLER, CLASS_BUS_OFF, CLASS_RESTARTED = 0x4, 0x40, 0x100
OVERFLOW, WARNING, PASSIVE, ACTIVE = 0x01, 0x0C, 0x30, 0x40


def read_error(word: int, payload: bytes) -> tuple[FrameFault, BusState | None]:
    """The fault to count, and the state in which the bus is; None where it says nothing of that.

    Args:
        word: id of the frame, with its flags.
        payload: its 8 bytes.
    """
    controller = payload[1] if word & CLASS_CONTROLLER else 0
    if word & CLASS_BUS_OFF:
        return FrameFault.BUS_OFF, BusState.BUS_OFF
    if controller & PASSIVE:
        return FrameFault.BUS_PASSIVE, BusState.PASSIVE
    if word & CLASS_RESTARTED or controller & (ACTIVE | WARNING):  # less than passive
        return FrameFault.ERROR_FRAME, BusState.UP
    return FrameFault.FRAMES_LOST if controller & OVERFLOW else FrameFault.ERROR_FRAME, None
