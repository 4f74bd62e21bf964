"""Controllers of one deployment side by side: each sends as if alone, and owns its state."""

import pickle
from functools import cache

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.hand import Hand, Held
from canshaper_sim.plant import PlantNode
from tests.faults import shipped

# Of every kind of protection, direction, protocol and status that is shipped.
NAMES = (
    "forwarder",
    "forwarder-sensor",
    "canfd-forwarder",
    "j1939-profiles",
    "canopen-forwarder",
    "gateway-forwarder",
    "pvedcc-forwarder",
)
SECONDS = 3.0


class Driven:
    """One controller with a crane and joysticks of its own."""

    def __init__(self, deployment: Deployment, speed: float) -> None:
        self.controller = Controller(deployment)
        self._gated, self._hand = GatedController(self.controller), Hand(deployment)
        self._plant, self._feedback = PlantNode(deployment), list[Frame]()
        self._deployment, self._speed, self._number = deployment, speed, 0
        self.sent: list[Frame] = []

    def step(self) -> None:
        """A tick: at rest for a second, in motion, and with enable released at the end."""
        tick_ms = self._deployment.config.tick_ms
        time_ms, now_ns = self._number * tick_ms, self._number * tick_ms * 1_000_000
        self._number += 1
        pushed = self._speed if time_ms > 1000 else 0.0
        held = Held(dict.fromkeys(self._deployment.axes, pushed), enable=time_ms < 2500)
        frames = [*self._hand.frames(time_ms, held), *self._feedback]
        sent = [one for one in (self._gated.receive(f, now_ns) for f in frames) if one]
        sent += self._gated.tick(now_ns)
        if time_ms % 1000 == 0 and (identity := self.controller.status.identity(frozenset())):
            sent.append(identity)
        for frame in sent:
            self._plant.receive(frame)
        self._plant.advance(tick_ms / 1000.0)
        self._feedback = self._plant.feedback()
        self.sent += sent

    def end(self) -> list[Frame]:
        """Everything that was sent, the last frames included."""
        return [*self.sent, *self._gated.neutral_frames()]


def steps(deployment: Deployment) -> range:
    return range(round(SECONDS * 1000) // deployment.config.tick_ms)


@cache
def alone(name: str, speed: float) -> list[Frame]:
    driven = Driven(load_deployment(shipped.CONFIG / f"{name}.yaml"), speed)
    for _ in steps(driven.controller.deployment):
        driven.step()
    return driven.end()


@pytest.mark.parametrize("name", NAMES)
def test_two_controllers_of_one_deployment_do_not_know_each_other(name: str) -> None:
    deployment = load_deployment(shipped.CONFIG / f"{name}.yaml")
    speeds = (1.0, -0.5)
    both = [Driven(deployment, speed) for speed in speeds]
    for _ in steps(deployment):
        for driven in both:
            driven.step()
    for driven, speed in zip(both, speeds, strict=True):
        assert driven.end() == alone(name, speed)


@pytest.mark.parametrize("name", NAMES)
def test_a_controller_changes_nothing_of_its_deployment(name: str) -> None:
    deployment = load_deployment(shipped.CONFIG / f"{name}.yaml")
    assert deployment.routing and PlantNode(deployment)  # both look up once, and keep
    before = pickle.dumps(deployment)
    driven = Driven(deployment, 1.0)
    for _ in range(len(steps(deployment)) * 2 // 3):
        driven.step()
    assert pickle.dumps(deployment) == before
