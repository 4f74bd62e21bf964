"""The guard reads the same as the codecs, by masks of its own: any bytes, every shipped machine."""

import random

import pytest

from canshaper.codec.signals import FieldSet
from canshaper.config.limits import Limits
from canshaper.guard.bits import CommandBits, JoystickBits
from canshaper.guard.opening import openings
from canshaper.machine.binding import load_deployment
from canshaper.shaping.limits import without_deadband
from tests.faults import shipped
from tests.rigs.sent import command_raw


@pytest.mark.parametrize("name", shipped.NAMES)
def test_joysticks_are_read_as_the_joystick_codec_reads_them(name: str) -> None:
    deployment, rng = load_deployment(shipped.CONFIG / f"{name}.yaml"), random.Random(name)
    for axis in deployment.axes.values():
        config = axis.config.command
        joystick = deployment.joysticks[config.joystick]
        bits = JoystickBits(joystick.message, config)
        for _ in range(300):
            data = rng.randbytes(joystick.message.length)
            if chosen := joystick.chosen:
                raw = joystick.decode(data)[0] | {chosen.signal: chosen.value}
                data = FieldSet(joystick.message).layout.encode(raw)
            command = joystick.decode(data)[1][config.signal]
            if isinstance(command, float) and abs(command) > config.neutral_pct / 100.0:
                assert bits.command(data) == command


@pytest.mark.parametrize("name", shipped.NAMES)
def test_commands_are_read_as_the_valve_codec_reads_them(name: str) -> None:
    deployment, rng = load_deployment(shipped.CONFIG / f"{name}.yaml"), random.Random(name)
    for axis in deployment.axes.values():
        joystick = axis.config.command if axis.rewrites else None
        bits, codec = CommandBits(axis.valve_message, axis.config.valve, joystick), axis.valve
        layout = codec.message.fields.layout
        for steps in (0, 1, -1, codec.steps, -codec.steps, rng.randrange(codec.steps)):
            assert bits.steps(layout.encode(command_raw(codec, steps))) == steps
        for _ in range(300):
            data = rng.randbytes(axis.valve_message.length)
            steps = bits.steps(data)
            if steps is not None and abs(steps) <= codec.steps:
                assert steps == codec.read(layout.decode(data))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_velocity_is_that_behind_dead_band_or_curve(sign: int) -> None:
    plain = Limits(deadband_pct=5)
    points = {"curve_command_pct": [-100, -50, -6, 4, 60, 100]}
    curved = Limits(**points, curve_speed_pct=[-90, -40, 0, 0, 50, 100])  # type: ignore[arg-type]
    curve = curved.curve()
    assert curve is not None
    for steps in range(126):
        by_band = openings(plain, 125)[sign < 0].velocity(steps)
        assert by_band == pytest.approx(without_deadband(steps / 125, 0.05), abs=1e-12)
        by_curve = openings(curved, 125)[sign < 0].velocity(steps)
        assert by_curve == pytest.approx(abs(curve.velocity(sign * steps / 125)), abs=1e-12)
    assert openings(plain, 125)[sign < 0].velocity(127) > 1.0
