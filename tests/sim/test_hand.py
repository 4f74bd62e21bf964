"""Motion of a hand at the joysticks is in their frames, as a daemon reads them."""

from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.machine.deployment import Deployment
from canshaper_sim.hand import Hand, Held
from tests.rigs.files import CONFIG, read

FILES = [
    "forwarder",
    "forwarder-joints",
    "forwarder-robust",
    "j1939-forwarder",
    "j1939-profiles",
    "canopen-forwarder",
    "gateway-forwarder",
]


@pytest.fixture(params=FILES)
def deployment(request: pytest.FixtureRequest) -> Deployment:
    return read(CONFIG / f"{request.param}.yaml")


@pytest.mark.parametrize("position", [-1.0, -0.4, 0.0, 0.7, 1.0])
@pytest.mark.parametrize("anti_sway", [False, True])
def test_a_daemon_reads_what_the_hand_holds(
    deployment: Deployment, position: float, *, anti_sway: bool
) -> None:
    hand = Hand(deployment)
    joysticks = dict.fromkeys(deployment.axes, position)
    frames = {frame[:3]: frame for frame in hand.frames(0, Held(joysticks, anti_sway=anti_sway))}
    moved = {axis.config.command.signal for axis in deployment.axes.values()}
    for joystick in deployment.joysticks.values():
        raw, commands = joystick.decode(_frame_of(frames, joystick.key).data)
        assert (
            joystick.config.anti_sway_off is None or raw[joystick.config.anti_sway_off] != anti_sway
        )
        for signal, command in commands.items():
            assert command == pytest.approx(position if signal in moved else 0.0, abs=0.005)


def test_at_rest_nothing_is_enabled(deployment: Deployment) -> None:
    hand = Hand(deployment)
    frames = {frame[:3]: frame for frame in hand.frames(0, Held())}
    for joystick in deployment.joysticks.values():
        raw, commands = joystick.decode(_frame_of(frames, joystick.key).data)
        if joystick.enable is not None:
            assert raw[joystick.enable] == 0
        assert joystick.config.reset is None or raw[joystick.config.reset] == 0
        assert set(commands.values()) == {0.0}


def test_reset_and_enable_are_in_the_frame(deployment: Deployment) -> None:
    hand = Hand(deployment)
    frames = {frame[:3]: frame for frame in hand.frames(0, Held(enable=True, reset=True))}
    for joystick in deployment.joysticks.values():
        raw, _ = joystick.decode(_frame_of(frames, joystick.key).data)
        if joystick.enable is not None:
            assert raw[joystick.enable] == 1
        assert joystick.config.reset is None or raw[joystick.config.reset] == 1


def _fits(frame: Frame, key: tuple[int, bool]) -> bool:
    """Of J1939 the source address is the joystick's."""
    can_id, extended = key
    return frame.can_id == can_id or (extended and frame.can_id >> 8 == can_id >> 8)


def _frame_of(frames: dict[Any, Frame], key: tuple[str, int, bool]) -> Frame:
    same = [f for f in frames.values() if f.bus == key[0] and _fits(f, key[1:])]
    assert len(same) == 1
    return same[0]


def test_the_button_for_the_next_profile_is_pressed_on_one_joystick() -> None:
    deployment = read(CONFIG / "j1939-profiles.yaml")
    frames = {f[1] & 0xFFFF00: f for f in Hand(deployment).frames(0, Held(next_profile=True))}
    pressed = {
        name: joystick.decode(frames[joystick.message.frame_id & 0xFFFF00].data)[0]["Button4"]
        for name, joystick in deployment.joysticks.items()
    }
    assert pressed == {"left": 1, "right": 3}  # not available
