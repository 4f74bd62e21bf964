"""Requests that are begun and never finished: their connections end."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

# From the first byte, or from the end of the last answer, to the end of a request.
REQUEST_S = 10.0
# Head of a request; a browser sends some hundred bytes.
MOST_HEAD_BYTES = 16_384
# Connections at a time; a page takes seven at most.
MOST_CONNECTIONS = 100


class BoundedHttp(H11Protocol):
    """uvicorn's protocol, which itself waits for the rest of a request without end."""

    _overdue: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A connection: its first request has to come."""
        super().connection_made(transport)
        self._watch()

    def data_received(self, data: bytes) -> None:
        """A piece of a request, perhaps its end."""
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """Answered: the next request has to come."""
        super().on_response_complete()
        self._watch()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """A page: from now on pings watch it."""
        self._cancel()
        super().handle_websocket_upgrade(event)
        self._cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """The end."""
        self._cancel()
        super().connection_lost(exc)

    def _watch(self) -> None:
        """Count the time as long as nothing is being answered."""
        answering = self.cycle is not None and not self.cycle.response_complete
        if answering or self.transport.is_closing() or self.transport.get_protocol() is not self:
            self._cancel()
        elif self._overdue is None:
            self._overdue = self.loop.call_later(REQUEST_S, self.transport.abort)

    def _cancel(self) -> None:
        if self._overdue is not None:
            self._overdue.cancel()
            self._overdue = None
