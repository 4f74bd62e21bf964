"""Requests that are begun and never finished: their connections end, others are served."""

import socket
import threading
from collections.abc import Iterator

import pytest
from starlette.responses import PlainTextResponse

from canshaper.studio import server as server_module
from canshaper.studio.server import listening, server

WAIT_S = 60.0  # only to end a test that hangs
WHOLE = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"


@pytest.fixture
def address(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, int]]:
    """A server that gives any request the same answer, and waits half a second for it."""
    monkeypatch.setattr(server_module, "REQUEST_S", 0.5)
    one = listening("127.0.0.1", 0)
    web = server(PlainTextResponse("here"))
    thread = threading.Thread(target=web.run, kwargs={"sockets": [one]})
    thread.start()
    yield one.getsockname()
    web.should_exit = True
    thread.join()


def sent(address: tuple[str, int], *parts: bytes) -> bytes:
    """Bytes that come back until the server closes the connection."""
    with socket.create_connection(address, WAIT_S) as one:
        for part in parts:
            one.sendall(part)
        received = b""
        try:
            while data := one.recv(4096):
                received += data
        except ConnectionResetError:
            pass
    return received


@pytest.mark.parametrize(
    "begun",
    [b"", b"G", WHOLE[:-2], b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 9999\r\n\r\nx"],
    ids=["nothing", "a letter", "no end of the head", "no end of the body"],
)
def test_an_unfinished_request_ends(address: tuple[str, int], begun: bytes) -> None:
    answered = b"here" in sent(address, begun)
    assert answered is begun.startswith(b"POST")
    assert b"here" in sent(address, WHOLE)


def test_an_unfinished_one_after_a_whole_one_ends_too(address: tuple[str, int]) -> None:
    assert sent(address, WHOLE, WHOLE[:-2]).count(b"here") == 1


def test_a_head_without_end_is_refused(address: tuple[str, int]) -> None:
    head = b"GET / HTTP/1.1\r\n" + b"X: " + b"a" * 20_000
    assert b"400" in sent(address, head).split(b"\r\n")[0]
