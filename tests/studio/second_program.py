"""Figures of a table of a study, computed by themselves: nothing of canshaper is in here."""

import csv
import math
import re
from pathlib import Path


def figures(path: Path) -> dict[str, dict[str, dict[str, str]]]:
    """By study and setting: the figures of a page, as it writes them."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    by_setting = {}
    for setting in sorted({row["setting"] for row in rows}):
        own = [row for row in rows if row["setting"] == setting]
        done = [r for r in own if r["practice"] == "0" and r["outcome"] in ("hit", "miss")]
        seconds = [float(row["seconds"]) for row in done]
        bits = [math.log(float(r["distance_m"]) / float(r["width_m"]) + 1, 2) for r in done]
        mean_s, mean_bits = sum(seconds) / len(done), sum(bits) / len(done)
        slope = sum((b - mean_bits) * (s - mean_s) for b, s in zip(bits, seconds, strict=True))
        slope /= sum((b - mean_bits) ** 2 for b in bits)
        by_setting[setting] = {
            "placed": str(len(done)),
            "hit %": f"{100 * sum(row['outcome'] == 'hit' for row in done) / len(done):.0f}",
            "seconds geom. mean": f"{math.prod(seconds) ** (1 / len(done)):.2f}",
            "s a bit": f"{slope:.2f}",
            "off cm": f"{100 * middle([float(row['error_m']) for row in done]):.1f}",
            "swing deg": f"{middle([float(row['swing_deg']) for row in done]):.1f}",
            "practice": str(sum(r["practice"] == "1" and r["outcome"] != "broken" for r in own)),
            "broken off": str(sum(row["outcome"] == "broken" for row in own)),
        }
    return {rows[0]["study"]: by_setting}


def middle(values: list[float]) -> float:
    """The median."""
    ordered, half = sorted(values), len(values) // 2
    return ordered[half] if len(values) % 2 else (ordered[half - 1] + ordered[half]) / 2


def of_page(page: str) -> dict[str, dict[str, str]]:
    """Return those figures as the page of a person has them."""
    table = page.partition('<table class="figures">')[2].partition("</table>")[0]
    rows = [
        [" ".join(cell.split()) for cell in re.findall(r"<t[dh].*?>(.*?)</t[dh]>", row, re.S)]
        for row in re.findall(r"<tr>(.*?)</tr>", table, re.S)
    ]
    return {row[0]: dict(zip(rows[0][1:], row[1:], strict=True)) for row in rows[1:]}
