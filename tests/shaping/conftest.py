import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.states import CommandInput, State, Transition
from canshaper.shaping.sway import SwayMode, SwayModel

TICK_S = 0.02
MODE = SwayMode(2.86, 0.05)
POLES = (-5.655, -4.112)


class Drive:
    """An axis with what a test does to it all the time."""

    def __init__(
        self,
        shaper: Shaper | None = None,
        limits: OutputLimits | None = None,
        *,
        stop_s: float = 2.0,
        grid_steps: int = 125,
        tick_s: float = TICK_S,
    ) -> None:
        self.tick_s = tick_s
        self.limits = limits or OutputLimits(tail_s=0.5)
        self.model = SwayModel(MODE, tick_s)
        self.axis = ShapedAxis(
            tick_s,
            self.limits,
            sway=self.model,
            shaper=shaper or Gff(self.model, POLES),
            stop_s=stop_s,
            grid_steps=grid_steps,
        )
        self.raw: list[int] = []
        self.sent: list[float] = []

    @property
    def state(self) -> State:
        return self.axis.state

    def tick(self, joystick: CommandInput) -> Transition | None:
        transition = self.axis.tick(joystick)
        self.raw.append(self.axis.output.steps)
        self.sent.append(self.axis.output.setpoint)
        return transition

    def run(self, joystick: CommandInput, duration_s: float) -> list[Transition]:
        """Keep an input for a while; what changed meanwhile."""
        seen = [self.tick(joystick) for _ in range(round(duration_s / self.tick_s))]
        return [transition for transition in seen if transition is not None]

    def to_ready(self) -> "Drive":
        self.run(CommandInput(), 2 * self.tick_s)
        assert self.state is State.READY
        return self

    def moving(self, command: float = 0.8, *, bypass: bool = False) -> "Drive":
        """Half a second of a held joystick from rest."""
        self.to_ready().run(CommandInput(command, bypass=bypass), 0.5)
        assert self.state is (State.BYPASS_ON if bypass else State.ACTIVE)
        assert self.axis.output.steps != 0
        return self


@pytest.fixture
def drive() -> Drive:
    """G_FF between default limits, run-on of half a second."""
    return Drive()


@pytest.fixture
def drive_with() -> type[Drive]:
    return Drive
