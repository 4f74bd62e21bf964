"""The crane of a study behind the page: one crane; the page does not show its setting."""

import cmath
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from starlette.requests import HTTPConnection
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from canshaper.codec.frame import NULL, Frame, with_source
from canshaper.config.load import load_config
from canshaper.errors import UsageError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.recording.channels import InputFinder
from canshaper.studio.access import Access
from canshaper.studio.cab import Cab
from canshaper.studio.crane import CraneSession
from canshaper.studio.in_process import HeldHand, InProcessCrane
from canshaper.studio.server import hello_of, page_app, pages_of
from canshaper.studio.stage import Stage
from canshaper.studio.study import Placement, Session, Table
from canshaper.studio.view import CraneView
from canshaper_sim.crane import CraneParameters
from canshaper_sim.realtime import open_ports

CRANE = "crane"
INPUTS = ("keyboard", "gamepad", "pointer")  # of a page
WHY = ("unplugged", "picture")  # a page breaks off
CAN = "CAN"
_SHOWN = {"pose", "joints", "sway", "measured", "simulated", "daemon", "crane", "axes"}
# Keys of an axis that a crane without anti-sway does not have.
_OF_FILTERS = ("gain_schedule", "profiles", "sway_sensor")


def setting(path: Path, folder: Path, *, raw: bool = False) -> Deployment:
    """Write a copy of a file without switches for anti-sway or profiles; return its deployment.

    Args:
        path: the file.
        folder: folder for a copy of the file.
        raw: also without filters and motions, for a drive without anti-sway.

    Raises:
        ConfigError: the file or its copy is not valid.
    """
    config, source = load_config(path)
    data = json.loads(json.dumps(source.data))
    data["dbc"] = [str(path.resolve().parent / name) for name in config.dbc]
    for joystick in data["joysticks"].values():
        joystick.pop("anti_sway_off", None)
        joystick.pop("next_profile", None)
    if raw:
        data.pop("motion", None)
        for axis in data["axes"].values():
            axis["filter"] = {"kind": "off"}
            axis.get("limits", {}).pop("reversal", None)
            for name in _OF_FILTERS:
                axis.pop(name, None)
    copy = folder / f"{'raw-' * raw}{path.name}"
    copy.write_text(json.dumps(data), encoding="utf-8")
    return load_deployment(copy)


class RealJoysticks(HeldHand):
    """Joysticks of a real machine in place of those of the page; nothing is ever sent to it.

    Args:
        deployment: the machine of the buses and joysticks.
        grip: button that grips, as MESSAGE.SIGNAL; None for that of the page.

    Attributes:
        gripped: the button was pressed; its reader sets it to False.

    Raises:
        BusError: a bus cannot be opened.
        UsageError: the DBC files have no such signal.
    """

    def __init__(self, deployment: Deployment, grip: str | None) -> None:
        super().__init__(deployment)
        stop = deployment.emergency_stop
        inputs: list[BoundInput] = [*deployment.joysticks.values(), *deployment.switches]
        self._finder = InputFinder(deployment.config.buses, [*inputs, *([stop] if stop else [])])
        self._button = _button(deployment, grip) if grip else None
        self._down = False
        self.gripped = False
        self.ports = open_ports(deployment)

    def frames_of_tick(self, time_ms: int, _tick_ms: int) -> list[Frame]:
        """Return the waiting joystick and switch frames, drop others; note a press of the grip."""
        waiting = [frame for port in self.ports.values() for frame in port.frames()]
        for frame in waiting:
            self._watch(frame)
        return [one for one in waiting if self._finder.find(one, time_ms * 1_000_000)]

    def close(self) -> None:
        """Close the buses."""
        for port in self.ports.values():
            port.close()

    def _watch(self, frame: Frame) -> None:
        if self._button is None:
            return
        message, signal = self._button
        ids = {frame.can_id, with_source(frame.can_id, NULL) if frame.extended else frame.can_id}
        if message.frame_id in ids and message.is_extended_frame == frame.extended:
            values: Any = message.decode(frame.data, decode_choices=False, allow_truncated=True)
            down = bool(values.get(signal))
            self.gripped |= down and not self._down
            self._down = down


def _button(deployment: Deployment, grip: str) -> tuple[Any, str]:
    name, _, signal = grip.partition(".")
    found = deployment.messages.find(name)
    if isinstance(found, str) or signal not in {one.name for one in found[1].signals}:
        raise UsageError(f"--grip: expected MESSAGE.SIGNAL of the DBC files, got {grip}")
    return found[1], signal


class StudyStage(Stage):
    """A person and the crane of a study.

    Args:
        settings: deployment by letter.
        planned: every placement with its place, see ``plan``.
        break_s: least break between two parts, s.
        table: the table that takes the placements.
        parameters: the crane.
        changes: the changes that give ``parameters``, NAME=VALUE.
        joysticks: joysticks of a machine; None for those of the page.
        done: called once, from the loop, when all placements are done.

    Raises:
        DriveError: no simulated crane fits the deployments.
    """

    def __init__(
        self,
        settings: Mapping[str, Deployment],
        planned: dict[Placement, tuple[float, float]],
        break_s: float,
        table: Table,
        *,
        parameters: CraneParameters,
        changes: Sequence[str],
        joysticks: RealJoysticks | None,
        done: Callable[[], None],
    ) -> None:
        super().__init__(next(iter(settings.values())))
        self.cab = Cab(self.deployment.axes, lambda text: self.events.add("page", text))
        self._settings, self._grapple, self._changes = settings, parameters.grapple, changes
        self.joysticks, self._done, self._over = joysticks, done, False
        self.study = Session(planned, break_s, table, self._put)
        self._put(next(iter(planned)).setting)

    def _put(self, letter: str) -> None:
        """Replace the crane by one with this setting, at rest in its start pose."""
        deployment = self._settings[letter]
        # The messages of its daemon would name the setting.
        view = CraneView(deployment, lambda _text, _level: None)
        here = InProcessCrane(deployment, self._changes, joysticks=self.joysticks)
        self._cycle_ms = here.cycle_ms
        self.cranes = {CRANE: CraneSession(view, {}, here=here)}

    def other(self, page: int, message: Mapping[str, Any]) -> bool:
        """Take a message of a study (ignored unless the page drives); return whether it is one."""
        word, by, why = (message.get(name) for name in ("study", "by", "why"))
        known = {"begin": True, "grip": by in INPUTS, "broken": why in WHY}
        if not isinstance(word, str) or not known.get(word):
            return False

        def act(cab: Cab, now_s: float) -> None:
            if page != cab.driver:
                return
            if word == "begin":
                self.study.begin(now_s)
            elif word == "grip":
                self.study.grip(CAN if self.joysticks else str(by), now_s)
            else:
                self.study.break_off(str(why), now_s)

        self.with_cab(act)
        return True

    def snapshot(self) -> dict[str, Any]:
        """Return what the page shows; of the axes only the joysticks, to hide the setting."""
        shown = super().snapshot()
        crane = shown["cranes"][CRANE]
        level, why = _urgent(crane["axes"])
        for axis in crane["axes"].values():
            axis.update(dict.fromkeys(axis.keys() - {"joystick"}))
        crane.update(dict.fromkeys(crane.keys() - _SHOWN))
        if self.joysticks:
            shown["enable"] = level in ("ready", "move")
        shown["study"] = self.study.shown(shown["t"]) | {"level": level, "stands": why}
        return shown

    def _tick(self, now_ns: int, missed: int, late_ns: int) -> bool:
        before, now_s = self._driver, time.monotonic()
        goes_on = super()._tick(now_ns, missed, late_ns)
        with self._lock:
            if before not in (None, self._driver) or (self.cab and self.cab.silent):
                self.study.break_off("page", now_s)
            if self.joysticks and self.joysticks.gripped:
                self.joysticks.gripped = False
                self.study.grip(CAN, now_s)
            self._see(now_s)
        if self.study.phase == "done" and not self._over:
            self._over = True
            self._done()
        return goes_on

    def _see(self, now_s: float) -> None:
        values, place = self.cranes[CRANE].view.values(now_s), None
        if values["pose"] and values["measured"]:
            slewed, radius_m, _ = values["pose"]
            out_m, side_m = self._grapple.offset_m(*map(math.radians, values["sway"]))
            turn = cmath.rect(1.0, math.radians(slewed)) * complex(radius_m + out_m, side_m)
            place = turn.real, turn.imag
        self.study.see(_urgent(values["axes"])[0], place, values["swing"], now_s)


def _urgent(axes: Mapping[str, Mapping[str, Any]]) -> tuple[str, str]:
    """Return the most urgent level of all axes, and its reason; none for move and ready."""
    by_level = {one["level"]: one["reason"] for one in axes.values()}
    for level in ("bad", "stop", "move", "wait"):
        if level in by_level:
            return level, "" if level == "move" else by_level[level]
    return ("ready", "") if "ready" in by_level else ("wait", "")


def study_app(
    stage: StudyStage, parameters: CraneParameters, result: Path, access: Access
) -> ASGIApp:
    """Return the page of a study; ``result`` is the page with the person's result, once written."""

    async def shown(_request: HTTPConnection) -> Response:
        return FileResponse(result) if result.exists() else PlainTextResponse("not yet\n", 404)

    about = {"file": result.stem, "study": {"can": stage.joysticks is not None}, "profiles": False}
    hello = hello_of(stage, parameters) | about
    routes = [pages_of(stage, hello), Route("/result.html", shown)]
    return page_app(routes, "main.js", access)
