"""Reports of the daemon: lines of the log, and the status line of the service manager."""

import logging
from collections.abc import Callable, Mapping
from typing import Any

from canshaper.bus.port import Port
from canshaper.codec.frame import BusState, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.daemon.notify import ServiceManager
from canshaper.gate.cycle import boottime_ns
from canshaper.machine.filters import unfit
from canshaper.shaping.states import State

log = logging.getLogger("canshaper")

SECOND_NS = 1_000_000_000
# Most lines on one bus in a second.
MOST_BUS_LINES = 4


class Reporter:
    """Logs changes after every tick, and renews the status line once a second.

    Args:
        manager: service manager, which shows the status line.
    """

    def __init__(self, manager: ServiceManager) -> None:
        self._manager = manager
        self._logged_fault = FrameFault.NONE
        self._log_again_ns = 0
        self._status_ns = 0
        self._latest_ns = 0
        self._bus_lines_ns = 0

    def use(self, controller: Controller, ports: Mapping[str, Port]) -> None:
        """Report on this controller and these ports from now on."""
        self._controller = controller
        self._ports = ports
        self._bus_states = dict.fromkeys(ports, BusState.UP)
        self._waited = {name: port.waited for name, port in ports.items()}
        self._bus_lines = dict.fromkeys(ports, 0)

    def events(self) -> None:
        """Log the events of this tick."""
        for event in self._controller.events:
            tripped = isinstance(event, StateEvent) and event.transition.new is State.TRIPPED
            log.log(logging.WARNING if tripped else logging.INFO, "%s", event.text)

    def buses(self, now_ns: int) -> None:
        """Log every bus whose state changed, at most ``MOST_BUS_LINES`` a second for each bus."""
        if now_ns >= self._bus_lines_ns:
            self._bus_lines_ns = now_ns + SECOND_NS
            self._bus_lines = dict.fromkeys(self._bus_lines, 0)
        for name, port in self._ports.items():
            state = port.state
            if state is not self._bus_states[name] and self._bus_lines[name] < MOST_BUS_LINES:
                self._bus_states[name] = state
                self._bus_lines[name] += 1
                level = logging.INFO if state is BusState.UP else logging.WARNING
                why = f" why={port.why}" if port.why else ""
                log.log(level, "bus=%s state=%s%s", name, state.value, why)

    def faults(self, now_ns: int) -> None:
        """Log the last fault counted if it is not the last one logged, one a second at most."""
        counters = self._controller.counters
        fault = counters.last_fault
        if fault is not self._logged_fault and now_ns >= self._log_again_ns:
            self._logged_fault = fault
            if fault is not FrameFault.NONE:  # after a reload the counters have no fault
                self._log_again_ns = now_ns + SECOND_NS  # alternating faults must not flood the log
                log.warning("fault=%s counts=%s", fault.name, counters.values)

    def late(self, late_ns: int) -> None:
        """Note the lateness of a tick; the status line shows the largest one."""
        self._latest_ns = max(self._latest_ns, late_ns)

    def status(self, now_ns: int, trouble: Callable[[], list[str]]) -> bool:
        """Renew the status line once a second, log news of the buses; return whether it was time.

        Args:
            now_ns: time of the tick.
            trouble: returns the entries that stand first in the line; called when it is time.
        """
        if now_ns < self._status_ns:
            return False
        self._status_ns = now_ns + SECOND_NS
        for name, port in self._ports.items():
            if port.waited != self._waited[name]:
                self._waited[name] = port.waited
                log.warning("bus=%s waited=%d: valve frames, in a queue", name, port.waited)
            if news := port.look():
                log.warning("bus=%s %s", name, news)
        self._manager.status(self._summary(trouble()))
        self._latest_ns = 0
        return True

    def hold_status(self) -> None:
        """Leave the status line unchanged for a second."""
        self._status_ns = boottime_ns() + SECOND_NS

    def numbers(self) -> dict[str, Any]:
        """Return axes (values: parts of full speed), buses, counters, lateness (s) for a client."""
        controller = self._controller
        return {
            "digest": controller.deployment.identity.digest,
            "axes": {
                name: {
                    "state": one.axis.state.name,
                    "reason": one.reason.name,
                    "joystick": one.axis.demand,
                    "setpoint": one.axis.output.setpoint,
                    "sway_deg": one.sway_deg,
                    "set": one.active_set,
                }
                for name, one in controller.axes.items()
            },
            "buses": {name: state.value for name, state in self._bus_states.items()},
            "counters": dict(controller.counters.values),
            "late_s": self._latest_ns / 1e9,
        }

    def refused(self, why: str) -> None:
        """Log why a reload is refused, line by line; the status line shows the first for 1 s."""
        lines = why.splitlines()
        for line in lines:
            log.error("reload=refused %s", line)
        self._manager.status(f"reload refused: {lines[0]}")
        self.hold_status()

    def identity(self) -> None:
        """Log the hashes of program and deployment, warnings of DBC files, and unfit filters."""
        deployment = self._controller.deployment
        for line in deployment.identity.lines():
            log.info("identity %s", line)
        if count := deployment.messages.warnings()[0]:
            text = "of messages and tables in the DBC files that are not used"
            text += "; canshaper check shows them"
            log.warning("dbc-warnings=%d %s", count, text)
        for place, fault in unfit(deployment.config):
            log.warning("unfit=%s %s", ".".join(str(part) for part in place), fault)

    def _summary(self, trouble: list[str]) -> str:
        """Return the status line: ``trouble``, axes, buses, lateness (us), missed deadlines."""
        axes = [f"{n} {r.axis.state.name}" for n, r in self._controller.axes.items()]
        buses = [f"{n} {state.value}" for n, state in self._bus_states.items()]
        late = f"late {self._latest_ns / 1000:.0f} us"
        missed = self._controller.counters.values["MissedDeadlines"]
        first = ["listen-only"] if self._controller.deployment.listen_only else []
        return ", ".join([*trouble, *first, *axes, *buses, late, f"missed {missed}"])


def flush() -> None:
    """Let the handlers of the log write the lines that they hold."""
    for handler in logging.getLogger().handlers:
        handler.flush()
