"""The deployment without its filters: what a machine does by itself, through the same limits."""

import shutil
from pathlib import Path
from typing import Any

from canshaper.edit.edit import set_values
from canshaper.machine.deployment import Deployment


def write_without_filters(deployment: Deployment, path: Path) -> None:
    """Write a copy of the deployment file whose joysticks go to the valves through limits alone.

    Args:
        deployment: the machine.
        path: the copy, in the same folder.

    Raises:
        ConfigError: it is no good deployment without them.
    """
    shutil.copyfile(deployment.path, path)
    if deployment.config.motion:
        set_values(path, (), {"motion": None})
    for name, joystick in deployment.config.joysticks.items():
        if joystick.next_profile:
            set_values(path, ("joysticks", name), {"next_profile": None})
    for name, axis in deployment.config.axes.items():
        if axis.sway_sensor and axis.sway_sensor.use != "watch":
            set_values(path, ("axes", name, "sway_sensor"), {"use": "watch"})
        added = [key for key in ("profiles", "gain_schedule") if getattr(axis, key)]
        if added:
            set_values(path, ("axes", name), dict.fromkeys(added))
        if axis.filter.kind != "off":
            gone: dict[str, Any] = dict.fromkeys(axis.filter.model_dump(exclude_none=True))
            set_values(path, ("axes", name, "filter"), gone | {"kind": "off"})
