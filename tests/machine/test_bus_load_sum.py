"""Load of a bus with several messages of CAN FD: the sum of theirs, each at both rates."""

import pytest
from cantools.database.can import Message

from canshaper.machine.buses import BusLoad, bus_load


def fd_message(frame_id: int, length: int, cycle_ms: int | None) -> Message:
    return Message(frame_id, f"M{frame_id}", length, [], cycle_time=cycle_ms, is_fd=True)


# Bits at the rate of the bus, and of the data: 34 and 113 of 8 bytes, 34 and 238 of 20 bytes.
@pytest.mark.parametrize(
    ("data_bitrate", "share"),
    [
        (None, 50 * (34 + 113) / 250_000 + 10 * (34 + 238) / 250_000),
        (1_000_000, 50 * (34 / 250_000 + 113 / 1e6) + 10 * (34 / 250_000 + 238 / 1e6)),
    ],
)
def test_loads_of_several_messages_of_can_fd_add_up(data_bitrate: int | None, share: float) -> None:
    messages = [fd_message(1, 8, 20), fd_message(2, 20, 100), fd_message(3, 64, None)]
    load = bus_load(messages, 250_000, data_bitrate)
    assert load == BusLoad(pytest.approx(share), 2)
