"""Commissioning of the file on a page: the same steps and the same state as on the terminal.

A rehearsal runs in a process of its own, so that the cranes of the live page do not wait for it.
The page of a real machine only shows the progress: a person moves its valves from the terminal in
front of them.
"""

import asyncio
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Route

STATIC = Path(__file__).parent / "static"
CONFLICT, NOT_FOUND = 409, 404
COMMAND = (sys.executable, "-m", "canshaper.studio.commission_process")


class Commission:
    """The commissioning of one deployment file.

    Args:
        path: the file; None for a shipped file, which has no commissioning.
        changes: parameters of the simulated crane, NAME=VALUE.
        machine: show the commissioning of the machine; else its rehearsal.
    """

    def __init__(self, path: Path | None, changes: list[str], *, machine: bool) -> None:
        self._path, self._changes, self._machine = path, changes, machine
        self._shown: dict[str, Any] = {"file": "", "steps": []}
        self._busy = ""
        self._process: subprocess.Popen[str] | None = None

    def routes(self) -> list[BaseRoute]:
        """Return the routes for page, state, files and requests of the commissioning."""
        return [
            Route("/commission", self._page),
            Route("/commission/state", self._state),
            Route("/commission/files/{name}", self._file),
            Route("/commission/{what}/{step}", self._do, methods=["POST"]),
        ]

    def close(self) -> None:
        """End the process, even while it runs a step; the next request starts another."""
        if self._process:
            with self._process as process:  # the context closes its pipes
                process.terminate()
            self._process = None

    # -- answers -------------------------------------------------------------------------------

    async def _page(self, _request: Request) -> Response:
        return FileResponse(STATIC / "commission.html")

    async def _state(self, _request: Request) -> Response:
        return await self._answer("show", "", "")

    async def _do(self, request: Request) -> Response:
        """Run, accept or skip a step; refuse on a machine and while another request is done."""
        what, step = request.path_params["what"], request.path_params["step"]
        if what not in ("run", "accept", "skip"):
            return PlainTextResponse("no such page\n", NOT_FOUND)
        if self._machine:
            text = "expected a rehearsal; a machine is commissioned at the terminal"
            return PlainTextResponse(f"{text}\n", CONFLICT)
        if self._busy:
            return PlainTextResponse(f"{self._busy} is under way\n", CONFLICT)
        return await self._answer(what, step, request.query_params.get("answer", ""))

    async def _file(self, request: Request) -> Response:
        """Answer with a picture of a step or the report, if the last state named it."""
        name = request.path_params["name"]
        known = [p for step in self._shown["steps"] for p in step["pictures"]]
        if name not in known and name != (self._shown.get("report") or None):
            return PlainTextResponse("no such file\n", NOT_FOUND)
        return FileResponse(Path(self._shown["folder"]) / name)

    async def _answer(self, what: str, step: str, answer: str) -> Response:
        """Do the request and answer with the state; while busy or without a file, only answer."""
        if self._path and not self._busy:
            self._busy = step or "reading"
            try:
                self._shown = await asyncio.to_thread(self._work, what, step, answer)
            except (OSError, ValueError) as error:  # the process has ended
                self._shown = {**self._shown, "error": f"not done, its process ended: {error}"}
            finally:
                self._busy = ""
        about = {"busy": self._busy, "machine": self._machine}
        return JSONResponse({**self._shown, **about})

    def _work(self, what: str, step: str, answer: str) -> dict[str, Any]:
        """Let the process do the request; start it again if it has ended."""
        if self._process and self._process.poll() is not None:
            self.close()
        if self._process is None:
            self._process = subprocess.Popen(
                COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        assert self._process.stdin
        assert self._process.stdout
        about = {"path": str(self._path), "changes": self._changes, "machine": self._machine}
        asked = {"what": what, "step": step, "answer": answer, **about}
        print(json.dumps(asked), file=self._process.stdin, flush=True)
        shown: dict[str, Any] = json.loads(self._process.stdout.readline())
        return shown
