"""State of a daemon as metrics of Prometheus: every scrape asks the control socket again."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from canshaper import __version__
from canshaper.codec.frame import BusState
from canshaper.commissioning import control_client as client
from canshaper.errors import ControlError
from canshaper.shaping.states import State

# Metrics of an axis: name with unit, help text, and how to read it from the daemon's answer.
_OF_AN_AXIS: tuple[tuple[str, str, Callable[[Mapping[str, Any]], float]], ...] = (
    ("joystick_ratio", "What the operator asks for, -1 to 1.", lambda one: one["joystick"]),
    ("setpoint_ratio", "Velocity that the valve is sent, -1 to 1.", lambda one: one["setpoint"]),
    ("sway_degrees", "Swing that the model predicts.", lambda one: one["sway_deg"]),
    ("parameter_set", "Number of the parameter set in force.", lambda one: one["set"]),
)


class DaemonCollector(Collector):
    """Metrics of the daemon at a control socket; only ``canshaper_up`` where none answers."""

    def __init__(self, control: Path) -> None:
        self._control = control

    def collect(self) -> Iterator[Metric]:
        """Ask, and yield every metric."""
        up = GaugeMetricFamily("canshaper_up", "Whether the daemon answers on its control socket.")
        try:
            now: Mapping[str, Any] = client.status(self._control)
        except ControlError:
            now = {}
        up.add_metric((), float(bool(now)))
        yield up
        if now:
            yield from _metrics(now)


def registry_of(control: Path) -> CollectorRegistry:
    """Return what an endpoint serves: the metrics of this daemon, and none of its own process."""
    registry = CollectorRegistry()
    registry.register(DaemonCollector(control))
    return registry


def _metrics(now: Mapping[str, Any]) -> Iterator[Metric]:
    build = InfoMetricFamily("canshaper_build", "Version of this program, digest of what runs.")
    build.add_metric((), {"version": __version__, "digest": f"{now['digest']:#06x}"})
    yield build
    axes = now["axes"].items()
    states = {name: one["state"] for name, one in axes}
    yield _states("axis", "State of an axis, 1 for the one.", states, [one.name for one in State])
    reason = GaugeMetricFamily(
        "canshaper_axis_reason", "Why an axis is in its state, always 1.", labels=("axis", "reason")
    )
    for name, one in axes:
        reason.add_metric((name, one["reason"]), 1.0)
    yield reason
    for key, words, value in _OF_AN_AXIS:
        gauge = GaugeMetricFamily(f"canshaper_axis_{key}", words, labels=("axis",))
        for name, one in axes:
            gauge.add_metric((name,), value(one))
        yield gauge
    buses = [str(one.value) for one in BusState]
    yield _states("bus", "State of a bus, 1 for the one.", now["buses"], buses)
    faults = CounterMetricFamily(
        "canshaper_faults", "Faults since the daemon began, by kind.", labels=("kind",)
    )
    for name, count in now["counters"].items():
        faults.add_metric((re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower(),), count)
    yield faults
    late = "Largest lateness of a tick since the last full second."
    yield GaugeMetricFamily("canshaper_tick_lateness_seconds", late, now["late_s"])


def _states(
    what: str, words: str, now: Mapping[str, str], possible: Iterable[str]
) -> GaugeMetricFamily:
    """Return a series for each name and possible state: 1 for its state now, else 0."""
    gauge = GaugeMetricFamily(f"canshaper_{what}_state", words, labels=(what, "state"))
    for state in possible:
        for name, state_now in now.items():
            gauge.add_metric((name, state), float(state == state_now))
    return gauge
