"""A controller that continues after a reload, and what it sends."""

from typing import Any

from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from tests.rigs.files import text_of


def reload(rig: Any, *changes: tuple[str, str]) -> None:
    """The controller after a reload of the rig's file, with pieces of it replaced."""
    text = text_of(rig.deployment.path)
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    before, file = rig.controller, rig.deployment.path
    if changes:
        file = file.with_name("changed.yaml")
        file.write_text(text, encoding="utf-8")
    rig.deployment = load_deployment(file)
    before.neutral_frames()
    rig.controller = Controller(rig.deployment)
    rig.controller.carry_over(before)
