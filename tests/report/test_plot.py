import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")

import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

from canshaper.report.metrics import report_dict
from canshaper.report.plot import figure, gain_and_price
from canshaper.report.style import RAW_COLOUR, SHAPED_COLOUR, save, stamp
from canshaper_sim.recording import CraneTrace, Recording
from tests.report.drives import sampled, zero

Pair = tuple[Recording, Recording]


@pytest.fixture
def report(pair: Pair) -> dict[str, Any]:
    return report_dict(*pair, transport="vcan0", missed_deadlines=0)


@pytest.fixture
def seen(pair: Pair) -> Pair:
    """The pair with tip and grapple: the grapple goes round the tip, shaped by half as much."""

    def from_above(drive: Recording, swing_m: float) -> CraneTrace:
        tip = [(3.0 + 0.1 * t, 0.2 * t) for t in drive.t_s]
        turns = zip(drive.t_s, tip, strict=True)
        grapple = [(x + swing_m * math.cos(t), y + swing_m * math.sin(t)) for t, (x, y) in turns]
        return CraneTrace(tip, grapple, [swing_m * 40.0] * len(tip))

    raw, shaped = pair
    return replace(raw, crane=from_above(raw, 0.6)), replace(shaped, crane=from_above(shaped, 0.3))


def titles(fig: Figure) -> list[str]:
    return [title for panel in fig.axes if (title := panel.get_title(loc="left"))]


def test_picture_is_a_png_of_the_right_size(
    pair: Pair, report: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / "demo.png"
    save(figure(*pair, report), path)
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == (1600, 1594)
    assert data.endswith(b"IEND\xaeB`\x82")
    assert len(data) > 30_000


def test_the_stamp_stands_below_all_else(pair: Pair, report: dict[str, Any]) -> None:
    drawn = figure(*pair, report)
    stamp(drawn, "a-deployment-with-a-long-name.yaml, canshaper 0.1.0, 2026-11-23")
    drawn.draw_without_rendering()
    *texts, last = drawn.texts
    top = last.get_window_extent().y1
    assert all(text.get_window_extent().y0 > top for text in texts)
    assert all(legend.get_window_extent().y0 > top for legend in drawn.legends)


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


def test_paths_of_tip_and_grapple_are_seen_from_above(seen: Pair) -> None:
    report = report_dict(*seen, transport="vcan0", missed_deadlines=0)
    fig = figure(*seen, report)
    assert titles(fig)[-2:] == ["From above, filters off", "From above, filters on"]
    for panel, drive in zip(fig.axes[-2:], seen, strict=True):
        assert panel.get_aspect() == 1.0
        assert drive.crane is not None
        *runs_on, tip, grapple = (line.get_xydata() for line in panel.get_lines())
        assert len(runs_on) == 5  # two strokes overlap, four are alone
        assert np.ptp(tip, axis=0) == pytest.approx(np.ptp(drive.crane.tip_m, axis=0), rel=0.02)
        away = np.linalg.norm(np.asarray(grapple) - np.asarray(tip), axis=1)
        assert max(away) == pytest.approx(drive.crane.sway_deg[0] / 40.0)
    ranges = [(panel.get_xlim(), panel.get_ylim()) for panel in fig.axes[-2:]]
    assert ranges[0] == ranges[1]


def test_gain_and_price_stand_at_the_top(seen: Pair) -> None:
    report = report_dict(*seen, transport="vcan0", missed_deadlines=0)
    crane = report["crane"]
    text = "\n".join(text.get_text() for text in figure(*seen, report).texts)
    assert "residual swing 24.0° → 12.0° (\N{MINUS SIGN}50 %)" in text
    for unit in ("s", "m"):
        pair = [f"{crane[drive][f'run_on_{unit}']:.2f}" for drive in ("raw", "shaped")]
        assert f"{' → '.join(pair)} {unit}" in text
    never = {"residual_deg": None, "peak_deg": 9.0, "run_on_s": 0.2, "run_on_m": 0.1}
    crane = {"raw": never, "shaped": never, "peak_reduction_pct": 0.0}
    assert "largest swing 9.0° → 9.0° (0 %)" in gain_and_price(crane)


def test_letters_are_of_eight_points_in_print(seen: Pair) -> None:
    report = report_dict(*seen, transport="vcan0", missed_deadlines=0)
    fig = figure(*seen, report)
    assert fig.get_figwidth() == pytest.approx(170.0 / 25.4)
    fig.draw_without_rendering()
    texts = [text for text in fig.findobj(Text) if text.get_text()]
    assert len(texts) > 50
    assert min(text.get_fontsize() for text in texts) >= 8.0


def test_raw_and_shaped_differ_without_colour(pair: Pair, report: dict[str, Any]) -> None:
    for panel in figure(*pair, report).axes:
        looks = {line.get_color(): line for line in panel.get_lines()}
        raw, shaped = looks[RAW_COLOUR], looks[SHAPED_COLOUR]
        if raw.get_marker() == "None":
            assert (raw.get_linestyle(), shaped.get_linestyle()) == ("--", "-")
            assert shaped.get_linewidth() > 1.5 * raw.get_linewidth()


@pytest.mark.parametrize("known", [True, False])
def test_nothing_drawn_leaves_the_picture(pair: Pair, seen: Pair, *, known: bool) -> None:
    drives = seen if known else pair
    fig = figure(*drives, report_dict(*drives, transport="vcan0", missed_deadlines=0))
    fig.draw_without_rendering()
    frame = fig.bbox
    boxes = [panel.get_tightbbox() for panel in fig.axes]
    boxes += [one.get_window_extent() for one in (*fig.texts, *fig.legends, *fig.artists)]
    for box in boxes:
        assert box is not None
        assert box.x0 >= 0
        assert box.x1 <= frame.x1
        assert box.y0 >= 0
        assert box.y1 <= frame.y1


def test_without_a_residual_window_the_peak_is_reported(tmp_path: Path) -> None:
    def joystick(t: float) -> float:
        return 1.0 if 0.5 <= t < 1.5 else 0.0

    def drive(swing: float) -> Recording:
        return sampled(2.0, slew=(joystick, joystick, joystick, lambda t: swing * (t > 1.0)))

    raw, shaped = drive(-8.0), drive(2.0)
    report = report_dict(raw, shaped, transport="vcan0", missed_deadlines=0)
    fig = figure(raw, shaped, report)
    assert titles(fig) == ["Slew: largest swing 8.0° → 2.0° (\N{MINUS SIGN}75 %)"]
    assert not fig.texts, "no shade, no word of it"


def test_a_still_crane_can_be_drawn_and_one_without_sway_cannot() -> None:
    still = sampled(1.0, slew=(zero, zero, zero, zero))
    report = report_dict(still, still, transport="vcan0", missed_deadlines=0)
    assert titles(figure(still, still, report))
    lift = sampled(1.0, lift=(zero, zero, zero, None))
    report = report_dict(lift, lift, transport="vcan0", missed_deadlines=0)
    with pytest.raises(ValueError, match="no axis of the drives has sway"):
        figure(lift, lift, report)
