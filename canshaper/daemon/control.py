"""Answers the requests of clients of the control socket, and logs who asked for a change."""

import logging
import re
from collections.abc import Mapping
from typing import Any

from canshaper.blackbox.keeper import BlackBox
from canshaper.blackbox.recorder import Recorder
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.daemon.control_server import ControlServer
from canshaper.daemon.reporter import Reporter
from canshaper.machine.deployment import Deployment

log = logging.getLogger("canshaper")


class Control:
    """The control socket of a deployment.

    Args:
        server: listening socket.
        controller: controller whose numbers may be changed.
        recorder: records the changed numbers, and rehearses faults.
        black_box: writes a file on request.
        reporter: reports state, counters and lateness.
    """

    def __init__(
        self,
        server: ControlServer,
        controller: Controller,
        recorder: Recorder,
        black_box: BlackBox,
        reporter: Reporter,
    ) -> None:
        self._server, self._recorder, self._black_box = server, recorder, black_box
        self._reporter = reporter
        self._adjuster = Adjuster(controller)

    def serve(self, now_ns: int) -> None:
        """Answer one request, if one waits; see ``ControlServer.serve``."""
        self._server.serve(self._answer, now_ns)

    def close(self) -> None:
        """Close the socket and remove its path."""
        self._server.close()

    def _answer(self, request: Mapping[str, Any], peer: str) -> Mapping[str, Any]:
        values = request.get("set", {})
        if by := str(request.get("by", "")):  # must not look like another field of the log
            peer = f"by={re.sub(r'[^a-zA-Z0-9/_.@-]+', '_', by)[:60]} {peer}"
        known = {"set", "black_box", "by", "status", "fault"}
        if request.keys() - known or not isinstance(values, dict):
            expected = '{} or {"set": {KEY: VALUE}}, {"black_box": "write"}, {"status": true}'
            expected += ', {"fault": NAME}'
            raise ValueError(f"expected {expected}, got another object")
        if "fault" in request:
            return {"fault": self._recorder.rehearse(request["fault"], peer)}
        if "black_box" in request:
            if request["black_box"] == "write":
                self._black_box.request()
                log.info("black-box=requested %s", peer)
            return {"black_box": self._black_box.report()}
        if "status" in request:
            return {"status": self._reporter.numbers()}
        if "set" in request:
            try:
                changes = self._adjuster.change(values)
            except ValueError as error:
                log.warning("set=refused %s %s", peer, error)
                raise
            self._recorder.set(values)
            for change in changes:
                log.info("set %s %s", change, peer)
        return {"adjustable": self._adjuster.table()}


def open_control(
    deployment: Deployment,
    controller: Controller,
    recorder: Recorder,
    black_box: BlackBox,
    reporter: Reporter,
) -> Control | None:
    """Open the control socket of a deployment; if that fails, log why and return None."""
    control = deployment.config.control
    assert control is not None  # called for such deployments only
    path = control.path(deployment.path)
    try:
        server = ControlServer(path, int(control.mode, 8))
    except OSError as error:
        log.warning("control=none socket=%s %s", path, error.strerror or error)
        return None
    return Control(server, controller, recorder, black_box, reporter)
