"""Pictures of the steps, as a person opens them and as the report embeds them."""

from collections.abc import Callable
from datetime import datetime
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

import canshaper
from canshaper.machine.deployment import Deployment
from canshaper.report import html
from canshaper.report.style import save, stamp

# All of a report are to stay below 2 MB; a drawing that takes more is a picture of dots there.
MOST_SVG_BYTES = 90_000
COLOURS = 64  # of such a picture


def draw(figure: Callable[[], Figure], path: Path, deployment: Deployment) -> list[Path]:
    """Draw, stamp and write a picture.

    Args:
        figure: draws it.
        path: without its suffix.
        deployment: what it is of.

    Returns:
        The picture (PNG), and where that is small the drawing (SVG).
    """
    drawn = figure()
    date = f"{datetime.now().astimezone():%Y-%m-%d}"
    stamp(drawn, f"{deployment.path.name}, canshaper {canshaper.__version__}, {date}")
    picture, drawing = (path.with_name(f"{path.name}{suffix}") for suffix in (".png", ".svg"))
    save(drawn, picture)
    save(drawn, drawing)
    if drawing.stat().st_size > MOST_SVG_BYTES:
        drawing.unlink()
        return [picture]
    return [picture, drawing]


def embedded(path: Path) -> str:
    """A picture inside the report: a drawing as it is, dots with fewer colours."""
    if path.suffix == ".svg":
        return html.picture(path.read_bytes(), "svg+xml", path.stem)
    file = BytesIO()
    with Image.open(path) as dots:
        few = dots.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        few.save(file, "png", optimize=True)
    return html.picture(file.getvalue(), "png", path.stem)
