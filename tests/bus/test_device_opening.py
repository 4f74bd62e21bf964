"""Sockets and ports against the device of their bus: bound, opened, or refused."""

import errno
from collections.abc import Callable
from typing import Any

import pytest

from canshaper.bus import device as module
from canshaper.bus.device import check_device
from canshaper.bus.port import open_port
from canshaper.bus.socketcan import open_sockets
from canshaper.config.bus import Bus
from canshaper.errors import BusError, WrongBusError, WrongDeviceError
from canshaper.machine.routing import BusRoutes
from tests.bus.fake_devices import FakeDevices, bus
from tests.bus.raw_line import IDS


class Bound:
    """A socket, as far as it is asked where it is bound to; names as they are, one call each."""

    def __init__(self, *names: str) -> None:
        self._names = [*names]

    def getsockname(self) -> tuple[str]:
        return (self._names.pop(0) if len(self._names) > 1 else self._names[0],)


def check(config: Bus, *sockets: Any) -> None:
    check_device(sockets, config)


def test_bound_sockets_of_the_right_device(here: FakeDevices) -> None:
    check(bus("can0", serial="0A17", port=0), Bound("can0"), Bound("can0"))


def test_where_the_sockets_are_bound_counts_and_not_the_name_of_the_file(here: FakeDevices) -> None:
    """Bound to can0, which got another name meanwhile: the device is the one that was meant."""
    check(bus("can0", serial="0B99"), Bound("can2"))
    with pytest.raises(WrongDeviceError, match="expected serial number 0A17, but can2 has"):
        check(bus("can0", serial="0A17"), Bound("can2"))


@pytest.mark.parametrize(
    "sockets",
    [
        (("can0",), ("can1",), ("can0",)),
        (("can0",), ("can0",), ("can1",)),
        (("can0", "can1"), ("can0", "can1")),
        (("can0",), ("can0", "can1")),
    ],
)
def test_a_name_that_changes_hands_while_it_is_opened(
    here: FakeDevices, sockets: tuple[tuple[str, ...], ...]
) -> None:
    with pytest.raises(WrongDeviceError, match="the name can0 changed hands"):
        check(bus("can0", serial="0A17"), *(Bound(*names) for names in sockets))


def test_without_match_nothing_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "read_device", None)
    check(bus("can0", bitrate=250_000), None)


def test_an_interface_that_goes_while_it_is_opened_is_gone(here: FakeDevices) -> None:
    with pytest.raises(OSError, match="No such device"):
        check(bus("can9", serial="0A17"), Bound("can9"))


def test_a_kernel_that_does_not_answer_is_no_right_device(
    here: FakeDevices, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without AF_NETLINK in the unit: an error of its own, not "this kernel has no CAN"."""

    def refuse(_index: int) -> Any:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    read = module.read_device
    monkeypatch.setattr(module, "read_device", lambda name: read(name, here.root, refuse))
    with pytest.raises(WrongDeviceError, match="can0 cannot be looked at: Address family not"):
        check(bus("can0", serial="0A17"), Bound("can0"))


def opened_by(monkeypatch: pytest.MonkeyPatch, error: Exception) -> Callable[[Bus], BusError]:
    def refuse(*_arguments: Any) -> Any:
        raise error

    monkeypatch.setattr("canshaper.bus.port.open_sockets", refuse)

    def fail(config: Bus) -> BusError:
        with pytest.raises(BusError) as caught:
            open_port("crane", config, lambda _fault: None)
        return caught.value

    return fail


def test_a_wrong_device_is_no_port(here: FakeDevices, monkeypatch: pytest.MonkeyPatch) -> None:
    error = opened_by(monkeypatch, WrongDeviceError("expected this"))(bus("can2", serial="0A17"))
    assert isinstance(error, WrongBusError)
    assert error.bus == "crane"
    assert error.why == "expected this; the device of the file is can0, can1"
    assert str(error) == f"bus crane: {error.why}"


def test_an_interface_that_is_missing_may_have_another_name(
    here: FakeDevices, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said and not used: which interface is driven stands in the file."""
    fail = opened_by(monkeypatch, OSError(errno.ENODEV, "No such device"))
    text = "bus crane: cannot open socketcan channel can-x: No such device"
    assert str(fail(bus("can-x", serial="0B99"))) == f"{text}; the device of the file is can2"
    assert str(fail(bus("can-x", driver="peak_usb"))) == text
    assert str(fail(bus("can-x"))) == text


class Opened(Bound):
    """A socket that is opened and bound."""

    made: list["Opened"]

    def __init__(self, *_kind: int) -> None:
        super().__init__("")
        self.closed = False
        self.made.append(self)

    def setblocking(self, _flag: bool) -> None:
        pass

    def setsockopt(self, *_option: Any) -> None:
        pass

    def bind(self, address: tuple[str]) -> None:
        self._names = [address[0]]

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize("ids", [None, IDS])
def test_sockets_of_another_device_are_closed_at_once(
    here: FakeDevices, monkeypatch: pytest.MonkeyPatch, ids: BusRoutes | None
) -> None:
    made: list[Opened] = []
    monkeypatch.setattr(Opened, "made", made, raising=False)
    monkeypatch.setattr("canshaper.bus.socketcan.socket.socket", Opened)
    monkeypatch.setattr("canshaper.bus.socketcan.check_present", lambda _: None)
    monkeypatch.setattr("canshaper.bus.socketcan.has_echo", lambda _: True)
    right = open_sockets(bus("can0", serial="0A17", port=0), ids)
    assert [one.closed for one in made] == [False] * len(right)
    made.clear()
    with pytest.raises(WrongDeviceError, match="expected serial number 0A17, but can2 has"):
        open_sockets(bus("can2", serial="0A17"), ids)
    assert [one.closed for one in made] == [True] * (3 if ids else 1)
    assert open_sockets(bus("can2"), ids)  # without match
