"""The web server of the page: files, and one connection for each page. It needs no internet."""

import asyncio
import itertools
import socket
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import URL, Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import (
    FileResponse,
    JSONResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
)
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket
from uvicorn.protocols.http.h11_impl import H11Protocol

from canshaper import __version__
from canshaper.machine.deployment import Deployment
from canshaper.studio.access import Access
from canshaper.studio.client import MOST_BYTES, TRY_AGAIN_LATER, Client
from canshaper.studio.commission import Commission
from canshaper.studio.numbers import RANGES
from canshaper.studio.seen import residuals, sway_of
from canshaper.studio.stage import MACHINE, RAW, Stage
from canshaper_sim.axes import LUFFING, OVERHEAD, TOWER, kind_of
from canshaper_sim.crane import CraneParameters

# Time limit for the head of a request, from the connection or the end of the last answer, s.
REQUEST_S = 10.0
# Head of a request; a browser sends some hundred bytes.
MOST_HEAD_BYTES = 16_384
# Connections at a time; a page takes seven at most.
MOST_CONNECTIONS = 100


class BoundedHttp(H11Protocol):
    """uvicorn's protocol with a time limit: uvicorn itself waits forever for a whole request."""

    _overdue: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin a connection; abort it if no head of a request is there in ``REQUEST_S``."""
        super().connection_made(transport)
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Take a part of a request, perhaps its last."""
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """End an answer; abort the connection if no next head is there in ``REQUEST_S``."""
        super().on_response_complete()
        self._watch()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Begin a page's connection: from now on pings watch it."""
        self._cancel()
        super().handle_websocket_upgrade(event)
        self._cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the connection."""
        self._cancel()
        super().connection_lost(exc)

    def _watch(self) -> None:
        """Let the time limit run unless a request is being answered or a page has connected."""
        answering = self.cycle is not None and not self.cycle.response_complete
        if answering or self.transport.is_closing() or self.transport.get_protocol() is not self:
            self._cancel()
        elif self._overdue is None:
            self._overdue = self.loop.call_later(REQUEST_S, self.transport.abort)

    def _cancel(self) -> None:
        if self._overdue is not None:
            self._overdue.cancel()
            self._overdue = None


STATIC = Path(__file__).parent / "static"
MOST_PAGES = 8
SHUTDOWN_S = 2
HEADERS = {
    # Whatever a page loads comes from here; uPlot sets styles of its elements.
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline';"
    " img-src 'self' data: blob:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


def build_app(
    stage: Stage, access: Access, parameters: CraneParameters, commission: Commission
) -> ASGIApp:
    """Return the live page of a stage, which draws ``parameters``, and that of commissioning."""

    def left(_request: HTTPConnection) -> Response:
        return JSONResponse(residuals(stage.deployment, stage.in_force()))

    routes = [pages_of(stage, hello_of(stage, parameters)), Route("/residuals.json", left)]
    routes += commission.routes()
    return page_app(routes, "main.js", access)


def pages_of(stage: Stage, hello: dict[str, Any]) -> BaseRoute:
    """Return the route for at most ``MOST_PAGES`` pages; ``hello`` is the first message to each."""
    numbers = itertools.count(1)
    open_pages: set[int] = set()

    async def connection(websocket: WebSocket) -> None:
        await websocket.accept()
        if len(open_pages) >= MOST_PAGES:
            await websocket.close(TRY_AGAIN_LATER, f"{MOST_PAGES} pages are open already")
            return
        number = next(numbers)
        open_pages.add(number)
        try:
            await Client(websocket, stage, number, hello).serve()
        finally:
            open_pages.discard(number)

    return WebSocketRoute("/ws", connection)


def page_app(routes: Sequence[BaseRoute], script: str, access: Access) -> ASGIApp:
    """Return the page with this script, a file of ``STATIC``, and routes for its requests."""

    async def page(_request: HTTPConnection) -> Response:
        return FileResponse(STATIC / "index.html")

    async def begin(_request: HTTPConnection) -> Response:
        return FileResponse(STATIC / script)

    fixed = [Route("/", page), Route("/page.js", begin)]
    static = Mount("/static", StaticFiles(directory=STATIC))
    return Guard(Starlette(routes=[*fixed, *routes, static]), access)


class Guard:
    """Refuses requests against the rules of access (403); adds ``HEADERS`` to other answers."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve or refuse a request or connection; a token in its URL goes into a cookie."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        fault = self._fault(scope, connection)
        if fault is None and scope["type"] == "http" and "token" in connection.query_params:
            answer: Response = RedirectResponse("/", 303)  # the secret leaves the address line
            token = self._access.token or ""
            answer.set_cookie(self._access.cookie, token, httponly=True, samesite="strict")
            await answer(scope, receive, _with_headers(send))
        elif fault is None:
            await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "http":
            await PlainTextResponse(f"{fault}\n", 403)(scope, receive, send)
        else:
            answer = PlainTextResponse(f"{fault}\n", 403)
            await WebSocket(scope, receive, send).send_denial_response(answer)

    def _fault(self, scope: Scope, connection: HTTPConnection) -> str | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        fault = self._access.host_fault(host)
        fault = fault or self._access.token_fault(connection.query_params, connection.cookies)
        if not fault and (scope["type"] == "websocket" or scope["method"] == "POST"):
            fault = self._access.origin_fault(host, headers.get("origin"))
        return fault


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(HEADERS)
        await send(message)

    return sending


def hello_of(stage: Stage, parameters: CraneParameters) -> dict[str, Any]:
    """Return the first message to a page: cranes, controls, sliders, and ``drawn_of``."""
    return {
        "version": __version__,
        "file": stage.deployment.path.name,
        "axes": list(stage.deployment.axes),
        "cranes": list(stage.cranes),
        "colors": {name: "--raw" if name == RAW else "--shaped" for name in stage.cranes},
        "drives": stage.cab is not None,
        "machine": MACHINE in stage.cranes,
        "numbers": stage.numbers is not None,
        "profiles": any(j.next_profile for j in stage.deployment.config.joysticks.values()),
        **drawn_of(parameters, stage.deployment),
        "preference": stage.preference is not None,
        "sliders": {
            name: {"range": RANGES[name], "numbers": [[n.key, n.value, n.power] for n in numbers]}
            for name, numbers in stage.sliders.items()
        },
    }


def drawn_of(parameters: CraneParameters, deployment: Deployment) -> dict[str, Any]:
    """Return the data for a page's drawing: lengths of links, and the swing that each axis excites.

    Lengths are in m. For an overhead crane ``hall`` has those of runway, bridge, rope and sling,
    else None; a picture named in the file, as a multicopter's (``drawn``), is scaled by its rope.
    The ``boom`` of a tower crane (its jib) and of a luffing crane is ``straight``.
    """
    coordinates, section = deployment.coordinates, deployment.config.crane
    drawn: str | None = getattr(section, "drawn", None)
    grapple, own, kind = parameters.grapple, parameters.overhead, kind_of(coordinates.values())
    boom, tower, luffing = parameters.joints.boom._asdict(), parameters.tower, parameters.luffing
    if kind == TOWER:
        jib = {"jib_m": tower.radius_max_m, "pillar_m": tower.jib_m, "straight": True}
        boom |= {**jib, "main_boom_m": tower.radius_max_m, "outer_boom_m": 0.0}
    elif kind == LUFFING:
        boom |= {"pillar_m": luffing.pillar_m, "main_boom_m": luffing.boom_m, "straight": True}
        boom["outer_boom_m"] = luffing.extension_max_m
    hall = {"runway": own.runway_m, "span": own.span_m, "rope": own.rope_max_m}
    if drawn:
        hall = {"runway": 2.0 * own.rope_m, "span": 2.0 * own.rope_m, "rope": own.rope_m}
    return {
        "sway_of": sway_of(coordinates),
        "boom": boom,
        "grapple": {"l1": grapple.l1_m, "l2": grapple.l2_m},
        "hall": {**hall, "sling": own.sling.length_m} if kind == OVERHEAD else None,
        "drawn": drawn,
    }


def listening(host: str, port: int) -> socket.socket:
    """Return a socket on which the server listens.

    Raises:
        OSError: the address cannot be used, or is in use.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family, backlog=64)


def address(host: str, port: int, token: str | None) -> str:
    """Return the URL to open in a browser, with the secret token if there is one."""
    name = f"[{host}]" if ":" in host else host
    query = f"?token={token}" if token else ""
    return str(URL(f"http://{name}:{port}/{query}"))


def server(app: ASGIApp) -> uvicorn.Server:
    """Return a server that has not begun; its ``run(sockets=[...])`` serves until it is stopped."""
    config = uvicorn.Config(
        app,
        log_level="error",
        http=BoundedHttp,
        h11_max_incomplete_event_size=MOST_HEAD_BYTES,
        limit_concurrency=MOST_CONNECTIONS,
        ws="websockets-sansio",
        ws_max_size=MOST_BYTES,
        lifespan="off",
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    return uvicorn.Server(config)
