import struct
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from canshaper.report.style import save
from studies.paper.draw import optimum_figure, pole_figure
from studies.paper.draw_bode import bode_figure
from studies.paper.runs import METRICS
from studies.paper.study import FIGURES, Study
from studies.paper.style import MINUS, PLANT_COLOUR, change, poles


def drawn(study: Study, number: int) -> Figure:
    if number == 6:
        return bode_figure(study.curves(), study.turning().omegas_rad_s)
    if number in (3, 4):
        return pole_figure(study.ladder(number))
    return optimum_figure(study.optimal(number), study.claims(number))


@pytest.fixture(scope="module")
def figures(study: Study) -> dict[int, Figure]:
    return {n: drawn(study, n) for n in FIGURES}


@pytest.mark.slow
@pytest.mark.parametrize("number", FIGURES)
def test_png_of_the_right_size(figures: dict[int, Figure], number: int, tmp_path: Path) -> None:
    path = tmp_path / "figure.png"
    save(figures[number], path)
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert data.endswith(b"IEND\xaeB`\x82")
    assert struct.unpack(">II", data[16:24]) == (1600, 800 if number in (4, 8) else 1000)
    assert len(data) > 50_000


def headline(fig: Figure) -> str:
    title: str = fig.get_suptitle()
    return title


@pytest.mark.slow
@pytest.mark.parametrize(("number", "plane"), [(3, "perpendicular"), (4, "parallel")])
def test_pole_titles_carry_the_peaks(
    figures: dict[int, Figure], study: Study, number: int, plane: str
) -> None:
    for run, _ in (study.ladder(number)[0], study.ladder(number)[-1]):
        swing = run.swing("perpendicular" if plane == "perpendicular" else "parallel", "peak")
        reported = f"{change(swing.reduction_pct)} ({poles(run.poles_rad_s)})"
        assert reported in headline(figures[number])


@pytest.mark.slow
@pytest.mark.parametrize("number", [7, 8])
def test_optimum_titles_carry_every_reading(
    figures: dict[int, Figure], study: Study, number: int
) -> None:
    run, title = study.optimal(number)[0], headline(figures[number])
    for plane in run.planes:
        for metric in METRICS:
            assert change(run.swing(plane, metric).reduction_pct) in title
    assert ("residual only" in title) == (number == 7)
    assert ("in every reading" in title) == (number == 8)


@pytest.mark.slow
def test_bode_title_and_names(figures: dict[int, Figure]) -> None:
    assert headline(figures[6]) == (
        "The two swings lie 7 % apart: 2.67 rad/s across the boom, 2.86 rad/s along it"
    )
    texts = {text.get_text() for panel in figures[6].axes for text in panel.texts}
    assert {"G11", "G22", "G11 as printed", "G22 as printed"} <= texts


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 4, 7, 8])
def test_panels_have_units_and_numbers_in_the_colour_of_their_plant(
    figures: dict[int, Figure], study: Study, number: int
) -> None:
    fig = figures[number]
    labels = [label for panel in fig.axes if (label := panel.get_ylabel())]
    assert labels[0] == "command, % of full speed"
    assert len(labels) == 1 + len(study.optimal(7 if number in (3, 7) else 8)[0].planes)
    assert all(label.endswith(", °") for label in labels[1:])
    assert all(not panel.get_legend() for panel in fig.axes)
    pairs = study.ladder(number) if number in (3, 4) else [study.optimal(number)]
    for run in (r for pair in pairs for r in pair):
        residual = f"residual {change(run.swing(run.planes[0], 'residual').reduction_pct)}"
        assert any(
            text.get_text().endswith(residual) and text.get_color() == PLANT_COLOUR[run.plant]
            for panel in fig.axes
            for text in panel.texts
        )


@pytest.mark.slow
@pytest.mark.parametrize("number", FIGURES)
def test_nothing_leaves_the_picture(figures: dict[int, Figure], number: int) -> None:
    fig = figures[number]
    fig.draw_without_rendering()
    boxes = [text.get_window_extent() for text in fig.texts]
    boxes += [box for panel in fig.axes if (box := panel.get_tightbbox()) is not None]
    for box in boxes:
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= fig.bbox.x1
        assert box.y1 <= fig.bbox.y1


def test_words_for_numbers() -> None:
    assert change(63.4) == f"{MINUS}63 %"
    assert change(-4.0) == "+4 %"
    assert change(0.2) == "0 %"
    assert change(None) == "-"
    assert poles((-3.0, -3.0)) == f"{MINUS}3, {MINUS}3"
    assert poles((-2.3424, -3.5576)) == f"{MINUS}2.34, {MINUS}3.56"
