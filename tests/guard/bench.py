"""The output guard alone: joystick frames in, one command of one axis in every tick."""

from dataclasses import replace
from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.guard.output import OutputGuard
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped

TICK_NS = 20_000_000
# timeout_ms, the longest standstill and three periods
LATE_NS = (100 + 100 + 60) * 1_000_000
signs = pytest.mark.parametrize("sign", [1, -1])


def limited(deployment: Deployment, axis: str, **limits: Any) -> Deployment:
    """The deployment with other limits of an axis."""
    bound = deployment.axes[axis]
    changed = bound.config.limits.model_copy(update=limits)
    config = bound.config.model_copy(update={"limits": changed})
    return replace(deployment, axes={**deployment.axes, axis: replace(bound, config=config)})


class Bench:
    """The guard of a deployment, and what an axis of it is sent."""

    def __init__(self, deployment: Deployment, axis: str) -> None:
        self.deployment = deployment
        self.guard, self.hand = OutputGuard(deployment), Hand(deployment)
        self.valve = deployment.axes[axis].valve
        self.sender = self.valve.message.sender()
        self.tick_ms = deployment.config.tick_ms
        self.number = 0

    @property
    def now_ns(self) -> int:
        return self.number * self.tick_ms * 1_000_000

    def joysticks(self, *, enable: bool = True, **joysticks: float) -> list[Frame]:
        """Their frames of this tick."""
        return self.hand.frames(self.number * self.tick_ms, Held(joysticks, enable=enable))

    def receive(self, frames: list[Frame]) -> None:
        """The guard receives them."""
        for frame in frames:
            self.guard.inputs[frame[:3]].note(frame.data, self.now_ns)

    def sent(self, steps: int, missed: int = 0, cut: int = 0) -> str:
        """The command of this tick; why it may not leave.

        Args:
            steps: the command.
            missed: so many deadlines were missed before it.
            cut: so many bytes are missing at its end.
        """
        self.guard.begin(missed)
        self.valve.put(self.sender.raw, steps)
        frame = self.sender.frame()
        self.valve.put(self.sender.raw, 0)
        valve, data = self.guard.valves[frame[:3]], frame.data[: len(frame.data) - cut]
        why = valve.refusal(data, data[valve.span], self.now_ns, self.guard.at)
        self.number += 1
        return why

    def sends(self, steps: int, missed: int = 0, **joysticks: float) -> str:
        """A tick with joysticks and command; why that may not leave."""
        self.number += missed
        self.receive(self.joysticks(**joysticks))
        return self.sent(steps, missed)

    def waits(self, ticks: int) -> None:
        """So many ticks of the loop in which the axis is not due."""
        for _ in range(ticks):
            self.guard.begin(0)
            self.number += 1

    def ramp(self, steps: int, **joysticks: float) -> None:
        """Up to there by less than the rates, and on for a while."""
        sign = 1 if steps > 0 else -1
        for size in [*range(10, abs(steps), 10), *[abs(steps)] * 10]:
            assert not self.sends(sign * size, **joysticks)


def bench(**limits: Any) -> Bench:
    """The forwarder with other limits of near-far, which without them are no limits."""
    free = {"deadband_pct": 0.0, "rise_per_s": 100.0, "fall_per_s": 100.0}
    deployment = load_deployment(shipped.CONFIG / "forwarder.yaml")
    return Bench(limited(deployment, "near_far", **(free | limits)), "near_far")
