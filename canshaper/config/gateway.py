"""Schema of a gateway in the line: two buses, and what passes between them."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from canshaper.config.section import Section


class Gateway(Section):
    """Two buses with us between them: the joystick's frames leave with our velocity in them."""

    between: Annotated[list[str], Field(min_length=2, max_length=2, description="the two buses")]
    forwarding: Literal["kernel", "daemon"] = "kernel"
    """Who forwards all other frames: the kernel, by rules of can-gw, also while the daemon is away;
    or the daemon, where the kernel has no can-gw: then nothing passes without the daemon."""
    fallback: Literal["stop", "neutral", "pass"] = "stop"
    """Joysticks while the daemon is away. With stop their frames do not pass; with neutral they
    pass with all rewritten axes in neutral; with pass they pass as they are: **the raw joystick
    moves the machine**."""
    blocked: list[str] = Field([], description="messages that are not forwarded, by name")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        first, second = self.between
        if first == second:
            raise ValueError(f"between: expected two different buses, got {first} twice")
        if self.forwarding == "daemon" and self.fallback != "stop":
            raise ValueError(
                f"fallback: expected stop with forwarding: daemon, got {self.fallback}:"
                " without the daemon nothing passes"
            )
        return self

    def other(self, bus: str) -> str | None:
        """The bus on the other side; None for one that is not of the gateway."""
        if bus not in self.between:
            return None
        return self.between[1 - self.between.index(bus)]
