import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from canshaper.report.metrics import report_dict
from canshaper.report.plot import draw, figure
from canshaper.report.style import RAW_COLOUR, SHAPED_COLOUR
from canshaper_sim.recording import Recording

Pair = tuple[Recording, Recording]


@pytest.fixture
def report(pair: Pair) -> dict[str, Any]:
    return report_dict(*pair, transport="vcan0", missed_deadlines=0)


def titles(fig: Figure) -> list[str]:
    return [title for panel in fig.axes if (title := panel.get_title(loc="left"))]


def test_picture_is_a_png_of_the_right_size(
    pair: Pair, report: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / "demo.png"
    draw(*pair, report, path)
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == (1600, 1000)
    assert data.endswith(b"IEND\xaeB`\x82")
    assert len(data) > 30_000


def test_titles_state_the_finding_with_its_numbers(pair: Pair, report: dict[str, Any]) -> None:
    near_far, slew = titles(figure(*pair, report))
    axis = report["axes"]["near_far"]
    assert near_far == (
        f"Near-far: residual swing {axis['raw']['residual_deg']:.1f}° → "
        f"{axis['shaped']['residual_deg']:.1f}° "
        f"(\N{MINUS SIGN}{axis['residual_reduction_pct']:.0f} %)"
    )
    axis = report["axes"]["slew"]
    assert slew.startswith(f"Slew: residual swing {axis['raw']['residual_deg']:.1f}° → ")
    assert f"other plane {axis['raw']['cross_residual_deg']:.1f}° → " in slew


def test_each_axis_with_sway_has_a_command_and_a_sway_panel_on_one_time(
    pair: Pair, report: dict[str, Any]
) -> None:
    panels = figure(*pair, report).axes
    assert [panel.get_ylabel() for panel in panels] == ["command, %", "sway, degrees"] * 2
    assert len({panel.get_xlim() for panel in panels}) == 1
    for panel in panels:
        colours = [line.get_color() for line in panel.get_lines()]
        assert {RAW_COLOUR, SHAPED_COLOUR} <= set(colours)
        assert panel.patches, "the residual windows are shaded"


def test_curves_are_named_with_the_numbers_of_the_report(
    pair: Pair, report: dict[str, Any]
) -> None:
    panels = figure(*pair, report).axes
    for name, panel in (("near_far", panels[1]), ("slew", panels[3])):
        axis = report["axes"][name]
        assert {text.get_text() for text in panel.texts} == {
            f"filters off: {axis['raw']['residual_deg']:.1f}°",
            f"filters on: {axis['shaped']['residual_deg']:.1f}°",
        }


def test_nothing_drawn_leaves_the_picture(pair: Pair, report: dict[str, Any]) -> None:
    fig = figure(*pair, report)
    fig.draw_without_rendering()
    frame = fig.bbox
    for panel in fig.axes:
        box = panel.get_tightbbox()
        assert box is not None
        assert box.x0 >= 0
        assert box.x1 <= frame.x1
        assert box.y0 >= 0
        assert box.y1 <= frame.y1


def test_without_a_residual_window_the_peak_is_told(
    hand_made: Callable[..., Recording], tmp_path: Path
) -> None:
    def stick(t: float) -> float:
        return 1.0 if 0.5 <= t < 1.5 else 0.0

    def drive(swing: float) -> Recording:
        return hand_made(2.0, slew=(stick, stick, stick, lambda t: swing * (t > 1.0)))

    raw, shaped = drive(-8.0), drive(2.0)
    report = report_dict(raw, shaped, transport="vcan0", missed_deadlines=0)
    fig = figure(raw, shaped, report)
    assert titles(fig) == ["Slew: largest swing 8.0° → 2.0° (\N{MINUS SIGN}75 %)"]
    assert not fig.texts, "no shade, no word of it"
    draw(raw, shaped, report, tmp_path / "slew.png")


def test_a_still_crane_can_be_drawn_and_one_without_sway_cannot(
    hand_made: Callable[..., Recording], tmp_path: Path
) -> None:
    def zero(_t: float) -> float:
        return 0.0

    still = hand_made(1.0, slew=(zero, zero, zero, zero))
    report = report_dict(still, still, transport="vcan0", missed_deadlines=0)
    draw(still, still, report, tmp_path / "still.png")
    lift = hand_made(1.0, lift=(zero, zero, zero, None))
    report = report_dict(lift, lift, transport="vcan0", missed_deadlines=0)
    with pytest.raises(ValueError, match="no axis of the drives has sway"):
        draw(lift, lift, report, tmp_path / "lift.png")
