"""A finding for people: a table next to what the file has."""

import math
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from canshaper.commissioning.identification.canlog import is_simulated
from canshaper.commissioning.identification.series import Value
from canshaper.commissioning.sensor.finding import Finding, changes
from canshaper.edit.edit import Change, FileValue, change, note, written_by
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.report.console import axis_title, new_table


def heading(finding: Finding) -> str:
    """Return a heading: what was examined, and whether the data is enough."""
    text = f"{axis_title(finding.axis)}, {finding.series.source}"
    if finding.fit is None:
        return f"{text}: nothing found"
    driven = len(finding.data)
    explained = 100.0 * max(0.0, finding.fit.explained(math.radians(finding.noise)))
    text += f": {driven} driven stretch{'es' * (driven != 1)}, {explained:.0f} % explained"
    return f"{text} (not enough data)" if finding.problems else text


def table(axis: BoundAxis, finding: Finding) -> Table:
    """Return a table of the finding next to the values of the file."""
    assert axis.sway_sensor
    assert axis.config.sway
    config, sway = axis.sway_sensor.config, axis.config.sway
    rate = finding.unit == "degrees/s"
    unit = "deg/s" if rate else "deg"
    rows = new_table("", "file", "found")
    inverted = {False: "as the model", True: "inverted"}
    rows.add_row("sign", inverted[config.invert], inverted[finding.invert])
    rows.add_row("delay, ms", f"{config.delay_ms:g}", _shown(finding.delay_s, 1000.0, 0))
    rows.add_row(f"offset, {unit}", f"up to {config.offset_max_deg:g}", _shown(finding.offset))
    rows.add_row(f"noise, {unit}", f"{config.noise:g}", f"{finding.noise:.2g}")
    rows.add_row("period, s", f"{sway.mode().period_s:.2f}", _shown(finding.period_s))
    rows.add_row("full speed, m/s", f"{sway.full_speed_m_s:g}", _shown(finding.size_m_s))
    return rows


def _shown(value: Value, factor: float = 1.0, digits: int = 2) -> str:
    number, half = factor * value.value, factor * value.half
    least = 10.0**-digits
    return f"{number:.{digits}f} ± {max(half, least):.{digits}f}"


def write_sensors(
    deployment: Deployment, findings: Sequence[Finding], log: Path | None, *, live: bool
) -> list[str]:
    """Write the results for each sensor, and where from; the lines that have changed.

    Args:
        deployment: the machine.
        findings: of its sensors; those with problems are left out.
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
    written: list[Change] = []
    for finding in findings:
        if not finding.problems:
            place = ("axes", finding.axis, "sway_sensor")
            values: dict[str, FileValue] = {**changes(deployment.axes[finding.axis], finding)}
            values["origin"] = origin
            written.append((place, values, note("sensor")))
    return change(deployment.path, written) if written else []
