"""Draw docs/architecture.svg: the rooms in their layers, from the import contracts and the code.

What each room is for is the docstring of its package; the way of one joystick frame to its valve is
marked. ``tools/architecture.py --check`` says whether the drawing is that of the tree. The table of
rings, which ``make generate`` writes into docs/architecture.md, is made here too.
"""

import ast
import sys
import tomllib
from collections.abc import Iterator
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docs" / "architecture.svg"
# Stops of a joystick frame: bus, I/O cycle, routing, what is known of the message, axis, valve.
PATH = ("bus", "daemon", "controller", "inputs", "shaping", "codec")
DESK = ("cli", "studio", "campaign", "native", "commissioning", "recording", "design", "report")
WIDTH, ROW, LEFT = 960, 46, 24
# Rings by what an error can do: who reviews a change, and rooms below canshaper/. A room within
# another one belongs to the ring that names it.
RINGS = {
    # The last two decide too which frame leaves: without them none would pass the gate.
    "gate": (
        "someone who did not write it, every line, against safety.md",
        ("gate", "controller/gated", "blackbox/recorder"),
    ),
    "runtime": (
        "a maintainer; golden drives equal to the bit",
        (
            *("errors", "shipped", "checksums", "shaping", "config", "codec", "machine", "inputs"),
            *("bus", "protocols", "controller", "blackbox", "daemon"),
        ),
    ),
    "on the machine": (
        "a maintainer; tests of what moves a valve or writes a file",
        (
            "edit",
            *("commissioning/calibration", "commissioning/doctor", "commissioning/monitor"),
            *("commissioning/nodes", "commissioning/procedure", "commissioning/sensor"),
        ),
    ),
    "exported": (
        "a maintainer; equal to Python to the last bit. No gate stands behind it: the ECU bounds"
        " its valves itself",
        ("native",),
    ),
    "desk": (
        "its tests",
        ("api", "report", "design", "recording", "commissioning", "campaign", "studio", "cli"),
    ),
}
STYLE = """
  text { font: 13px sans-serif; fill: #1c2733 } .name { font-weight: bold }
  .note { font-size: 11px; fill: #51606e } rect { stroke: #8195a8; rx: 5 }
  .desk { fill: #f4f1ea } .daemon { fill: #e7f0f8 } .path { stroke: #c2571a; stroke-width: 2.5 }
  .stop { fill: #c2571a } .number { fill: white; font-weight: bold; text-anchor: middle }
"""


def purpose(room: str) -> str:
    """Return the first paragraph of a room's docstring in one line; empty without one."""
    place = ROOT / "canshaper" / room
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    doc = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return doc.split("\n\n", maxsplit=1)[0].replace("\n", " ")


def layers() -> list[list[str]]:
    """Return the rows of the import contract, top to bottom; rooms of a row stand side by side."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    rows = contracts["contracts"][0]["layers"]
    return [[name.strip().removeprefix("canshaper.") for name in row.split("|")] for row in rows]


def ring_rows() -> Iterator[str]:
    """Yield the Markdown table of the rings; lines of Python and C in thousands, 1 at least.

    Raises:
        ValueError: a module, other than ``__init__`` and ``__main__``, is in no ring.
    """
    package = ROOT / "canshaper"
    lines = dict.fromkeys(RINGS, 0)
    rings = {room: ring for ring, (_, rooms) in RINGS.items() for room in rooms}
    for file in sorted(one for end in ("py", "c", "h") for one in package.rglob(f"*.{end}")):
        name = file.relative_to(package).with_suffix("")
        places = [place.as_posix() for place in (name, *name.parents)]
        ring = next((rings[place] for place in places if place in rings), None)
        if ring is None and name.stem not in ("__init__", "__main__"):
            raise ValueError(f"expected {name} in RINGS of tools/architecture.py, got no ring")
        if ring is not None:
            lines[ring] += len(file.read_text(encoding="utf-8").splitlines())
    yield "| ring | rooms | lines | reviewed by |"
    yield "|---|---|---|---|"
    for ring, (review, rooms) in RINGS.items():
        thousands = max(1, round(lines[ring] / 1000))
        yield f"| {ring} | {', '.join(rooms)} | {thousands} 000 | {review} |"


def box(room: str, left: float, top: float, width: float) -> list[str]:
    """Return a room as lines of SVG (px): name, purpose, its number on the way of a frame."""
    kind = "desk" if room in DESK else "daemon"
    on_path = " path" if room in PATH else ""
    text = purpose(room)
    most = round((width - 20) / 5.6)  # letters of 11 px
    if len(text) > most:
        text = text[: most - 2].rsplit(" ", 1)[0].rstrip(",;:") + " ..."
    shape = f'x="{left:g}" y="{top:g}" width="{width:g}" height="{ROW - 8}"'
    lines = [f'<rect class="{kind}{on_path}" {shape}/>']
    lines.append(f'<text class="name" x="{left + 10:g}" y="{top + 16:g}">{escape(room)}</text>')
    lines.append(f'<text class="note" x="{left + 10:g}" y="{top + 31:g}">{escape(text)}</text>')
    if on_path:
        x, y = left + width - 14, top + 14
        lines.append(f'<circle class="stop" cx="{x:g}" cy="{y:g}" r="9"/>')
        number = PATH.index(room) + 1
        lines.append(f'<text class="number" x="{x:g}" y="{y + 4.5:g}">{number}</text>')
    return lines


def drawing() -> str:
    """Return the text of the SVG file."""
    body: list[str] = []
    top = 44.0
    for row in layers():
        width = (WIDTH - 2 * LEFT - 10 * (len(row) - 1)) / len(row)
        for place, room in enumerate(row):
            body += box(room, LEFT + place * (width + 10), top, width)
        top += ROW
    stops = " > ".join(f"{number} {room}" for number, room in enumerate(PATH, 1))
    foot = f"orange: the way of a joystick frame to its valve frame: {stops} > bus"
    head = "A room imports from the rooms below it only. Sand: at the desk; blue: in the daemon."
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top + 30:g}">',
            f"<style>{STYLE}</style>",
            '<rect width="100%" height="100%" style="fill:white;stroke:none"/>',
            f'<text x="{LEFT}" y="28">{head}</text>',
            *body,
            f'<text class="note" x="{LEFT}" y="{top + 14:g}">{escape(foot)}</text>',
            "</svg>\n",
        ]
    )


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        if FILE.read_text(encoding="utf-8") != drawing():
            sys.exit(f"{FILE.relative_to(ROOT)}: expected the drawing of this tree: make drawing")
    else:
        FILE.write_text(drawing(), encoding="utf-8")
