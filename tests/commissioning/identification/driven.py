"""A crane that is driven, as a sensor shows it."""

import math

import numpy as np

from canshaper.commissioning.identification.series import Command, Kind, Series, Unit, runs
from tests.commissioning.identification.machine import Coloured, Push, driven


def drive(pushes: list[Push], seconds: float, kind: Kind, seed: int) -> Series:
    """The near-far axis driven, with its commands, as an angle or its rate."""
    reported = driven(seconds, pushes)
    time = np.array([s.time_s for s, _ in reported])
    rate = kind is Kind.RATE
    swing = np.array([s.theta6_rate_rad_s if rate else s.theta6_rad for s, _ in reported])
    noise = Coloured(seed, math.radians(0.2), 0.8)
    commands = np.array([c["near_far"] for _, c in reported])
    speed = np.sign(commands) * np.maximum(0.0, (np.abs(commands) - 0.05) / 0.95)
    unit = Unit(kind, 1.0, "rad/s" if rate else "rad")
    value = swing + np.array([noise() for _ in time])
    idle = [(float(time[a]), float(time[b - 1])) for a, b in runs(commands == 0.0)]
    return Series("log", unit, time, value, Command(time - 0.02, speed), idle)
