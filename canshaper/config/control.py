"""What may be changed while the machine works, and by whom."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from canshaper.config.section import Section, number

# Where the service has a directory for each instance (RuntimeDirectory of the unit).
RUNTIME = Path("/run/canshaper")
End = Annotated[float, number(-1e6, 1e6, "", "end of the range, in the number's own unit")]


class Control(Section):
    """The control socket of the daemon, and the numbers that ``canshaper set`` may change."""

    socket: str | None = Field(None, description="path of the socket")
    """Where the daemon listens, by default /run/canshaper/NAME/control.sock, NAME of the file; the
    option --control PATH of run and set is another place."""
    mode: str = Field("0600", pattern="^0[0-7]{3}$")
    """File mode of the socket, octal, in quotes: who may write to it may change the numbers."""
    adjustable: dict[str, Annotated[list[End], Field(min_length=2, max_length=2)]] = Field(
        min_length=1
    )
    """Least and most of each number of sway and filter in the file, and of max_pct, rise_per_s,
    fall_per_s of limits, by its keys with dots between. Not on axes with gain_schedule or
    profiles."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for key, (low, high) in self.adjustable.items():
            if not low <= high:
                text = f"{key}: expected the lower end first, got {low:g} to {high:g}"
                raise ValueError(text)
        return self

    def path(self, file: Path) -> Path:
        """Where the socket is, for a deployment file."""
        return Path(self.socket) if self.socket else RUNTIME / file.stem / "control.sock"
