"""Reports of the daemon: the journal, and the service manager's line."""

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
# Lines of one bus in a second at most.
MOST_BUS_LINES = 4


class Reporter:
    """Says what changed: after every tick, and once a second in one line.

    Args:
        manager: the service manager, which shows the line.
    """

    def __init__(self, manager: ServiceManager) -> None:
        self._manager = manager
        self._logged_fault = FrameFault.NONE
        self._log_again_ns = 0
        self._status_ns = 0
        self._latest_ns = 0
        self._bus_lines_ns = 0

    def use(self, controller: Controller, ports: Mapping[str, Port]) -> None:
        """Report of these from now on."""
        self._controller = controller
        self._ports = ports
        self._bus_states = dict.fromkeys(ports, BusState.UP)
        self._waited = {name: port.waited for name, port in ports.items()}
        self._bus_lines = dict.fromkeys(ports, 0)

    def events(self) -> None:
        """Log what the axes said in this tick."""
        for event in self._controller.events:
            tripped = isinstance(event, StateEvent) and event.transition.new is State.TRIPPED
            log.log(logging.WARNING if tripped else logging.INFO, "%s", event.text)

    def buses(self, now_ns: int) -> None:
        """Log every bus whose state changed; of one that changes all the time now and then one."""
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
        """Log the fault of a frame when it is another one, at most one a second."""
        counters = self._controller.counters
        fault = counters.last_fault
        if fault is not self._logged_fault and now_ns >= self._log_again_ns:
            self._logged_fault = fault
            if fault is not FrameFault.NONE:  # the counters of a reload begin without a fault
                self._log_again_ns = now_ns + SECOND_NS  # two faults in turn must not flood the log
                log.warning("fault=%s counts=%s", fault.name, counters.values)

    def late(self, late_ns: int) -> None:
        """Take the lateness of a tick."""
        self._latest_ns = max(self._latest_ns, late_ns)

    def status(self, now_ns: int, trouble: Callable[[], list[str]]) -> bool:
        """Renew the service manager's line once a second; whether it was time.

        Args:
            now_ns: time of the tick.
            trouble: makes the entries that stand first in it, when it is time.
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
        """Leave what the service manager shows for a second."""
        self._status_ns = boottime_ns() + SECOND_NS

    def numbers(self) -> dict[str, Any]:
        """Return state, counters and lateness, as plain data for a program that watches."""
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
        """Log why a reload changes nothing."""
        lines = why.splitlines()
        for line in lines:
            log.error("reload=refused %s", line)
        self._manager.status(f"reload refused: {lines[0]}")
        self.hold_status()

    def identity(self) -> None:
        """Log the hashes of what runs: a machine that was signed off is compared with these."""
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
        """Axes, buses, lateness of the last second, deadlines missed."""
        axes = [f"{n} {r.axis.state.name}" for n, r in self._controller.axes.items()]
        buses = [f"{n} {state.value}" for n, state in self._bus_states.items()]
        late = f"late {self._latest_ns / 1000:.0f} us"
        missed = self._controller.counters.values["MissedDeadlines"]
        first = ["listen-only"] if self._controller.deployment.listen_only else []
        return ", ".join([*trouble, *first, *axes, *buses, late, f"missed {missed}"])


def flush() -> None:
    """Write out what the journal's handlers hold."""
    for handler in logging.getLogger().handlers:
        handler.flush()
