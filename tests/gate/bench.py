"""The gate alone: frames of joysticks in, one command of one axis in every tick."""

from dataclasses import replace
from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.gate.build import record_of
from canshaper.gate.gate import Gate
from canshaper.machine.deployment import Deployment
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped
from tests.rigs.files import read

signs = pytest.mark.parametrize("sign", [1, -1])


def limited(deployment: Deployment, axis: str, **limits: Any) -> Deployment:
    """The deployment with other limits of an axis."""
    bound = deployment.axes[axis]
    changed = bound.config.limits.model_copy(update=limits)
    config = bound.config.model_copy(update={"limits": changed})
    return replace(deployment, axes={**deployment.axes, axis: replace(bound, config=config)})


class Bench:
    """The gate of a deployment, and what an axis of it is sent.

    Attributes:
        change: what becomes of a frame before the gate receives it.
    """

    def __init__(self, deployment: Deployment, axis: str) -> None:
        self.deployment = deployment
        self.gate, self.hand = Gate(record_of(deployment)), Hand(deployment)
        self.valve = deployment.axes[axis].valve
        self.sender = self.valve.message.sender()
        self.key = self.sender.key
        self.axis = self.gate.axes[axis]
        self.tick_ms = deployment.config.tick_ms
        self.number = 0
        self.change: Any = lambda frame: frame

    @property
    def now_ns(self) -> int:
        return self.number * self.tick_ms * 1_000_000

    def joysticks(
        self, *, enable: bool = True, reset: bool = False, anti_sway: bool = True, **at: float
    ) -> list[Frame]:
        """Their frames of this tick."""
        held = Held(at, enable=enable, reset=reset, anti_sway=anti_sway)
        return self.hand.frames(self.number * self.tick_ms, held)

    def receive(self, frames: list[Frame]) -> None:
        """The gate receives them."""
        for frame in frames:
            if (changed := self.change(frame)) is not None:
                self.gate.receive(changed[:3], changed[3], self.now_ns)

    def frame(self, steps: int) -> bytes:
        """The next frame of the valve."""
        self.valve.put(self.sender.raw, steps)
        data = self.sender.frame().data
        self.valve.put(self.sender.raw, 0)
        return data

    def sent(self, steps: int, missed: int = 0) -> str:
        """The command of this tick; why it may not leave. Then neutral leaves in its place."""
        self.gate.tick(self.now_ns, missed)
        why = self.gate.leaving(self.key, self.frame(steps))
        if why:
            self.sender.take_back()
            self.gate.refused(self.key)
            assert not self.gate.leaving(self.key, self.frame(0))
        self.number += 1
        return why

    def sends(self, steps: int, missed: int = 0, **joysticks: Any) -> str:
        """A tick with joysticks and command; why that may not leave."""
        self.number += missed
        self.receive(self.joysticks(**joysticks))
        return self.sent(steps, missed)

    def skips(self, **joysticks: Any) -> None:
        """A tick without a frame of the valve."""
        self.receive(self.joysticks(**joysticks))
        self.gate.tick(self.now_ns, 0)
        self.number += 1

    def rests(self, ticks: int = 3, **held: Any) -> None:
        """Joystick in neutral: the axis is ready."""
        for _ in range(ticks):
            assert not self.sends(0, **held)

    def ramp(self, steps: int, **joysticks: float) -> None:
        """From rest up to there by less than the rates, and on for a while."""
        self.rests()
        sign = 1 if steps > 0 else -1
        for size in [*range(10, abs(steps), 10), *[abs(steps)] * 10]:
            why = self.sends(sign * size, **joysticks)
            assert not why, (why, size)

    def restarts(self, steps: int, **joysticks: Any) -> str:
        """Move by joystick and enable alone; return why the first frame may not leave."""
        for _ in range(60):
            if not self.sends(steps, **joysticks):
                return "moved"
        return ""


def bench(**limits: Any) -> Bench:
    """The forwarder with other limits of near-far, which without them are nearly none."""
    free = {"deadband_pct": 0.0, "rise_per_s": 100.0, "fall_per_s": 100.0, "stop_distance_m": None}
    return Bench(limited(load("forwarder"), "near_far", **(free | limits)), "near_far")


def load(name: str) -> Deployment:
    """A deployment of config/."""
    return read(shipped.CONFIG / f"{name}.yaml")
