"""The limit-aware optimal feedforward filter G_FF (paper Eq. 13) as feedback from a sway model.

    G_FF(s) = (s^2/w^2 + 2 zeta s/w + 1) / (a2 s^2 + a1 s + 1)

    output           v* = u - K1 angle - K2 (rate + u)       u: operator's command
    model update     x += F (angle, rate + v)                v: v* after all limits and rounding

Why: docs/decisions.md#feedback-on-what-was-sent.
"""

import math
from collections.abc import Sequence
from typing import Self

from canshaper.shaping.shapers.kind import Parameter, Parameters, Shaper, ShaperKind
from canshaper.shaping.sway import SwayMode, SwayModel


class Gff:
    """The limit-aware G_FF for one sway mode, tick and pair of real poles.

    Args:
        sway: the sway model of the axis; its owner steps it with the velocity really sent.
        poles_rad_s: the two poles of the filter, real and negative.
        third_pole_rad_s: a third real pole, as a first-order lag on the command: without it a step
            on the joystick comes out at once as 1/(a2 w^2) times the command.

    Raises:
        ValueError: a pole is not negative or too fast for the tick.
    """

    __slots__ = ("_command", "_sway", "_third", "k1", "k2", "poles_rad_s", "share")

    def __init__(
        self,
        sway: SwayModel,
        poles_rad_s: tuple[float, float],
        third_pole_rad_s: float | None = None,
    ) -> None:
        # Faster than 1/T the sampled filter is a dead-beat one that no valve can follow.
        fastest = -1.0 / sway.tick_s
        for pole in (*poles_rad_s, *([] if third_pole_rad_s is None else [third_pole_rad_s])):
            if not fastest <= pole < 0.0:
                raise ValueError(
                    f"pole: expected {fastest:g} to below 0 rad/s at a tick of {sway.tick_s:g} s,"
                    f" got {pole:g} rad/s"
                )
        self._sway = sway
        self._third = third_pole_rad_s
        self._command = 0.0
        self.poles_rad_s = poles_rad_s
        self.follow(1.0)

    def prepare(self, least: float, most: float) -> None:
        """Do nothing: ``follow`` needs no preparation here."""

    def follow(self, factor: float) -> None:
        """Adapt the gains to the present sway model; the poles become slower by the factor.

        Args:
            factor: period of the swing over the period that the filter was made for.
        """
        sway, third = self._sway, self._third
        # The lag reaches exp(p T) in the tick of the step; a share of 1 is no lag.
        self.share = 1.0 if third is None else -math.expm1(third / factor * sway.tick_s)
        d1, d2 = (math.expm1(p / factor * sway.tick_s) for p in self.poles_rad_s)
        # In increments d = z - 1 the closed loop F - F (0,1) K has trace d1 + d2, determinant
        # d1 d2; det(F) is the product of the sway poles' own increments.
        swing = sway.mode.pole * sway.tick_s
        det_f = (
            math.expm1(swing.real) ** 2
            + 4.0 * math.exp(swing.real) * math.sin(0.5 * swing.imag) ** 2
        )
        dc = d1 * d2 / det_f
        self.k2 = 1.0 - dc
        self.k1 = (sway.f11 + sway.f22 * dc - d1 - d2) / sway.f12

    @classmethod
    def from_denominator(
        cls, sway: SwayModel, a1: float, a2: float, third_pole_rad_s: float | None = None
    ) -> Self:
        """Make the filter from the denominator a2 s^2 + a1 s + 1 of Eq. 13 (a1 in s, a2 in s^2)."""
        return cls(sway, poles_from_denominator(a1, a2), third_pole_rad_s)

    def step(self, command: float) -> float:
        """Return the output that the filter asks for, before limits; ``command`` in [-1, 1]."""
        sway = self._sway
        self._command += self.share * (command - self._command)
        command = self._command
        angle, rate = sway.angle + sway.free_angle, sway.rate + sway.free_rate
        return command - self.k1 * angle - self.k2 * (rate + command)

    def copy_state(self, old: "Gff") -> None:
        """Copy the state of another filter of this class; the swing is in the sway model."""
        self._command = old._command

    def reset_to_steady_state(self, command: float) -> None:
        """Set the memory as if the command had been constant for long."""
        self._command = command


def poles_from_denominator(a1: float, a2: float) -> tuple[float, float]:
    """Poles of 1 / (a2 s^2 + a1 s + 1), rad/s, the faster one first.

    Raises:
        ValueError: a1 or a2 is not positive, or the poles are not real (paper Eq. 14d).
    """
    if not (math.isfinite(a1) and math.isfinite(a2) and a1 > 0.0 and a2 > 0.0):
        raise ValueError(f"a1, a2: expected positive numbers, got {a1:g}, {a2:g}")
    discriminant = a1 * a1 - 4.0 * a2
    if discriminant < 0.0:
        raise ValueError(
            f"a1: expected {2.0 * math.sqrt(a2):.6g} or more for a2 = {a2:g}"
            f" (real poles, a1^2 >= 4 a2), got {a1:g}"
        )
    # Citardauq's form: no cancellation when the poles lie far apart.
    q = -0.5 * (a1 + math.sqrt(discriminant))
    return q / a2, 1.0 / q


def denominator_from_poles(poles_rad_s: tuple[float, float]) -> tuple[float, float]:
    """Return (a1, a2) of 1 + a1 s + a2 s^2 with these two negative poles."""
    p, q = poles_rad_s
    return -(1.0 / p + 1.0 / q), 1.0 / (p * q)


def _gff(
    sway: SwayModel,
    *,
    a1: float | None = None,
    a2: float | None = None,
    poles_rad_s: Sequence[float] | None = None,
    third_pole_rad_s: float | None = None,
) -> Shaper:
    if poles_rad_s is not None:
        return Gff(sway, (poles_rad_s[0], poles_rad_s[1]), third_pole_rad_s)
    if a1 is not None and a2 is not None:
        return Gff.from_denominator(sway, a1, a2, third_pole_rad_s)
    raise ValueError("expected a1 and a2, or poles_rad_s, got neither")


def _check(**parameters: float) -> None:
    given = parameters.keys() - {"third_pole_rad_s"}
    if given == {"a1", "a2"}:
        poles_from_denominator(parameters["a1"], parameters["a2"])
    elif given != {"poles_rad_s"}:
        got = ", ".join(sorted(given)) or "neither"
        raise ValueError(f"expected a1 and a2, or poles_rad_s, got {got}")


def _by_poles(parameters: Parameters) -> Parameters:
    """Return the parameters as poles: between two denominators the poles may become complex."""
    rest = dict(parameters)
    if "a1" in rest:
        rest["poles_rad_s"] = poles_from_denominator(rest.pop("a1"), rest.pop("a2"))
    return rest | {"poles_rad_s": sorted(rest["poles_rad_s"])}


def _followed(parameters: Parameters, factor: float) -> Parameters:
    """Return the parameters for a swing of ``factor`` times the period; see ``Gff.follow``."""
    power = {"a1": factor, "a2": factor**2, "third_pole_rad_s": 1.0 / factor}
    new = {name: one * power[name] for name, one in parameters.items() if name in power}
    if "poles_rad_s" in parameters:
        new["poles_rad_s"] = [pole / factor for pole in parameters["poles_rad_s"]]
    return parameters | new


def _settings(mode: SwayMode, _tick_s: float) -> dict[str, Parameters]:
    omega = mode.omega_rad_s
    return {
        "G_FF slew poles": {"a1": 0.42, "a2": 0.043},
        "G_FF near-far poles": {"a1": 0.708, "a2": 0.12},
        "G_FF no jump over 1": {"a1": 2.0000001 / omega, "a2": 1.0 / omega**2},
        "G_FF third pole -4": {"poles_rad_s": [-4.0, -4.0], "third_pole_rad_s": -4.0},
        "G_FF third pole -5": {"poles_rad_s": [-5.0, -5.0], "third_pole_rad_s": -5.0},
    }


_PARAMETERS = (
    Parameter("a1", 1e-3, 20, "s", "coefficient a1 of the denominator", optional=True),
    Parameter("a2", 1e-6, 100, "s^2", "coefficient a2 of the denominator", optional=True),
    Parameter(
        "poles_rad_s", -100, -0.1, "rad/s", "pole of the filter", optional=True, entries=(2, 2)
    ),
    Parameter(
        "third_pole_rad_s",
        -100,
        -0.1,
        "rad/s",
        "a third pole, which removes the first jump",
        optional=True,
    ),
)
KINDS = (
    ShaperKind(
        "gff",
        "The limit-aware G_FF, by a1 and a2 (its denominator) or by its poles.",
        _gff,
        _settings,
        _PARAMETERS,
        needs_sway=True,
        limit_aware=True,
        check=_check,
        interpolable=_by_poles,
        follows=_followed,
        designed_by="tune",
        runs_ahead=True,
    ),
)
