"""Figure 6: G11 and G22 of Eq. 11, derived by CasADi, over frequency; and while slewing."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from canshaper.shaping.sway import GRAVITY_M_S2
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Grapple
from studies.crane.config import GrappleData
from studies.crane.linear import (
    LinearSway,
    OperatingPoint,
    closed_form,
    linearise,
    sway_modes,
)
from studies.paper.printed import RADIUS_M

LOW_RAD_S, HIGH_RAD_S = 0.3, 30.0
_POINTS = 1201  # 0.4 % apart: the peaks are 8 % and 10 % wide


@dataclass(frozen=True)
class BodeCurve:
    """One transfer function on the imaginary axis.

    Attributes:
        name: such as ``G11``.
        omega_rad_s: frequencies.
        magnitude_db: 20 lg |G|; G11 is rad/s per rad/s, G22 rad/s per m/s.
        phase_deg: continuous over frequency.
        printed_db: magnitude of Eq. 12 as printed, with the same damping.
        resonance_rad_s: undamped natural frequency of the mode.
        damping_ratio: of the mode.
    """

    name: str
    omega_rad_s: list[float]
    magnitude_db: list[float]
    phase_deg: list[float]
    printed_db: list[float]
    resonance_rad_s: float
    damping_ratio: float


@dataclass(frozen=True)
class Slewing:
    """Effects that the linearisation at rest leaves out: the crane slews at full speed."""

    slew_rate_rad_s: float
    omegas_rad_s: tuple[float, float]
    peak_g11: float
    peak_g21: float


def grapple_data(grapple: Grapple | None = None) -> GrappleData:
    """The simulated grapple for the CasADi model."""
    data = asdict(grapple or Grapple())
    data.pop("g_m_s2")
    return GrappleData(**data)


def bode() -> tuple[BodeCurve, BodeCurve]:
    """G11 and G22 at rest at the paper's radius of 3 m."""
    grapple = grapple_data()
    modes = sway_modes(grapple)
    omega = np.geomspace(LOW_RAD_S, HIGH_RAD_S, _POINTS)
    matrix = _response(linearise(grapple, OperatingPoint(RADIUS_M)), omega)
    curves = []
    # Eq. 12 as printed has the numerators 1/(l1 + l2) and 3/l2 over g/(l1 + l2) and g/l2.
    long, short = grapple.l1_m + grapple.l2_m, grapple.l2_m
    for i, (name, mode, gain, length, damping) in enumerate(
        (
            ("G11", modes.mode5, 1.0 / long, long, grapple.c5_n_m_s_rad),
            ("G22", modes.mode6, 3.0 / short, short, grapple.c6_n_m_s_rad),
        )
    ):
        values = matrix[:, i, i]
        s = 1j * omega
        twice = damping / (grapple.m2_kg * length**2)
        printed = gain * s**2 / (s**2 + twice * s + GRAVITY_M_S2 / length)
        curves.append(
            BodeCurve(
                name,
                omega.tolist(),
                (20.0 * np.log10(np.abs(values))).tolist(),
                np.degrees(np.unwrap(np.angle(values))).tolist(),
                (20.0 * np.log10(np.abs(printed))).tolist(),
                mode.omega_rad_s,
                mode.damping_ratio,
            )
        )
    return curves[0], curves[1]


def slewing() -> Slewing:
    """Modes and gains while the assumed crane slews at full speed at 3 m."""
    rate = CraneParameters().slew_full_speed_rad_s
    point = OperatingPoint(RADIUS_M, rate)
    modes = sway_modes(grapple_data(), point)
    matrix = _response(
        linearise(grapple_data(), point), np.geomspace(LOW_RAD_S, HIGH_RAD_S, _POINTS)
    )
    peaks = np.abs(matrix).max(axis=0)
    omegas = (modes.mode5.omega_rad_s, modes.mode6.omega_rad_s)
    return Slewing(rate, omegas, float(peaks[0, 0]), float(peaks[1, 0]))


def dc_gains_are_zero() -> tuple[str, ...]:
    """Names of the G_ij that are zero at every frequency at rest; all six are zero at s = 0."""
    matrix = closed_form(grapple_data(), OperatingPoint(RADIUS_M))
    return tuple(
        f"G{i + 1}{j + 1}"
        for i, row in enumerate(matrix)
        for j, entry in enumerate(row)
        if not np.any(entry.num)
    )


def figure_numbers(curves: tuple[BodeCurve, BodeCurve], turning: Slewing) -> dict[str, object]:
    """Key numbers of figure 6 for JSON."""
    return {
        "radius_m": RADIUS_M,
        "curves": {
            curve.name: {
                "natural_frequency_rad_s": round(curve.resonance_rad_s, 4),
                "damping_ratio": round(curve.damping_ratio, 4),
                "peak_db": round(max(curve.magnitude_db), 2),
                "high_frequency_gain": round(10.0 ** (curve.magnitude_db[-1] / 20.0), 3),
            }
            for curve in curves
        },
        "apart_pct": round(apart_pct(curves), 1),
        "slewing": {
            "slew_rate_rad_s": turning.slew_rate_rad_s,
            "natural_frequencies_rad_s": [round(w, 3) for w in turning.omegas_rad_s],
            "peak_g11": round(turning.peak_g11, 1),
            "peak_g21": round(turning.peak_g21, 1),
        },
    }


def apart_pct(curves: tuple[BodeCurve, BodeCurve]) -> float:
    """How far the two natural frequencies lie apart, percent of the lower one."""
    low, high = sorted(curve.resonance_rad_s for curve in curves)
    return 100.0 * (high / low - 1.0)


def _response(sway: LinearSway, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    return np.array([sway.at(complex(0.0, w)) for w in omega], dtype=complex)
