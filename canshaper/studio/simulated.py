"""The simulated crane behind valve frames that were sent to another one, or to none."""

import math

from canshaper.machine.deployment import Deployment
from canshaper.studio.view import CraneView
from canshaper_sim.axes import ROTATOR
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joints import JointBoom
from canshaper_sim.machines import AXES_OF, build_machine, machine_for


class SimulatedPose:
    """Pose and sway where the buses have none: what the simulated crane does with the valve frames.

    It stands in its start pose at first, wherever the machine stood.

    Args:
        view: its valve frames are read from here, pose and sway are written into it.
        deployment: whose axes they are.
        parameters: the crane.
    """

    def __init__(
        self, view: CraneView, deployment: Deployment, parameters: CraneParameters
    ) -> None:
        self._view = view
        self._axes = [name for name in deployment.axes if name != ROTATOR]
        self._machine = build_machine(machine_for(deployment.axes), parameters)

    @staticmethod
    def fits(deployment: Deployment) -> bool:
        """Whether the simulated crane has the axes of a deployment."""
        axes = deployment.axes.keys() - {ROTATOR}
        return axes <= {*AXES_OF[machine_for(deployment.axes)]}

    def advance(self, dt_s: float, now_s: float) -> None:
        """Hold the last valve commands for so long."""
        view, crane = self._view, self._machine.crane
        self._machine.step(dt_s, {name: view.axes[name].opening for name in self._axes})
        state = crane.state
        heading = math.degrees(math.remainder(state.theta1_rad, 2.0 * math.pi))
        joints = None
        if isinstance(crane.boom, JointBoom):
            _, lift, knuckle, extension = crane.boom.joints
            joints = (math.degrees(lift), math.degrees(knuckle), extension)
        sway = (math.degrees(state.theta5_rad), math.degrees(state.theta6_rad))
        view.simulate((heading, state.radius_m, state.height_m), joints, sway, now_s)
