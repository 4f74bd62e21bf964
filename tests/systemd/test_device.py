"""The device of a bus, seen from inside of the hardened unit: /sys and netlink."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.systemd.unit import Unit

PATH = f"pci-{Path('/sys/class/net/can0/device').resolve().name}"


@pytest.fixture
def own(forwarder: Unit) -> Iterator[Unit]:
    """An instance on can0; the shipped one stays as it is on vcan0."""
    unit = Unit("own")
    yield unit
    unit.systemctl("stop")
    unit.file.unlink()


def write(unit: Unit, shipped: Unit, match: str) -> None:
    text = shipped.file.read_text()
    changed = text.replace("channel: vcan0,", f"channel: can0, match: {match},")
    assert changed != text
    unit.file.write_text(changed)


def test_the_right_device_starts(own: Unit, forwarder: Unit) -> None:
    write(own, forwarder, f'{{ path: "{PATH}", driver: kvaser_pci, bitrate: 250000 }}')
    own.systemctl("start")
    own.wait(ActiveState="active")


def test_the_wrong_one_is_waited_for_until_the_file_is_read_again(
    own: Unit, forwarder: Unit
) -> None:
    write(own, forwarder, "{ path: pci-0000:77:00.0 }")
    cursor = own.cursor()
    own.systemctl("start")
    why = f"buses.crane.match: expected path pci-0000:77:00.0, but can0 has path {PATH};"
    own.wait(StatusText=f"waiting: .*{why}.*")
    assert own.priority(f"{why} the device of the file is not here", cursor) == {"3"}
    write(own, forwarder, f'{{ path: "{PATH}" }}')
    own.systemctl("reload")
    own.wait(ActiveState="active", StatusText=".*crane up.*")
