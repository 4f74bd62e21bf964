"""The web side of the page for finished drives: a list of the drives, and each drive as JSON."""

import json
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from canshaper import __version__
from canshaper.errors import CanshaperError
from canshaper.studio.access import Access
from canshaper.studio.playback import Playback
from canshaper.studio.server import drawn_of, page_app
from canshaper.studio.stage import RAW

COLORS = ("--shaped", "--other", "--raw")
"""Colours of the cranes but the raw one, in their order, as names of variables in the style."""


@dataclass
class Choice:
    """A drive that can be opened: its title in the list, and ``load``, which makes it (slow)."""

    title: str
    load: Callable[[], Playback]


def playback_app(file: str, choices: Sequence[Choice], access: Access) -> ASGIApp:
    """Return the page for finished drives.

    Args:
        file: name of the opened file, for people.
        choices: at least one; each drive is made on request, the last one is kept.
        access: rules for who may see the page.
    """
    kept = _Kept(file, choices)

    def drives(_request: Request) -> Response:
        return JSONResponse([choice.title for choice in choices])

    def drive(request: Request) -> Response:
        number = request.path_params["number"]
        if number >= len(choices):
            return PlainTextResponse(f"expected a drive up to {len(choices) - 1}\n", 404)
        try:
            return Response(kept.drive(number), media_type="application/json")
        except CanshaperError as error:
            return PlainTextResponse(f"{error}\n", 500)

    routes = [Route("/drives.json", drives), Route("/drive/{number:int}.json", drive)]
    return page_app(routes, "playback.js", access)


class _Kept:
    """The last requested drive; only one drive is made at a time."""

    def __init__(self, file: str, choices: Sequence[Choice]) -> None:
        self._file, self._choices = file, choices
        self._lock = threading.Lock()
        self._number = -1
        self._content = b""

    def drive(self, number: int) -> bytes:
        """Return a drive as JSON; make it unless it is the kept one."""
        with self._lock:
            if number != self._number:
                playback = self._choices[number].load()
                content = {"hello": self._hello(playback), **playback.as_dict()}
                self._content = json.dumps(content, separators=(",", ":")).encode()
                self._number = number
            return self._content

    def _hello(self, playback: Playback) -> dict[str, Any]:
        names = [film.name for film in playback.films]
        colors = dict(zip((name for name in names if name != RAW), COLORS, strict=False))
        return {
            "version": __version__,
            "file": self._file,
            "axes": playback.axes,
            "cranes": names,
            "colors": {RAW: "--raw", **colors},
            "drives": False,
            "machine": False,
            "playback": True,
            "profiles": False,
            "sliders": {},
            **drawn_of(playback.parameters, playback.films[0].view.deployment),
        }
