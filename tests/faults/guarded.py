"""The controller behind the output guard, which must let pass whatever a sound one computes."""

from canshaper.can.deployment import Deployment
from canshaper.can.frame import Frame
from canshaper.service.controller import Controller
from canshaper.service.guarded import Guarded
from tests.faults.judge import Violation


class Unrefused(Controller):
    """The controller; a refusal of the output guard is a violation."""

    def refused(self, frame: Frame) -> Frame:
        raise Violation(f"{self.events[-1].text}, of a sound controller")


def guarded(deployment: Deployment) -> Guarded:
    """As the daemon drives it."""
    return Guarded(Unrefused(deployment))
