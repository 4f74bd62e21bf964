"""A random operator: where each joystick is, tick by tick."""

import random


def path(rng: random.Random, ticks: int, full: int, band: int) -> list[int]:
    """Raw values of one joystick: deflected, held, reversed, released, in any order.

    Args:
        rng: source of randomness.
        ticks: how many.
        full: raw value of full deflection.
        band: raw value up to which the joystick counts as neutral.
    """
    if rng.random() < 0.2:  # no one touches this one, or it rests a little off neutral
        return [rng.choice((0, 0, band, -band))] * ticks
    values: list[int] = []
    # One in ten is deflected before anything else.
    value = 0 if rng.random() < 0.9 else _deflection(rng, full, band)
    values += [value] * rng.randint(2, 8)
    while len(values) < ticks:
        kind = rng.random()
        if kind < 0.35:
            target = _deflection(rng, full, band)
        elif kind < 0.55:
            target = -value
        elif kind < 0.65:
            target = rng.choice((band, -band, band + 1, -band - 1, 0))
        elif kind < 0.8:
            target = 0
        else:
            target = value
        ramp = rng.choice((0, 0, 0, 3, 10))
        values += [value + (target - value) * i // (ramp + 1) for i in range(1, ramp + 1)]
        value = target
        values += [value] * rng.choice((1, 2, 4, 8, 15, 30))
    return values[:ticks]


def _deflection(rng: random.Random, full: int, band: int) -> int:
    size = rng.choice((full, full, rng.randint(band + 1, full)))
    return size if rng.random() < 0.5 else -size
