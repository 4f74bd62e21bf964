"""Results of a study: the figures of a person, persons in pairs, and how many a change needs."""

import csv
import math
import random
from base64 import b64encode
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.errors import UsageError
from canshaper.studio.study import COLUMNS, KEY, Key, read_key
from canshaper.studio.study_results import SPREAD, person_page, power, rows_of
from tests.studio.second_program import figures, of_page

PLACEMENTS = 9
TARGETS = [(distance, width) for distance in (1.0, 2.0, 4.0) for width in (0.3, 0.6, 1.2)]
LOGS = {"A": 0.0, "B": math.log(0.7), "C": 0.0}
"""B is quicker by 30 %, C as quick as A."""


def written(path: Path, study: str, *, missing: int = 0) -> None:
    """The table of a person who has done all but some placements."""
    source = random.Random(path.stem)
    own = source.gauss(0.0, 0.3)
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, restval="")
        table.writeheader()
        for part, letter in enumerate("BCA", 1):
            shift = own + LOGS[letter] + source.gauss(0.0, 0.02)
            common = {"study": study, "person": path.stem, "input": "keyboard", "order": "BCA"}
            common |= {"part": part, "setting": letter}
            slow = {"seconds": 50.0, "error_m": 2.0, "swing_deg": 40.0}
            for number, kind in enumerate(("practice", "broken", *TARGETS), 1):
                if letter == "A" and number > 2 + len(TARGETS) - missing:
                    break
                distance, width = TARGETS[0] if isinstance(kind, str) else kind
                bits = math.log2(distance / width + 1.0)
                seconds = math.exp(shift + 0.3 * bits)
                row = {"seconds": seconds, "error_m": 0.2, "swing_deg": bits, "outcome": "hit"}
                if isinstance(kind, str):
                    row = {**slow, "outcome": "broken" if kind == "broken" else "miss"}
                elif letter == "A" and number < 6:
                    row["outcome"] = "miss"
                row |= {"number": number, "practice": int(kind == "practice")}
                table.writerow({**common, "distance_m": distance, "width_m": width, **row})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    settings = {"raw": "1", "a.yaml": "1", "b.yaml": "2"}
    key = Key(tmp_path / KEY, settings, {"placements": PLACEMENTS})
    for number in range(1, 9):
        written(tmp_path / f"P{number:02}.csv", key.mark)
    written(tmp_path / "P09.csv", key.mark, missing=1)
    return tmp_path


def test_the_key_is_sealed_and_that_of_one_study(tmp_path: Path) -> None:
    settings, task = {"raw": "1", "a.yaml": "1", "b.yaml": "2"}, {"practice": 2}
    key = Key(tmp_path / KEY, settings, task)
    assert set(key.letters) == set("ABC") and set(key.letters.values()) == set(settings)
    again = Key(tmp_path / KEY, settings, task)
    assert (again.letters, again.seed, again.mark) == (key.letters, key.seed, key.mark)
    assert b"raw" not in (tmp_path / KEY).read_bytes()
    assert read_key(tmp_path / KEY)["letters"] == key.letters
    with pytest.raises(UsageError, match="expected the settings that the study began with"):
        Key(tmp_path / KEY, settings | {"b.yaml": "3"}, task)
    with pytest.raises(UsageError, match="expected the task that the study began with"):
        Key(tmp_path / KEY, settings, task | {"practice": 3})
    for text in (b"{", b64encode(b"{}"), b64encode(b"[]")):
        (tmp_path / KEY).write_bytes(text)
        with pytest.raises(UsageError, match="expected the key of a study"):
            read_key(tmp_path / KEY)


def joined(folder: Path, *options: str) -> str:
    words = ["study", "--folder", str(folder), *options]
    result = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_page_of_a_person_has_the_figures_of_the_table(folder: Path) -> None:
    path = folder / "P01.csv"
    page = person_page("P01", rows_of(path, next(iter(figures(path)))))
    assert of_page(page) == next(iter(figures(path).values()))
    row = of_page(page)["A"]
    assert row["placed"] == "9" and row["hit %"] == "67" and row["broken off"] == "1"
    assert "signature" not in page
    assert "raw" not in page and ".yaml" not in page


def test_persons_are_compared_in_pairs_blind(folder: Path) -> None:
    shown = joined(folder)
    assert "complete: 8 persons; not: P09" in shown
    lines = {line[:7].strip(): line.split() for line in shown.splitlines() if " to " in line[:8]}
    change, bounds = lines["A to B"][3:5]
    assert float(change) == pytest.approx(-30.0, abs=2.0)
    low, high = map(float, bounds.split(".."))
    assert -33.0 < low < float(change) < high < -27.0
    assert abs(float(lines["A to C"][3])) < 2.0
    assert lines["A to B"][5] == "+33.3"  # points of hits
    assert "raw" not in shown and ".yaml" not in shown
    assert not (folder / "study.opened").exists()
    page = (folder / "study.html").read_text()
    assert change in page and "opened" not in page


def test_a_key_that_is_opened_leaves_a_trace(folder: Path) -> None:
    shown = joined(folder, "--unseal")
    names = {name for name in ("raw", "a.yaml", "b.yaml") if name in shown}
    assert len(names) == 3 and "key opened" in shown
    trace = (folder / "study.opened").read_text()
    again = joined(folder)
    assert f"key opened {trace.strip()}" in again and "raw" not in again
    joined(folder, "--unseal")
    assert (folder / "study.opened").read_text() == trace


def test_a_table_of_another_study_is_refused(folder: Path) -> None:
    written(folder / "P10.csv", "77777777")
    result = CliRunner().invoke(app, ["study", "--folder", str(folder)])
    assert result.exit_code == 2
    assert "P10.csv: expected placements of the study" in result.stderr


def test_how_many_persons_a_change_needs(tmp_path: Path) -> None:
    """Those of a simulated spread; the power is that of simulated studies."""
    shown = joined(tmp_path)
    rows = {line.split()[0]: line.split()[1:] for line in shown.splitlines() if line.strip()}
    assert int(rows["16"][2]) >= 80 > int(rows["12"][2])  # for 15 %
    assert int(rows["6"][4]) >= 80 > int(rows["4"][4])  # for 30 %
    source, found, n = random.Random(0), 0, 16
    for _ in range(2000):
        logs = [source.gauss(math.log(0.85), SPREAD) for _ in range(n)]
        mean = math.fsum(logs) / n
        sigma = math.sqrt(math.fsum((one - mean) ** 2 for one in logs) / (n - 1))
        found += abs(mean) / sigma * math.sqrt(n) > 2.1314  # t of 15, 97.5 %
    assert power(n, 15, SPREAD) == pytest.approx(found / 2000, abs=0.03)
