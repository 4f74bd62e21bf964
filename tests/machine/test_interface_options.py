"""Options of a bus of python-can: checked against what its interface can be opened with."""

from typing import Any

import pytest
from can.interfaces import BACKENDS

from canshaper.config.bus import Bus
from canshaper.machine.buses import option_faults

CLIENT = {"host": "127.0.0.1", "port": 29536}


@pytest.mark.parametrize("interface", ["udp_multicast", "virtual", "kvaser", "vector"])
def test_an_interface_with_can_fd(interface: str) -> None:
    bus = Bus(interface=interface, channel="0", fd=True, data_bitrate=2_000_000)
    assert [text for place, text in option_faults(bus) if place[0] in ("fd", "data_bitrate")] == []


def test_an_interface_without_can_fd() -> None:
    bus = Bus(interface="slcan", channel="/dev/ttyUSB0", fd=True, data_bitrate=2_000_000)
    text = "expected an interface of python-can that takes it, got slcan"
    assert list(option_faults(bus)) == [(("fd",), text), (("data_bitrate",), text)]
    (fault,) = option_faults(Bus(interface="slcan", channel="/dev/ttyUSB0", fd=True))
    assert fault == (("fd",), text)
    (fault,) = option_faults(Bus(interface="virtual", channel="0", options={"fd": True}))
    assert fault[0] == ("options", "fd")  # it stands with the bus


def faults(interface: str, **options: Any) -> list[tuple[Any, str]]:
    return list(option_faults(Bus(interface=interface, channel="can0", options=options)))


@pytest.mark.parametrize(
    ("interface", "options"),
    [
        ("socketcan", {}),
        ("virtual", {}),
        ("slcan", {"rtscts": True, "tty_baudrate": 1_000_000, "timeout": 0.01}),
        ("slcan", {"timeout": 1}),
        ("socketcand", CLIENT),
        ("socketcand", {**CLIENT, "tcp_tune": False}),
    ],
)
def test_what_an_interface_knows_is_right(interface: str, options: dict[str, Any]) -> None:
    assert faults(interface, **options) == []


def test_socketcand_needs_host_and_port() -> None:
    assert faults("socketcand") == [
        (("options",), f"expected {key}, which socketcand needs, got none")
        for key in ("host", "port")
    ]


def test_an_option_that_the_interface_does_not_know() -> None:
    assert faults("slcan", rtsct=True) == [
        (
            ("options", "rtsct"),
            "expected an option of slcan (tty_baudrate, timing, sleep_after_open, rtscts,"
            " listen_only, timeout), got rtsct; did you mean rtscts?",
        )
    ]


@pytest.mark.parametrize("key", ["channel", "bitrate", "receive_own_messages"])
def test_what_stands_elsewhere_is_no_option(key: str) -> None:
    (fault,) = faults("socketcand", **CLIENT, **{key: 1})
    assert fault[0] == ("options", key)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"rtscts": "yes"}, "expected bool, got 'yes'"),
        ({"tty_baudrate": 0.5}, "expected int, got 0.5"),
        ({"tty_baudrate": True}, "expected int, got True"),
    ],
)
def test_a_value_of_another_type(options: dict[str, Any], text: str) -> None:
    assert faults("slcan", **options) == [(("options", next(iter(options))), text)]


@pytest.mark.parametrize(
    ("options", "text"),
    [({"port": "29536"}, "expected int, got '29536'"), ({"host": 1}, "expected str, got 1")],
)
def test_a_value_whose_type_python_can_does_not_name(options: dict[str, Any], text: str) -> None:
    assert faults("socketcand", **CLIENT | options) == [(("options", next(iter(options))), text)]


def test_an_interface_that_python_can_does_not_have() -> None:
    assert faults("slcam") == [
        (("interface",), "expected an interface of python-can, got slcam; did you mean slcan?")
    ]


def test_two_buses_that_differ_in_an_option_are_two() -> None:
    first, second = (
        Bus(interface="socketcand", channel="can0", options={**CLIENT, "port": port})
        for port in (1, 2)
    )
    assert first != second
    assert len({first, second, first.model_copy()}) == 2


class Device:
    """An adapter of nobody, for what only some of python-can's have."""


class Opened:
    """An interface that takes such a device, and one whose annotation only a type checker knows."""

    def __init__(self, channel: str, device: Device, count: int = 1) -> None:
        """Open nothing."""


class Unknown:
    """An interface with an annotation that is not there when it runs."""

    def __init__(self, channel: str, device: "Nowhere") -> None:  # type: ignore[name-defined] # noqa: F821
        """Open nothing."""


class Ours:
    """An interface that takes nothing but what stands elsewhere in the file."""

    def __init__(self, channel: str) -> None:
        """Open nothing."""


class First:
    """An interface whose own parameter comes first, and may be of two types."""

    def __init__(self, number: int | str, channel: str) -> None:
        """Open nothing."""


def test_an_interface_without_options(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BACKENDS, "adapter", (__name__, "Ours"))
    text = "expected an option of adapter (it has none), got number"
    assert faults("adapter", number=1) == [(("options", "number"), text)]


def test_an_option_of_two_types(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BACKENDS, "adapter", (__name__, "First"))
    assert faults("adapter", number="A") == faults("adapter", number=1) == []
    assert faults("adapter") == [
        (("options",), "expected number, which adapter needs, got none"),
    ]
    assert faults("adapter", number=1.5) == [
        (("options", "number"), "expected int | str, got 1.5"),
    ]


@pytest.mark.parametrize("name", ["Opened", "Unknown"])
def test_what_has_no_type_that_can_be_checked_may_be_right(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setitem(BACKENDS, "adapter", (__name__, name))
    assert faults("adapter", device="usb0") == []


def test_an_interface_that_needs_what_is_not_here_is_not_checked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(BACKENDS, "adapter", ("no_such_module", "Bus"))
    assert faults("adapter", anything=1) == []
