"""Drives with a sway sensor, and without one to compare."""

from dataclasses import replace

import pytest

from canshaper.shaping.sway import Measured
from tests.rigs.sensed import LENGTH_M, SCRIPTS, Setup

ENCODER, GYRO = Setup(), Setup(measured=Measured.RATE)
KINDS = pytest.mark.parametrize("sensor", [ENCODER, GYRO], ids=["encoder", "gyro"])
PLAIN = Setup(measured=None)


def residuals(setup: Setup, errors_pct: tuple[int, ...]) -> dict[tuple[str, int], float]:
    return {
        (name, error): replace(setup, length_m=LENGTH_M * (1.0 + error / 100.0))
        .drive(name)
        .residual_deg
        for name in SCRIPTS
        for error in errors_pct
    }
