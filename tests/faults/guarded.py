"""The controller behind the gate, which must let pass whatever a sound one computes."""

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.machine.deployment import Deployment
from tests.faults.judge import Violation


class Unrefused(Controller):
    """The controller; a refusal of the gate is a violation."""

    def refused(self, frame: Frame) -> Frame:
        raise Violation(f"{self.events[-1].text}, of a sound controller")


def guarded(deployment: Deployment) -> Guarded:
    """As the daemon drives it."""
    return Guarded(Unrefused(deployment))
