"""The sway sensors of a deployment in a log, with the commands of their axes."""

from collections.abc import Sequence
from pathlib import Path

from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.series import Series
from canshaper.machine.deployment import Deployment


def read_sensors(path: Path, deployment: Deployment, axes: Sequence[str]) -> dict[str, Series]:
    """What the sensors of some axes measured.

    Raises:
        IdentificationError: a sensor is not in the log, or from two senders.
        LogError: the log cannot be read.
    """
    sensors = {name: s for name in axes if (s := deployment.axes[name].sway_sensor)}
    return read_can(
        path,
        "",
        {name: one.name for name, one in sensors.items()},
        deployment.messages,
        deployment=deployment,
        sources={name: one.config.source for name, one in sensors.items()},
    )
