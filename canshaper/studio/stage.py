"""The loop behind the page: joysticks out, frames in, every 20 ms in a thread of its own."""

import contextlib
import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from canshaper.bus.port import Port
from canshaper.codec.frame import Frame
from canshaper.commissioning.doctor.processes import JOYSTICKS_PRIORITY
from canshaper.daemon import control_client as client
from canshaper.daemon.loop import run_at_deadlines
from canshaper.design.processes import Transport, on_transport
from canshaper.machine.deployment import Deployment
from canshaper.studio.cab import Cab
from canshaper.studio.crane import CANSHAPER, Crane
from canshaper.studio.events import Events
from canshaper.studio.sliders import Number, sliders, values
from canshaper.studio.view import CraneView
from canshaper_sim.hand import Hand, Held
from canshaper_sim.realtime import open_ports

SHAPED, RAW, MACHINE = "shaped", "raw", "machine"
"""The two simulated cranes, and the real one that is only listened to."""
WATCH_MS = 20
MS = 1_000_000


def before_the_rest() -> None:
    """Let this thread come after the daemon and before all else, where that is permitted.

    A browser that draws without a graphics card takes every processor, and joysticks that are late
    are a fault. What is started from here does not inherit it.
    """
    with contextlib.suppress(OSError):
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(JOYSTICKS_PRIORITY))


@dataclass
class Seen:
    """A crane that is listened to; ``hand`` where the page drives it."""

    view: CraneView
    ports: Mapping[str, Port]
    hand: Hand | None = None
    crane: Crane | None = None
    shaped: bool = True


class Stage:
    """Everything behind the page.

    Args:
        deployment: the machine.
        events: where to report what happens.
    """

    def __init__(self, deployment: Deployment, events: Events) -> None:
        self.deployment = deployment
        self.events = events
        self.cranes: dict[str, Seen] = {}
        self.cab: Cab | None = None
        self.sliders: dict[str, list[Number]] = {}
        self.positions: dict[str, float] = {}
        self._control: Path | None = None
        self._starts = 0
        self._lock = threading.Lock()
        self._control_lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="stage")
        self._error: Exception | None = None
        self._failed: Callable[[], None] = lambda: None
        self._time_ms = 0
        self._cycle_ms = WATCH_MS

    def watch(self) -> None:
        """Listen to the buses of the deployment; nothing is ever sent.

        Raises:
            BusError: a bus cannot be opened.
        """
        self.cranes[MACHINE] = Seen(self._view(MACHINE), open_ports(self.deployment))

    def drive(
        self,
        transports: Sequence[Transport],
        directory: Path,
        changes: Sequence[str] = (),
        program: Sequence[str] = CANSHAPER,
    ) -> None:
        """Put a simulated crane on each transport, the first one shaped, the second one raw.

        Args:
            transports: one or two buses.
            directory: for logs and sockets.
            changes: parameters of the cranes, NAME=VALUE.
            program: how the shaped crane's daemon is started; see ``Crane``.

        Raises:
            BusError: a bus cannot be opened.
        """
        self.cab = Cab(self.deployment.axes, lambda text: self.events.add("page", text))
        self.sliders = sliders(self.deployment.config) if self.deployment.config.control else {}
        self.positions = dict.fromkeys(self.sliders, 1.0)
        for name, transport in zip((SHAPED, RAW), transports, strict=False):
            deployment = on_transport(self.deployment, transport)
            view = self._view(name)
            crane = Crane(
                name,
                self.deployment.path,
                transport,
                directory,
                report=self._reporter(name),
                changes=changes,
                program=program if name == SHAPED else CANSHAPER,
            )
            hand = Hand(self.deployment)
            self._cycle_ms = hand.cycle_ms
            seen = Seen(view, open_ports(deployment), hand, crane, shaped=name == SHAPED)
            self.cranes[name] = seen
            if name == SHAPED:
                self._control = crane.control

    def start(self, failed: Callable[[], None]) -> None:
        """Begin.

        Args:
            failed: called when the loop has ended by itself, which only an error of ours does.
        """
        self._failed = failed
        self._thread.start()

    def stop(self) -> None:
        """End: joysticks in neutral, then daemons, cranes and buses.

        Raises:
            Exception: the error that has ended the loop.
        """
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._error:
            raise self._error

    # -- for the pages: any thread -------------------------------------------------------------

    def with_cab(self, action: Callable[[Cab, float], None]) -> None:
        """Do something with the driver's seat; nothing where there is none."""
        if self.cab is not None:
            with self._lock:
                action(self.cab, time.monotonic())

    def slide(self, name: str, factor: float) -> None:
        """Move a slider: change the numbers of the shaped crane's daemon. Waits for its answer.

        Raises:
            ValueError: no such slider, or a factor that is not allowed.
            ControlError: the daemon refuses, or there is none.
        """
        changed = values(self.sliders, name, factor)
        assert self._control is not None
        with self._control_lock:
            client.change(self._control, changed)
            self.positions[name] = factor
        self.events.add(SHAPED, ", ".join(f"{key} = {v:.4g}" for key, v in changed.items()))

    def snapshot(self) -> dict[str, Any]:
        """What a page shows now."""
        now_s = time.monotonic()
        with self._lock:
            cab = self.cab
            return {
                "t": round(now_s, 4),
                "driver": cab.driver if cab else None,
                "enable": cab.enable if cab else False,
                "antisway": cab.anti_sway if cab else True,
                "sliders": dict(self.positions),
                "cranes": {name: one.view.values(now_s) for name, one in self.cranes.items()},
            }

    # -- the loop ------------------------------------------------------------------------------

    def _run(self) -> None:
        before_the_rest()
        try:
            run_at_deadlines(self._cycle_ms * MS, self._tick)
            self._rest()
        except Exception as error:
            self._error = error
            self._failed()
        finally:
            for seen in self.cranes.values():
                if seen.crane:
                    seen.crane.stop()
            for seen in self.cranes.values():
                for port in seen.ports.values():
                    port.close()

    def _tick(self, _now_ns: int, missed: int, _late_ns: int) -> bool:
        now_s = time.monotonic()
        self._time_ms += (1 + missed) * self._cycle_ms
        with self._lock:
            held = self.cab.held(now_s) if self.cab else Held()
            for seen in self.cranes.values():
                self._exchange(seen, held, now_s)
        for seen in self.cranes.values():
            if seen.crane:
                seen.crane.check(now_s)
                late = seen.crane.late_us()
                if late is not None:
                    seen.view.report_lateness(late)
                if seen.shaped and seen.crane.starts != self._starts:
                    self._starts = seen.crane.starts
                    self.positions = dict.fromkeys(self.sliders, 1.0)  # it has those of the file
        return not self._stop.is_set()

    def _exchange(self, seen: Seen, held: Held, now_s: float) -> None:
        """Take what waits on the buses of a crane; where the page drives it, move its joysticks."""
        frames: list[Frame] = []
        for port in seen.ports.values():
            frames += port.frames()
        if seen.hand:
            asked = held if seen.shaped else replace(held, anti_sway=False)
            for frame in seen.hand.frames(self._time_ms, asked):
                seen.ports[frame.bus].send(frame)
                frames.append(frame)
        for frame in frames:
            seen.view.receive(frame, now_s)
        seen.view.check(now_s)

    def _rest(self) -> None:
        """The last thing on the buses: joysticks in neutral, enable off."""
        for seen in self.cranes.values():
            if seen.hand:
                for frame in seen.hand.frames(0, Held()):
                    seen.ports[frame.bus].send(frame)

    # -- parts ---------------------------------------------------------------------------------

    def _view(self, name: str) -> CraneView:
        return CraneView(self.deployment, self._reporter(name))

    def _reporter(self, name: str) -> Callable[[str, str], None]:
        return lambda text, level: self.events.add(name, text, level)
