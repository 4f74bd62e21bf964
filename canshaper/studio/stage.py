"""The loop behind the page: every 20 ms it sends joysticks and reads frames, in its own thread."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from canshaper.commissioning import control_client as client
from canshaper.commissioning.doctor.processes import before_the_rest
from canshaper.design.lockstep import driven_part
from canshaper.design.processes import Transport, on_transport
from canshaper.errors import ConfigError, ControlError
from canshaper.gate.cycle import run_at_deadlines
from canshaper.machine.deployment import Deployment
from canshaper.studio.cab import Cab
from canshaper.studio.crane import CANSHAPER, Crane, CraneSession
from canshaper.studio.in_process import InProcessCrane
from canshaper.studio.numbers import LiveNumbers, Number, sliders, values
from canshaper.studio.preference import AS_IN_FILE, PREFERENCE, Preference, offered
from canshaper.studio.view import CraneView
from canshaper.studio.words import Events, said
from canshaper_sim.hand import Hand, Held
from canshaper_sim.realtime import open_ports

SHAPED, RAW, MACHINE = "shaped", "raw", "machine"
"""Names of the two simulated cranes, and of the real one that is only listened to."""
WATCH_MS = 20
MS = 1_000_000


class Stage:
    """The cranes behind the page of a machine, their driver's seat and sliders, and the events."""

    def __init__(self, deployment: Deployment) -> None:
        self.deployment = deployment
        self.events = Events()
        self.cranes: dict[str, CraneSession] = {}
        self.cab: Cab | None = None
        self.sliders: dict[str, list[Number]] = {}
        self.positions: dict[str, float] = {}
        self.preference: Preference | None = None
        self.numbers: LiveNumbers | None = None
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
        self._driver: int | None = None
        self._resets: list[threading.Thread] = []

    def watch(self, control: Path | None = None) -> None:
        """Listen to the buses of the deployment as the crane ``MACHINE``; never send on them.

        Args:
            control: control socket of a daemon whose numbers the page may change, or None.

        Raises:
            BusError: a bus cannot be opened.
        """
        if control:
            report = lambda text: self.events.add(MACHINE, text, "warn")  # noqa: E731
            self.numbers = LiveNumbers(self.deployment.path, control, report)
        self.cranes[MACHINE] = CraneSession(self._view(MACHINE), open_ports(self.deployment))

    def drive(
        self,
        transports: Sequence[Transport],
        directory: Path,
        changes: Sequence[str] = (),
        program: Sequence[str] = CANSHAPER,
    ) -> None:
        """Put a simulated crane on each transport: the first shaped, the second without anti-sway.

        Args:
            transports: one or two buses.
            directory: folder for logs and sockets.
            changes: parameters of the cranes, NAME=VALUE.
            program: command that starts the shaped crane's daemon; see ``Crane``.

        Raises:
            BusError: a bus cannot be opened.
        """
        self._seat()
        for name, transport in zip((SHAPED, RAW), transports, strict=False):
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
            ports = open_ports(on_transport(self.deployment, transport))
            seen = CraneSession(self._view(name), ports, hand, crane, shaped=name == SHAPED)
            self.cranes[name] = seen
            if name == SHAPED:
                self._control = crane.control

    def drive_here(self, changes: Sequence[str] = (), crane: str | None = None) -> None:
        """Run both simulated cranes in this process, for systems without a shared bus.

        Args:
            changes: parameters of the cranes, NAME=VALUE.
            crane: name of the only crane to drive; None for all. With a name there are no sliders:
                they would change the numbers of all cranes.

        Raises:
            DriveError: no simulated crane fits the deployment, or none has that name.
        """
        whole = self.deployment
        self.deployment = driven_part(whole, crane)
        self._seat()
        if crane:
            self.sliders, self.positions, self.preference = {}, {}, None
        for name in (SHAPED, RAW):
            here = InProcessCrane(whole, changes, crane, self._reporter(name))
            self._cycle_ms = here.cycle_ms
            self.cranes[name] = CraneSession(self._view(name), {}, shaped=name == SHAPED, here=here)

    def _seat(self) -> None:
        """Make a driver's seat, and the sliders if the file has a control section."""
        self.cab = Cab(self.deployment.axes, lambda text: self.events.add("page", text))
        self.sliders = sliders(self.deployment.config) if self.deployment.config.control else {}
        self.positions = dict.fromkeys(self.sliders, 1.0)
        if self.deployment.config.control and offered(self.deployment.config):
            self.preference = Preference(self.deployment.path)
            self.positions[PREFERENCE] = AS_IN_FILE

    def start(self, failed: Callable[[], None]) -> None:
        """Start the loop in its thread; it calls ``failed`` there if an error ends it."""
        self._failed = failed
        self._thread.start()
        if self.numbers:
            self.numbers.start()

    def stop(self) -> None:
        """End the loop: send neutral joysticks (not after an error), then end daemons and cranes.

        Raises:
            Exception: the error that ended the loop.
        """
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        if self.numbers:
            self.numbers.stop()
        if self.preference:
            self.preference.stop()
        if self._error:
            raise self._error

    # -- for the pages: any thread -------------------------------------------------------------

    def with_cab(self, action: Callable[[Cab, float], None]) -> None:
        """Call ``action`` with the driver's seat and the time; do nothing if there is no seat."""
        if self.cab is not None:
            with self._lock:
                action(self.cab, time.monotonic())

    def other(self, page: int, message: Mapping[str, Any]) -> bool:
        """Return False; a subclass handles messages that only its page sends and returns True."""
        return False

    def slide(self, name: str, factor: float) -> None:
        """Change numbers (or filters: ``PREFERENCE``) of the shaped crane, and wait for its answer.

        Raises:
            ValueError: there is no such slider, or the factor is not allowed.
            ControlError: the daemon refuses or does not run.
            ConfigError: the file with other filters cannot be written.
        """
        if name == PREFERENCE and self.preference:
            self._prefer(self.preference, factor)
            return
        changed = values(self.sliders, name, factor)
        here = self.cranes[SHAPED].here
        with self._control_lock:
            if here:
                with self._lock:
                    here.change(changed)
            else:
                assert self._control is not None
                client.change(self._control, changed)
            self.positions[name] = factor
        self.events.add(SHAPED, ", ".join(f"{key} = {v:.4g}" for key, v in changed.items()))

    def _prefer(self, preference: Preference, position: float) -> None:
        """Write filters into the daemon's file and let it reload; put the other sliders to 1."""
        shaped = self.cranes[SHAPED]
        with self._control_lock:
            self.deployment = preference.write(position)
            if shaped.here:
                with self._lock:
                    shaped.here.reload(self.deployment)
            elif shaped.crane:
                shaped.crane.reload()
            self.positions = {**dict.fromkeys(self.sliders, 1.0), PREFERENCE: position}
        self.events.add(SHAPED, said("filters"))

    def in_force(self) -> dict[str, float]:
        """Return the numbers that the page can change, by key, as the daemon has them now."""
        if self.numbers:
            return self.numbers.in_force()
        values_by_key: dict[str, float] = {}
        for name in self.sliders:
            values_by_key |= values(self.sliders, name, self.positions[name])
        return values_by_key

    def _reset_sliders(self) -> None:
        """Put every slider back to the file's numbers, for the next driver."""
        for name, factor in list(self.positions.items()):
            rest = AS_IN_FILE if name == PREFERENCE else 1.0
            if factor != rest:
                try:
                    self.slide(name, rest)
                except ControlError:
                    pass  # a new daemon has the file's numbers
                except ConfigError as error:
                    self.events.add(MACHINE, str(error), "warn")

    def snapshot(self) -> dict[str, Any]:
        """Return what a page shows now: time ``t`` in s, seat, slider positions, cranes by name."""
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
            for seen in self.cranes.values():  # the last thing on the buses: neutral, enable off
                seen.move_joysticks(0, Held())
        except Exception as error:
            self._error = error
            self._failed()
        finally:
            for reset in self._resets:
                reset.join()
            for seen in self.cranes.values():
                if seen.crane:
                    seen.crane.stop()
            for seen in self.cranes.values():
                for port in seen.ports.values():
                    port.close()

    def _tick(self, _now_ns: int, missed: int, _late_ns: int) -> bool:
        now_s = time.monotonic()
        passed_ms = (1 + missed) * self._cycle_ms
        self._time_ms += passed_ms
        with self._lock:
            held = self.cab.held(now_s) if self.cab else Held()
            driver = self.cab.driver if self.cab else None
            for seen in self.cranes.values():
                seen.exchange(self._time_ms, held, now_s, passed_ms)
        if self._driver not in (None, driver):
            # The daemon's answer may take longer than a tick.
            self._resets = [one for one in self._resets if one.is_alive()]
            self._resets.append(threading.Thread(target=self._reset_sliders, name="sliders"))
            self._resets[-1].start()
        self._driver = driver
        for seen in self.cranes.values():
            if seen.crane:
                seen.crane.check(now_s)
                if (late := seen.crane.late_us()) is not None:
                    seen.view.report_lateness(late)
                if seen.shaped and seen.crane.starts != self._starts:
                    self._starts = seen.crane.starts
                    self.positions |= dict.fromkeys(self.sliders, 1.0)  # it has the file's numbers
        return not self._stop.is_set()

    def _view(self, name: str) -> CraneView:
        return CraneView(self.deployment, self._reporter(name))

    def _reporter(self, name: str) -> Callable[[str, str], None]:
        return lambda text, level: self.events.add(name, text, level)
