"""Objective by which ``canshaper tune`` chose the poles of a G_FF, in a deployment file."""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from canshaper.config.section import Section, number

PoleDistance = Literal["text", "printed", "off"]
"""Reading of Eq. 14e, pole distance against five times the sway pole's: "text" at least that,
"printed" at most that; "off" ignores it."""

States = Literal["sway", "deviation", "companion", "none"]
"""Quantity that Q weighs, of v = u / (a2 s^2 + a1 s + 1): "sway" (v'/w, v''/w^2), which is swing
angle and rate in units of full speed times w/g; "deviation" (v - u, v'); "companion"
(a2 v, a2 v'); or nothing."""

_Weight = Annotated[float, number(0, 1e6, "", "weight, as of the option of tune")]


class Objective(Section):
    """Objective by which the poles of a G_FF were chosen (Eq. 14-15); ``tune`` reads it again."""

    q: list[Annotated[float, number(-1e6, 1e6, "", "weight")]] = Field(
        [1.0, 1.0], max_length=4, description="Q: one number, its diagonal, or the matrix by rows"
    )
    r: _Weight = 1.0
    s: _Weight = 3.0
    p: _Weight = 1.0
    states: States = Field("sway", description="what Q weighs")
    preference: Annotated[float, number(0, 1, "", "instead: 0 quickest, 1 calmest")] | None = None
    pole_distance: Annotated[
        PoleDistance,
        BeforeValidator(lambda word: "off" if word is False else word),  # as YAML 1.1 reads it
    ] = Field("text", description="sense of Eq. 14e")
    horizon_s: Annotated[float, number(0.2, 60, "s", "how long a step is watched")] = 3.0
    third_pole: bool = Field(False, description="three poles")
    within_command: bool | None = Field(None, description="the output never passes the command")
    max_jump: Annotated[float, number(0.01, 100, "", "most that comes at once")] | None = None
    max_run_on_s: Annotated[float, number(0.05, 20, "s", "longest run-on to 5 %")] | None = None

    @model_validator(mode="after")
    def _weighs(self) -> Self:
        if fault := weights_fault(self.q, self.r, self.s):
            raise ValueError(fault)
        return self


def matrix(q: Sequence[float]) -> tuple[float, float, float]:
    """Return (q11, q12, q22) of a Q given as one number, as its diagonal, or by rows."""
    return q[0], q[1] if len(q) == 4 else 0.0, q[-1]


def weights_fault(q: Sequence[float], r: float, s: float) -> str | None:
    """Return why Q, R and S cannot be weights of Eq. 15, or None.

    Q has to be symmetric and positive semi-definite. With R and S both 0 the best filter would
    never move.
    """
    if len(q) not in (1, 2, 4):
        return f"weight Q: expected 1 number, 2 of the diagonal or 4 of the rows, got {len(q)}"
    q11, q12, q22 = matrix(q)
    for value in (q11, q22):
        if not 0.0 <= value <= 1e6:
            return f"weight Q: expected 0 to 1e+06, got {value:g}"
    if len(q) == 4 and q12 != q[2]:
        return f"weight Q: expected a symmetric matrix, got {q12:g} and {q[2]:g}"
    most = math.sqrt(q11 * q22)
    if not abs(q12) <= most * (1.0 + 1e-12):
        text = f"{-most:g} to {most:g} beside the diagonal (positive semi-definite)"
        return f"weight Q: expected {text}, got {q12:g}"
    if r + s == 0.0:
        return "weights R and S: expected one above 0, got both 0"
    return None
