"""A network between browser and studio that can be lost: bytes are swallowed, nothing is closed."""

import asyncio
import threading
from collections.abc import Callable
from typing import Self

HEAD_END = b"\r\n\r\n"
CONNECTED = b"HTTP/1.1 101 "


class Proxy:
    """A TCP proxy on loopback, in a thread of its own.

    The studio serves only to those who name its own address: in each request the proxy's port is
    replaced by that of the studio.

    Args:
        port: of the studio.
    """

    def __init__(self, port: int) -> None:
        self._target = port
        self._swallows = threading.Event()
        self._slow = (0.0, 0.0)
        self._ready = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="proxy")

    def __enter__(self) -> Self:
        self._thread.start()
        self._ready.wait()
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    @property
    def url(self) -> str:
        """Address to open in the browser."""
        return f"http://127.0.0.1:{self.port}/"

    def lose(self) -> None:
        """From now on swallow every byte, in both directions."""
        self._swallows.set()

    def restore(self) -> None:
        """From now on pass on what comes; what was swallowed is lost."""
        self._swallows.clear()

    def slow_down(self, connect_s: float, begin_s: float) -> None:
        """From now on a page waits for its connection, and then for the first message on it."""
        self._slow = (connect_s, begin_s)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(
            asyncio.start_server(self._serve, "127.0.0.1", 0, limit=1 << 20)
        )
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        self._loop.run_forever()
        server.close()
        tasks = asyncio.all_tasks(self._loop)
        for task in tasks:
            task.cancel()
        self._loop.run_until_complete(asyncio.wait(tasks, timeout=1.0) if tasks else _nothing())
        self._loop.run_until_complete(_nothing())
        self._loop.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, out = await asyncio.open_connection("127.0.0.1", self._target)
        own, studio = (f":{port}".encode() for port in (self.port, self._target))

        def named(data: bytes) -> bytes:
            return data.replace(own, studio) if HEAD_END in data else data

        try:
            await asyncio.gather(self._pass(reader, out, named), self._pass(there, writer, bytes))
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            writer.transport.abort()
            out.transport.abort()

    async def _pass(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        changed: Callable[[bytes], bytes],
    ) -> None:
        while data := await reader.read(1 << 16):
            if self._swallows.is_set():
                continue
            if data.startswith(CONNECTED):
                head, end, data = data.partition(HEAD_END)
                await asyncio.sleep(self._slow[0])
                writer.write(head + end)
                await asyncio.sleep(self._slow[1])
            writer.write(changed(data))
            await writer.drain()
        if not self._swallows.is_set():
            writer.close()


async def _nothing() -> None:
    """Let the loop close what was aborted."""
    await asyncio.sleep(0)
