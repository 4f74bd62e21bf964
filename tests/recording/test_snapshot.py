"""Going back to a snapshot is as if nothing had happened since, for every shipped deployment."""

import random
from pathlib import Path

import pytest

from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.recording.snapshot import Snapshot

FILES = (Path(__file__).parents[2] / "config").glob("*.yaml")
CONFIGS = sorted(p.name for p in FILES if "buses:" in p.read_text(encoding="utf-8"))
TICK_NS = 20_000_000


def driven(controller: Controller, seed: int, begin: int, ticks: int) -> list[object]:
    """What a controller makes of frames by chance, many of them joystick frames in motion."""
    chance = random.Random(seed)
    deployment = controller.deployment
    keys = [bound.key for bound in deployment.inputs()]
    made: list[object] = []
    for number in range(begin, begin + ticks):
        now_ns = number * TICK_NS
        for bound, key in zip(deployment.inputs(), keys, strict=True):
            if chance.random() < 0.9:
                raw = {s.name: 0 for s in bound.message.signals}
                for name in raw:
                    if "Alive" in name or "Counter" in name:
                        raw[name] = number % 16
                    elif name in ("Enable",):
                        raw[name] = 1
                    elif number > begin + 5 and chance.random() < 0.3:
                        raw[name] = chance.randrange(2)
                try:
                    data = bound.message.encode(raw, scaling=False, strict=False)
                except Exception:
                    data = bytes(bound.message.length)
                controller.receive(Frame(key[0], key[1], key[2], data), now_ns)
        missed = chance.random() < 0.02
        made += controller.tick(now_ns, int(missed))
        made += [event.text for event in controller.events]
        controller.events.clear()
        made += [(r.axis.sent, r.axis.sway and r.axis.sway.angle) for r in controller.axes.values()]
    made.append(dict(controller.counters.values))
    return made


@pytest.mark.parametrize("name", CONFIGS)
def test_a_second_time_is_like_the_first(name: str) -> None:
    controller = Controller(loader(name)())
    driven(controller, 1, 0, 150)
    snapshot = Snapshot(controller)
    first = driven(controller, 2, 150, 150)
    assert first != driven(controller, 2, 300, 150)  # there is something to go back from
    for _ in range(2):
        snapshot.restore()
        assert driven(controller, 2, 150, 150) == first
