"""Identifiers of 11 bits that belong to a service of CANopen: the predefined set of CiA 301."""

import pytest

from canshaper.codec.frame import service_of


@pytest.mark.parametrize(
    ("can_id", "service"),
    [
        (0x000, "NMT"),
        (0x001, None),
        (0x07F, None),
        (0x080, "SYNC"),
        (0x081, "EMCY"),
        (0x0FF, "EMCY"),
        (0x100, "TIME"),
        (0x101, None),
        (0x181, None),  # the first PDO
        (0x57F, None),
        (0x581, "SDO"),
        (0x5FF, "SDO"),
        (0x601, "SDO"),
        (0x67F, "SDO"),
        (0x680, None),
        (0x701, "heartbeat"),
        (0x77F, "heartbeat"),
        (0x780, None),
        (0x7E4, "LSS"),
        (0x7E5, "LSS"),
        (0x7E6, None),
    ],
)
def test_services(can_id: int, service: str | None) -> None:
    assert service_of(can_id) == service
