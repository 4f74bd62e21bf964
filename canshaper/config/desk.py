"""Sections of a deployment file that only tools at the desk use; the daemon checks them.

They are the objective by which ``tune`` chose poles, the ranges from which a campaign draws its
drives, and the limits with which the campaign is compared.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, create_model, model_validator

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
    """Return (q11, q12, q22) of the weight Q of Eq. 15.

    Args:
        q: 1 number, of Q = q I; 2, the diagonal; or 4, the rows.
    """
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


# What a campaign measures on each drive: key, and definition with unit.
MEASURES = {
    "still_s": "from the last release until the swing stays below still_deg, or the drive ends, s",
    "residual_deg": "largest swing that is left later than 2.5 s after the last release, or than"
    " the longest tail_s where that is more than 5 s, deg",
    "peak_deg": "largest swing of the drive, deg",
    "run_on_s": "from the last release until the tip stands, s",
    "run_on_m": "how far the tip gets meanwhile, m",
    "travel_error_s": "way of an axis less the commanded one, s of full speed",
    "dip_pct": "largest fall of a command while the joystick is held, % of full command",
}
# A pump flow (full axis flows) that stands for no limit.
MOST_FLOW = 100.0
QUANTILES = {"p50": 0.5, "p90": 0.9, "p95": 0.95, "p99": 0.99, "p999": 0.999}


def _ordered(ends: list[float]) -> list[float]:
    low, high = ends
    if not low <= high:
        raise ValueError(f"expected the lower end first, got {low:g} to {high:g}")
    return ends


def _end(least: float, most: float, unit: str) -> Any:
    return number(least, most, unit, "end of the range")


def _usual(low: float, high: float, text: str) -> Any:
    return Field([low, high], min_length=2, max_length=2, description=f"{text}, from and to")


_N = TypeVar("_N")
Range = Annotated[list[_N], AfterValidator(_ordered)]


class Uncertainty(Section):
    """Ranges from which a campaign draws the crane of each drive, uniformly distributed.

    Percentages are changes against the nominal crane. Each axis has a valve of its own.
    """

    length_pct: Range[Annotated[float, _end(-60, 100, "%")]] = _usual(
        -15.0, 15.0, "length of the tool below its second joint"
    )
    damping_pct: Range[Annotated[float, _end(-95, 500, "%")]] = _usual(
        -50.0, 100.0, "damping of its joints"
    )
    radius_m: Range[Annotated[float, _end(0.5, 120, "m")]] = _usual(
        2.5, 6.5, "radius of the tip at the start; joint by joint it is not drawn"
    )
    rope_m: Range[Annotated[float, _end(0.5, 150, "m")]] = _usual(
        3.0, 15.0, "rope of a crane that has one, at the start; its signal is wrong by length_pct"
    )
    sway_deg: Range[Annotated[float, _end(0, 30, "deg")]] = _usual(
        0.0, 3.0, "swing at the start, along and across the boom"
    )
    load_mass: Range[Annotated[float, _end(1, 20, "times")]] = _usual(
        1.0, 3.0, "mass with a load, in masses without"
    )
    load_m: Range[Annotated[float, _end(0, 3, "m")]] = _usual(
        0.0, 0.4, "how much lower the centre of mass is with a load"
    )
    valve_dead_time_s: Range[Annotated[float, _end(0, 0.2, "s")]] = _usual(
        0.0, 0.04, "dead time of a valve"
    )
    valve_lag_s: Range[Annotated[float, _end(0.01, 1, "s")]] = _usual(
        0.06, 0.14, "time constant of a valve"
    )
    valve_rate_per_s: Range[Annotated[float, _end(0.1, 100, "1/s")]] = _usual(
        4.0, 6.0, "travel of a spool, in full strokes"
    )
    valve_deadband_pct: Range[Annotated[float, _end(0, 50, "% of full command")]] = _usual(
        4.0, 6.0, "deadband of a valve"
    )
    valve_hysteresis_pct: Range[Annotated[float, _end(0, 20, "% of full stroke")]] = _usual(
        0.0, 4.0, "play between command and spool of a valve"
    )
    valve_gain_pct: Range[Annotated[float, _end(-80, 100, "%")]] = _usual(
        -15.0, 10.0, "full speed of an axis"
    )
    pump_flow: Range[Annotated[float, _end(0.5, MOST_FLOW, "full axis flows")]] = _usual(
        MOST_FLOW, MOST_FLOW, "most that the pump delivers, 100 for no limit"
    )
    slope_deg: Range[Annotated[float, _end(0, 15, "deg")]] = _usual(
        0.0, 0.0, "slope on which the carrier stands, along and across"
    )
    rock_hz: Range[Annotated[float, _end(0, 5, "Hz")]] = _usual(
        0.0, 0.0, "frequency of the carrier on its tyres, 0 for a stiff one"
    )
    wind_m_s: Range[Annotated[float, _end(0, 12, "m/s")]] = _usual(
        0.0, 0.0, "mean of the wind, with gusts of a quarter of it"
    )
    starved_pct: Annotated[
        float, number(0, 100, "% of the drives", "in which the heaviest axis goes without oil")
    ] = 0.0
    """Drives with plain load sensing: where the pump delivers less than is asked for, the axis with
    the heaviest load goes without oil."""
    stops_pct: Annotated[
        float, number(0, 100, "% of the drives", "drives that begin near an end stop of the tip")
    ] = 0.0
    load_change_pct: Annotated[
        float, number(0, 100, "% of the drives", "drives with a load picked up and put down")
    ] = 40.0
    sensor_fault_pct: Annotated[
        float,
        number(0, 100, "% of the drives", "drives with a fault of the sway sensors"),
    ] = 10.0
    bus_fault_pct: Annotated[
        float, number(0, 100, "% of the drives", "drives with joystick frames lost, late or wrong")
    ] = 10.0


Limit = Annotated[float, number(0, 1e6, "", "the most that it may be")]
_KEYS: dict[str, Any] = {
    f"{measure}_{quantile}": (
        Limit | None,
        Field(None, description=f"most of the {quantile} quantile: {text}"),
    )
    for measure, text in MEASURES.items()
    for quantile in QUANTILES
}
# The 35 keys are every measure at every quantile; the table says each fact once.
Accept = create_model("Accept", __base__=Section, __doc__="Limits of quantiles.", **_KEYS)
