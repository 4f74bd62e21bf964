"""Surroundings that act on the grapple: ground, carrier, wind, and the log on its rotator."""

from dataclasses import dataclass

from canshaper_sim.carrier import Carrier
from canshaper_sim.contact import ContactParameters
from canshaper_sim.grapple import Grapple, Push, Sway, TipMotion, accelerations, pushed, rest
from canshaper_sim.rotator import Rotator
from canshaper_sim.wind import Wind


@dataclass(slots=True)
class Surroundings:
    """The surroundings of one crane; an absent one is None."""

    contact: ContactParameters | None
    carrier: Carrier | None
    wind: Wind | None
    rotator: Rotator | None

    @property
    def none(self) -> bool:
        """True if there are none: the grapple hangs free from a crane on level ground."""
        return not (self.contact or self.carrier or self.wind or self.rotator)

    def settle(self, grapple: Grapple, tip: TipMotion) -> None:
        """Let the carrier, if there is one, lean under the grapple at rest."""
        for _ in range(4):  # each leans on the other, by less every time
            if self.carrier:
                sway = Sway(*self.rest(grapple, tip.slew_rad, tip.radius_m))
                self.carrier.settle(grapple, sway, tip)

    def rest(self, grapple: Grapple, slew_rad: float, radius_m: float) -> tuple[float, float]:
        """Return (theta5, theta6) in rad at rest in this wind, on this carrier, without ground."""
        theta5, theta6 = rest(grapple, *self.pushes(grapple, slew_rad, radius_m))
        askew = self.rotator.lean(grapple) if self.rotator else (0.0, 0.0)
        return theta5 + askew[0], theta6 + askew[1]

    def advance(self, step_s: float, grapple: Grapple, sway: Sway, tip: TipMotion) -> None:
        """Move wind, rotator and carrier on by step_s seconds."""
        if self.wind:
            self.wind.advance(step_s)
        if self.rotator:
            self.rotator.axis.advance(step_s)
        if self.carrier:
            self.carrier.advance(step_s, grapple, sway, tip)

    def accelerations(
        self, grapple: Grapple, sway: tuple[float, float, float, float], tip: TipMotion
    ) -> tuple[float, float]:
        """Return (theta5'', theta6'') of this sway with all surroundings, rad/s^2."""
        across, along = accelerations(grapple, sway, tip)
        if self.contact:
            held = self.contact.accelerations(grapple, sway, tip)
            across, along = across + held[0], along + held[1]
        if self.carrier or self.wind:
            more = pushed(grapple, sway, *self.pushes(grapple, tip.slew_rad, tip.radius_m))
            across, along = across + more[0], along + more[1]
        if self.rotator:
            return self.rotator.accelerations(grapple, tip, (across, along))
        return across, along

    def pushes(self, grapple: Grapple, slew_rad: float, radius_m: float) -> tuple[Push, Push]:
        """Return the forces of slope, rocking and wind on link and on grapple, N/kg."""
        link = self.carrier.push(slew_rad, radius_m) if self.carrier else (0.0, 0.0, 0.0)
        if self.wind is None:
            return link, link
        out, across, up = self.wind.push(slew_rad, grapple.m2_kg)
        return link, (link[0] + out, link[1] + across, link[2] + up)
