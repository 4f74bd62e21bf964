"""What every filter has to do: short strokes, a loading cycle, random sticks."""

from dataclasses import dataclass

from canshaper_sim.operator import SCRIPTS, Script, Stroke, random_script

RANDOM_SEEDS = tuple(range(1, 13))
INITIAL_SWAY_DEG = 10.0
LENGTH_ERRORS_PCT = (-30, -15, 0, 15, 30)

_START_S = 0.5
_REST_S = 5.0
_RAMP_S = 0.1


@dataclass(frozen=True)
class Manoeuvre:
    """A script with what goes with it.

    Attributes:
        name: what it is called.
        script: the strokes, with a rest at the end.
        initial_deg: swing at the start.
        lengths_pct: errors of the pendulum length at which it is driven.
    """

    name: str
    script: Script
    initial_deg: float = 0.0
    lengths_pct: tuple[int, ...] = LENGTH_ERRORS_PCT


def manoeuvres(axis: str) -> list[Manoeuvre]:
    """All manoeuvres for one axis."""

    def strokes(name: str, *parts: tuple[float, float, float]) -> Manoeuvre:
        """Parts: (start after the begin, duration, level)."""
        row = tuple(Stroke(axis, _START_S + s, d, v, _RAMP_S) for s, d, v in parts)
        return Manoeuvre(name, Script(name, row, max(s.end_s for s in row) + _REST_S))

    pulse = strokes("pulse", (0.0, 3.0, 1.0))
    loading = tuple(s for s in SCRIPTS["loading"].strokes if s.axis == axis)
    end_s = max(s.end_s for s in loading)
    return [
        pulse,
        strokes("partial stroke", (0.0, 2.5, 0.4)),
        strokes("early release", (0.0, 0.6, 1.0)),
        strokes("reversal", (0.0, 1.5, 1.0), (1.5, 1.5, -1.0)),
        strokes("double tap", (0.0, 0.4, 1.0), (0.7, 0.4, 1.0)),
        Manoeuvre("loading cycle", Script("loading cycle", loading, end_s + _REST_S)),
        *(Manoeuvre(f"random {n}", _random(axis, n), lengths_pct=(0,)) for n in RANDOM_SEEDS),
        Manoeuvre("initial sway", pulse.script, INITIAL_SWAY_DEG, (0,)),
    ]


def _random(axis: str, seed: int) -> Script:
    script = random_script(seed, 25.0, (axis,))
    return Script(script.name, script.strokes, 25.0 + _REST_S)
