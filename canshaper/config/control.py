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
    """By default ``control.sock`` in the service's directory, /run/canshaper/NAME."""
    mode: str = Field(
        "0600", pattern="^0[0-7]{3}$", description="file mode of the socket, octal, in quotes"
    )
    adjustable: dict[str, Annotated[list[End], Field(min_length=2, max_length=2)]] = Field(
        min_length=1, description="least and most of each number, by its keys with dots between"
    )

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
