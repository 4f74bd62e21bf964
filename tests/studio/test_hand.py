"""The levers of the page send what the levers of the scripted operator send."""

from pathlib import Path
from typing import Any

import pytest

from canshaper.can.binding import load_deployment
from canshaper.can.deployment import Deployment
from canshaper.can.frame import Frame
from canshaper.studio.hand import Hand, Held
from canshaper_sim.axes import ALL_AXES
from canshaper_sim.levers import LeverNode
from canshaper_sim.operator import random_script

CONFIG = Path(__file__).parents[2] / "config"
FILES = [
    "forwarder",
    "forwarder-joints",
    "forwarder-robust",
    "j1939-forwarder",
    "canopen-forwarder",
]


@pytest.fixture(params=FILES)
def deployment(request: pytest.FixtureRequest) -> Deployment:
    return load_deployment(CONFIG / f"{request.param}.yaml")


@pytest.mark.parametrize("bypass", [False, True])
def test_same_frames_as_the_scripted_operator(deployment: Deployment, *, bypass: bool) -> None:
    axes = [axis for axis in ALL_AXES if axis in deployment.axes]
    script = random_script(3, 10.0, axes)
    node, hand = LeverNode(deployment, script, bypass=bypass), Hand(deployment)
    assert hand.cycle_ms == node.cycle_ms
    for time_ms in range(0, 10_000, hand.cycle_ms):
        sticks = {axis: script.stick(axis, time_ms / 1000.0) for axis in axes}
        held = Held(sticks, enable=True, anti_sway=not bypass)
        pairs = zip(hand.frames(time_ms, held), node.frames(time_ms), strict=True)
        for ours, theirs in pairs:
            assert ours[:3] == theirs[:3]
            assert _values(deployment, ours) == _values(deployment, theirs)


def test_at_rest_nothing_is_enabled(deployment: Deployment) -> None:
    hand = Hand(deployment)
    frames = {frame[:3]: frame for frame in hand.frames(0, Held())}
    for lever in deployment.levers.values():
        raw, commands = lever.codec.decode(_frame_of(frames, lever.key).data)
        assert raw[lever.config.enable] == 0
        assert lever.config.reset is None or raw[lever.config.reset] == 0
        assert set(commands.values()) == {0.0}


def test_reset_and_enable_are_in_the_frame(deployment: Deployment) -> None:
    hand = Hand(deployment)
    frames = {frame[:3]: frame for frame in hand.frames(0, Held(enable=True, reset=True))}
    for lever in deployment.levers.values():
        raw, _ = lever.codec.decode(_frame_of(frames, lever.key).data)
        assert raw[lever.config.enable] == 1
        assert lever.config.reset is None or raw[lever.config.reset] == 1


def _values(deployment: Deployment, frame: Frame) -> dict[str, Any]:
    """Raw values of a frame; the scripted operator leaves a reset button "not available"."""
    found = [m for m in deployment.on_bus[frame.bus] if _fits(frame, (m.frame_id, frame.extended))]
    raw = dict(found[0].decode(frame.data, decode_choices=False, scaling=False))
    for lever in deployment.levers.values():
        if lever.message is found[0] and lever.config.reset:
            del raw[lever.config.reset]
    return raw


def _fits(frame: Frame, key: tuple[int, bool]) -> bool:
    """Of J1939 the source address is the joystick's."""
    can_id, extended = key
    return frame.can_id == can_id or (extended and frame.can_id >> 8 == can_id >> 8)


def _frame_of(frames: dict[Any, Frame], key: tuple[str, int, bool]) -> Frame:
    same = [f for f in frames.values() if f.bus == key[0] and _fits(f, key[1:])]
    assert len(same) == 1
    return same[0]
