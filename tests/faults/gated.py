"""The controller behind the gate, which must let pass whatever a sound one computes."""

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.deployment import Deployment
from tests.faults.judge import Violation


class Unrefused(Controller):
    """The controller; a refusal of the gate is a violation."""

    def refused(self, frame: Frame) -> Frame:
        raise Violation(f"{self.events[-1].text}, of a sound controller")


def gated(deployment: Deployment) -> GatedController:
    """As the daemon drives it."""
    return GatedController(Unrefused(deployment))
