"""A deployment file to be written to."""

from pathlib import Path

from canshaper.edit.edit import FileValue

FILE = Path(__file__).resolve().parents[2] / "config" / "forwarder.yaml"
SLEW = ("axes", "slew", "filter")
NEW: dict[str, FileValue] = {
    "a1": 0.7,
    "a2": 0.12233,
    "third_pole_rad_s": None,
    "poles_rad_s": None,
}


def gff_line(text: str, line: str) -> str:
    old = "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
    assert text.count(old) == 1
    return text.replace(old, line)
