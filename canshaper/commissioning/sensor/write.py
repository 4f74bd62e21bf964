"""The results for sway sensors, into the deployment file."""

from collections.abc import Sequence
from pathlib import Path

from canshaper.commissioning.filter_file import write_section
from canshaper.commissioning.identification.simulated_log import is_simulated
from canshaper.commissioning.sensor.finding import Finding, changes
from canshaper.config.origin import note, written_by
from canshaper.edit.flow import Value
from canshaper.machine.deployment import Deployment


def write_sensors(
    deployment: Deployment, findings: Sequence[Finding], log: Path | None, *, live: bool
) -> list[str]:
    """Write the results for each sensor, and where from; the lines that have changed.

    Args:
        deployment: the machine.
        findings: of its sensors; poor ones are left out.
        log: the log that they are from, where a person recorded it.
        live: whether the buses were listened to.

    Raises:
        ConfigError: the file cannot be changed.
    """
    if log:
        simulated = is_simulated(log, deployment.messages)
    else:
        simulated = not live or any(bus.is_virtual for bus in deployment.config.buses.values())
    origin = written_by("sensor", simulated=simulated, log=log.name if log else None)
    lines = []
    for finding in findings:
        if not finding.poor:
            place = ("axes", finding.axis, "sway_sensor")
            values: dict[str, Value] = {**changes(deployment.axes[finding.axis], finding)}
            values["origin"] = origin
            lines += write_section(deployment.path, place, values, note("sensor"))
    return lines
