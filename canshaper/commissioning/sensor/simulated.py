"""The drive that shows a sway sensor."""

from collections.abc import Sequence

from canshaper_sim.strokes import Script, Stroke

# As a person drives who is asked to: a slow stroke, a pause of two swings, and back.
FIRST_S, STROKE_S, PAUSE_S, LEVEL, STROKES = 2.0, 1.0, 4.0, 0.4, 4


def hand_driven(axes: Sequence[str]) -> Script:
    """Slow strokes of one axis after the other."""
    strokes, start_s = [], FIRST_S
    for axis in axes:
        for number in range(STROKES):
            strokes.append(Stroke(axis, start_s, STROKE_S, -LEVEL if number % 2 else LEVEL))
            start_s += STROKE_S + PAUSE_S
    return Script("sensor", tuple(strokes), start_s + PAUSE_S)
