"""Sequences of faults in the whole daemon: what it has recorded is played the same, bit for bit."""

import os
from collections import Counter
from functools import cached_property
from pathlib import Path
from types import FunctionType
from unittest.mock import patch

import pytest

from canshaper.blackbox import keeper, state
from canshaper.blackbox.ring import records
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.daemon import daemon
from canshaper.machine.binding import load_deployment
from canshaper.recording import play
from tests.blackbox.kept import Kept, unpacked
from tests.faults import variants
from tests.faults.gated import Unrefused
from tests.faults.sequence import Sequence
from tests.faults.shipped import CONFIG, NAMES

COUNT = int(os.environ.get("CANSHAPER_BOXES", "3"))


def kept(name: str, seed: int) -> list[tuple[bytes, bytes]]:
    """Recording of the daemon in a sequence."""
    made: list[Kept] = []

    def make(folder: Path | None) -> Kept:
        made.append(Kept(folder))
        return made[-1]

    with patch.object(daemon, "BlackBox", make), patch.object(keeper, "STATE_NS", 700_000_000):
        Sequence(name, seed).run()
    return [box for one in made for box in one.boxes]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_what_is_played_is_the_same(name: str, tmp_path: Path) -> None:
    seen: Counter[str] = Counter()
    for seed in range(COUNT):
        for kept_box in kept(name, seed):
            deployment, box = unpacked(kept_box, tmp_path)
            box.segments = [  # at every third the state is the one that was kept
                one._replace(follows=one.follows and i % 3 > 0)
                for i, one in enumerate(box.segments)
            ]
            with patch.object(play, "Controller", Unrefused):
                player = play.Player(box, deployment)
                for tick, result in player.run(lambda part: None):
                    assert not result.differences, (seed, tick.number, result.differences)
                    seen["ticks"] += 1
                    seen["frames"] += result.compared
                    seen.update(event.split("=")[0] for event in result.events)
            seen["segments"] += len(box.segments)
            seen["boxes"] += 1
    assert seen["ticks"] > 50 * COUNT
    assert seen["frames"] > seen["ticks"]


def held(one: object, seen: dict[int, object]) -> None:
    """Note every object of ours that can be reached, and every function."""
    if id(one) in seen or isinstance(one, (type, str, bytes, int, float)):
        return
    if not isinstance(one, state.FIXED) or isinstance(one, FunctionType):
        seen[id(one)] = one
    if isinstance(one, state.FIXED):
        parts: list[object] = []
    elif isinstance(one, dict):
        parts = [*one.keys(), *one.values()]
    elif isinstance(one, (list, tuple, set, frozenset)):
        parts = list(one)
    else:
        parts = [*getattr(one, "__dict__", {}).values(), getattr(one, "__self__", None)]
    for part in parts:
        held(part, seen)


@pytest.mark.parametrize("name", variants.NAMES)
def test_no_attribute_of_a_state_is_left_out(name: str) -> None:
    """They are found in the code of the classes; here in what the objects have."""
    controller = Controller(variants.machine(name)[1])
    seen: dict[int, object] = {}
    held(GatedController(controller), seen)
    looked_at = Counter[str]()
    for one in seen.values():
        kind = type(one)
        if names := state.attributes(kind):
            cached = {n for n, one in vars(kind).items() if isinstance(one, cached_property)}
            assert vars(one).keys() - cached <= set(names), kind
            looked_at[kind.__name__] += 1
    assert looked_at["ShapedAxis"] and looked_at["AxisControl"] and looked_at["Controller"]


@pytest.mark.parametrize("name", NAMES)
def test_no_function_of_a_state_holds_on_to_another_controller(name: str) -> None:
    """Functions are kept by number: such a one would ask the parts of the controller before."""
    seen: dict[int, object] = {}
    held(GatedController(Controller(load_deployment(CONFIG / f"{name}.yaml"))), seen)
    assert not [one for one in seen.values() if getattr(one, "__closure__", None)]


@pytest.mark.slow
def test_a_frame_that_is_too_long_stays_so(tmp_path: Path) -> None:
    """No classical bus has one; an adapter that is broken might, and it is refused in both."""
    lengths: set[int] = set()
    for kept_box in kept("forwarder-robust", 12):
        deployment, box = unpacked(kept_box, tmp_path)
        lengths |= {r.length for one in box.segments for r in records(one.records)}
        with patch.object(play, "Controller", Unrefused):
            played = list(play.Player(box, deployment).run(lambda part: None))
        assert not [result.differences for _, result in played if result.differences]
    assert 9 in lengths
