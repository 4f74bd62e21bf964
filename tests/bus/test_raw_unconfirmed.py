"""The port whose interface confirms nothing, or is none for its bus; floods of error frames."""

import errno
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.bus import interface, socketcan
from canshaper.bus.device import has_echo
from canshaper.bus.interface import MOST_ERRORS, PROBE_NS, QUIET_NS, REOPEN_NS
from canshaper.bus.socketcan import ERROR_CLASSES, STATE_CLASSES, carrier, open_sockets, renamed
from canshaper.codec.frame import BusState, FrameFault
from tests.bus.fake_sockets import BUS, IDS, Made
from tests.bus.raw_line import RECEIVED, SENT_BACK, VALVE, Line, message

BUS_OFF, RESTARTED, CONTROLLER, BERR = 0x40, 0x100, 0x4, 0x88
ERROR_ACTIVE, ERROR_PASSIVE = 0x40, 0x20


@pytest.fixture
def silent(make_line: Callable[..., Line]) -> Line:
    return make_line(echo=False)


def test_without_an_echo_no_frame_is_confirmed(silent: Line) -> None:
    """The kernel hands it back as soon as it takes it: no news, and no second sender."""
    assert silent.port.state is BusState.UNCONFIRMED
    assert silent.unconfirmed() == 10
    silent.confirm(VALVE)
    assert silent.received() == []
    assert silent.port.confirmed is None
    assert silent.port.state is BusState.UNCONFIRMED
    assert silent.faults == []


@pytest.mark.parametrize("end", ["restarted", "down"])
def test_bus_off_without_an_echo_ends_with_a_restart_or_a_set_up(silent: Line, end: str) -> None:
    silent.error(BUS_OFF)
    silent.received()
    for _ in range(5):
        silent.now_ns += PROBE_NS
        silent.error(CONTROLLER, ERROR_ACTIVE)
        silent.confirm(VALVE)
        silent.put(message(0x110))
        silent.received()
        assert not silent.port.send(VALVE)
        assert silent.port.state is BusState.BUS_OFF
    if end == "restarted":
        silent.error(RESTARTED)
        silent.received()
    else:
        silent.near[RECEIVED].fail = OSError(errno.ENETDOWN, "down")
        silent.put(message(0x110))
        silent.received()
        assert silent.port.state is BusState.DOWN
        silent.near[RECEIVED].fail = None
        silent.now_ns += PROBE_NS
    assert silent.port.send(VALVE)
    assert silent.port.state is BusState.UNCONFIRMED


def test_passive_is_seen_without_an_echo(silent: Line) -> None:
    silent.error(CONTROLLER, ERROR_PASSIVE)
    silent.received()
    assert silent.port.state is BusState.PASSIVE
    assert silent.port.send(VALVE)  # says nothing
    assert silent.port.state is BusState.PASSIVE


def test_valve_frames_are_confirmed_when_each_came_back(line: Line) -> None:
    assert (line.port.confirmed, line.port.why) == (True, "")
    line.port.send(VALVE)
    assert line.port.confirmed is False
    line.confirm(VALVE)
    line.received()
    assert line.port.confirmed


# -- carrier and name ------------------------------------------------------------------------------


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """Carrier and name as a look sees them; an error is raised."""
    given: dict[str, object] = {"carrier": True, "renamed": ""}

    def look(what: str) -> Callable[..., object]:
        def answer(*_: object) -> object:
            if isinstance(given[what], Exception):
                raise given[what]
            return given[what]

        return answer

    for what in given:
        monkeypatch.setattr(interface, what, look(what))
    return given


def test_an_interface_without_carrier_is_off_the_bus(silent: Line, seen: dict[str, object]) -> None:
    """As one that was in bus-off when it was opened."""
    for there, state in (
        (None, BusState.UNCONFIRMED),
        (False, BusState.BUS_OFF),
        (False, BusState.BUS_OFF),
        (True, BusState.UNCONFIRMED),
    ):
        seen["carrier"] = there
        assert silent.port.look() == ""
        assert silent.port.state is state
    assert silent.faults == [FrameFault.BUS_OFF]


def test_a_carrier_that_is_still_there_ends_no_bus_off(
    silent: Line, seen: dict[str, object]
) -> None:
    """It is up to a second late."""
    silent.error(BUS_OFF)
    silent.received()
    for _ in range(2):
        silent.port.look()
        assert silent.port.state is BusState.BUS_OFF


def test_with_an_echo_the_carrier_does_not_matter(line: Line, seen: dict[str, object]) -> None:
    seen["carrier"] = False
    assert line.port.look() == ""
    assert line.port.state is BusState.UP


def test_a_name_that_changed_hands_is_said_once(line: Line, seen: dict[str, object]) -> None:
    said = []
    for text in ("", "no longer can0", "no longer can0", "", "no longer can0"):
        seen["renamed"] = text
        said.append(line.port.look())
    assert said == ["", "no longer can0", "", "", "no longer can0"]
    seen["renamed"] = OSError(errno.ENODEV, "gone")
    assert line.port.look() == ""
    line.port.close()
    assert line.port.look() == ""


def test_whose_name_it_is_now(tmp_path: Path) -> None:
    for name, number in (("can0", 5), ("can1", 4)):
        (tmp_path / "sys/class/net" / name).mkdir(parents=True)
        (tmp_path / "sys/class/net" / name / "ifindex").write_text(f"{number}\n")

    class Bound(Made):
        name = "can1"

        def getsockname(self) -> tuple[str]:
            return (self.name,)

    one = Bound()
    said = "interface=can1 ifindex=4: no longer can"
    assert renamed(one, "can0", tmp_path) == f"{said}0, which is another one now, ifindex 5"  # type: ignore[arg-type]
    assert renamed(one, "can7", tmp_path) == f"{said}7"  # type: ignore[arg-type]
    assert renamed(one, "can1", tmp_path) == ""  # type: ignore[arg-type]
    one.name = ""  # gone
    assert renamed(one, "can0", tmp_path) == ""  # type: ignore[arg-type]


def test_who_has_an_echo(tmp_path: Path) -> None:
    directory = tmp_path / "sys/class/net/can0"
    directory.mkdir(parents=True)
    (directory / "ifindex").write_text("3\n")

    def kind(name: str) -> Callable[[int], tuple[str, None, None]]:
        return lambda index: (name, None, None) if index == 3 else ("", None, None)

    def refused(_index: int) -> tuple[None, None, None]:
        raise PermissionError

    (directory / "flags").write_text("0x40081\n")
    assert has_echo("can0", tmp_path, refused)
    (directory / "flags").write_text("0x81\n")
    assert [has_echo("can0", tmp_path, kind(one)) for one in ("can", "vcan", "vxcan")] == [
        False,
        True,
        True,
    ]
    assert not has_echo("can0", tmp_path, refused)


def test_valves_behind_no_echo_take_consent(
    made: list[Made], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(socketcan, "has_echo", lambda _: False)
    with pytest.raises(OSError, match="no echo, as slcan"):
        open_sockets(BUS, IDS)
    assert [one.closed for one in made] == [True] * 3
    open_sockets(BUS.model_copy(update={"unconfirmed": True}), IDS)
    open_sockets(BUS, None)


# -- an interface that is none for its bus ---------------------------------------------------------


def test_a_bus_of_can_fd_whose_interface_is_none_any_more(make_line: Callable[..., Line]) -> None:
    """One fault and a cause, however often it is tried; frames that come do not open it."""
    line = make_line(fd=True)
    line.near[SENT_BACK].fail = OSError(errno.EINVAL, "Invalid argument")
    line.refuse = OSError(errno.EINVAL, "the MTU is 16")
    for _ in range(50):
        assert not line.port.send(VALVE)
        line.now_ns += REOPEN_NS // 10
        assert line.received() == []
    assert line.port.state is BusState.UNFIT
    assert "MTU" in line.port.why
    assert line.faults == [FrameFault.BUS_ERROR]
    line.refuse = None
    line.now_ns += REOPEN_NS
    line.received()
    assert (line.port.state, line.port.why) == (BusState.UP, "")
    assert line.port.send(VALVE)


def test_an_interface_that_comes_back_as_another_kind_says_why(line: Line) -> None:
    line.near[RECEIVED].fail = OSError(errno.ENODEV, "gone")
    line.put(message(0x110))
    line.received()
    line.refuse = OSError(errno.EOPNOTSUPP, "no echo")
    line.now_ns += REOPEN_NS
    line.received()
    assert (line.port.state, line.port.why) == (BusState.UNFIT, "no echo")
    assert line.faults == [FrameFault.BUS_GONE, FrameFault.BUS_ERROR]


# -- many error frames -----------------------------------------------------------------------------


@pytest.mark.parametrize("ids", [IDS, None])
def test_a_flood_of_error_frames_is_left_to_the_kernel_for_a_while(
    make_line: Callable[..., Line], monkeypatch: pytest.MonkeyPatch, ids: object
) -> None:
    asked: list[tuple[int, int]] = []
    line = make_line(ids)
    monkeypatch.setattr(
        interface, "receive_errors", lambda one, classes: asked.append((one.fileno(), classes))
    )
    number = line.near[len(line.near) // 2].fileno()
    for _ in range(MOST_ERRORS - 1):
        line.error(BERR)
    line.received()
    assert asked == []  # each tick for itself
    for _ in range(MOST_ERRORS + 5):
        line.error(BERR)
    line.received()
    assert asked == [(number, STATE_CLASSES)]
    line.now_ns += QUIET_NS - 1
    line.received()
    line.now_ns += 1
    line.received()
    line.received()
    assert asked == [(number, STATE_CLASSES), (number, ERROR_CLASSES)]
    assert len(line.faults) == 2 * MOST_ERRORS + 4


def test_a_flood_of_an_interface_that_goes_is_no_failure(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object) -> None:
        raise OSError(errno.ENODEV, "gone")

    monkeypatch.setattr(interface, "receive_errors", gone)
    for _ in range(MOST_ERRORS):
        line.error(BERR)
    line.received()
    line.port.close()
    line.now_ns += QUIET_NS
    assert line.received() == []


def test_carrier_by_the_kernel() -> None:
    """Asked of loopback, which every machine has, and of an interface that is gone."""

    class Bound(socket.socket):
        name = "lo"

        def getsockname(self) -> tuple[str]:
            return (self.name,)

    with Bound(socket.AF_INET, socket.SOCK_DGRAM) as one:
        up = int(Path("/sys/class/net/lo/flags").read_text(), 0) & 1
        assert carrier(one) is (True if up else None)
        one.name = ""
        assert carrier(one) is None
        one.name = "none such"
        with pytest.raises(OSError, match="No such device"):
            carrier(one)
