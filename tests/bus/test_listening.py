"""A port that only listens."""

from collections.abc import Iterator

from canshaper.bus.port import ListeningPort
from canshaper.codec.frame import BusState, Frame
from canshaper.machine.routing import BusRoutes


class Below:
    """The port below it."""

    name, state, why, confirmed, arrived_ns = "crane", BusState.PASSIVE, "a cause", True, 17

    def __init__(self) -> None:
        self.sent: list[Frame] = []
        self.watched: list[tuple[str, BusRoutes]] = []
        self.closed = False

    def frames(self) -> Iterator[Frame]:
        yield Frame("crane", 1, False, b"")

    def background(self) -> Iterator[Frame]:
        yield Frame("crane", 2, False, b"")

    def send(self, frame: Frame) -> bool:
        self.sent.append(frame)
        return frame.data != b"full"

    def look(self) -> str:
        return "news"

    def watch(self, name: str, ids: BusRoutes) -> None:
        self.watched.append((name, ids))

    def fileno(self) -> int:
        return 5

    def close(self) -> None:
        self.closed = True


LISTENS = BusRoutes(frozenset(), frozenset({(0x300, False)}), frozenset(), frozenset())


def test_a_port_that_listens_is_the_port_below_it() -> None:
    below = Below()
    port = ListeningPort(below, LISTENS)
    assert (port.name, port.state, port.arrived_ns, port.fileno()) == (
        "crane",
        BusState.PASSIVE,
        17,
        5,
    )
    assert (port.why, port.look(), port.confirmed) == ("a cause", "news", None)
    assert [f.can_id for f in port.frames()] == [1]
    assert [f.can_id for f in port.background()] == [2]
    port.close()
    assert below.closed


def test_a_port_that_listens_sends_only_what_it_may() -> None:
    below = Below()
    claims = BusRoutes(
        frozenset(), frozenset(), frozenset(), frozenset(), claims=frozenset({(0x18EEFF9C, True)})
    )
    port = ListeningPort(below, LISTENS)
    status, valve = Frame("crane", 0x300, False, b"x"), Frame("crane", 0x200, False, b"x")
    claim = Frame("crane", 0x18EEFF9C, True, bytes(8))
    assert port.send(status)
    assert port.send(valve)  # as if it were sent: nothing may stop for that
    assert not port.send(status._replace(data=b"full"))
    assert [f.can_id for f in below.sent] == [0x300, 0x300]
    port.watch("second", claims)
    assert port.name == "second"
    assert below.watched == [("second", claims)]
    below.sent.clear()
    assert port.send(status)
    assert port.send(claim)
    assert below.sent == [claim]
