"""``canshaper shift``: figures of logs whose numbers are known, and of the simulator's operator."""

from pathlib import Path

import pytest

from canshaper.cli.common import loader
from canshaper.errors import LogError
from canshaper.recording.replay import look
from canshaper.recording.shift import LogOfWork, Shifts, first_ns
from canshaper.report.shift import FIGURES, Figures, WorkCounter
from tests.controller.test_profiles import BUTTON, FAST, SLEW
from tests.recording.shift_logs import (
    BACK,
    CYCLE,
    HOUR_S,
    MONDAY_S,
    OFF,
    OUT,
    SHORT,
    Part,
    counted,
    lines,
    swing_deg,
    tip_m_s,
    waited_s,
    written,
)
from tests.rigs.files import machine_file


def test_figures_are_those_that_the_log_was_made_with(tmp_path: Path) -> None:
    parts = [*CYCLE, *OFF]
    (on, off), notes = counted(written(tmp_path / "a.log", parts))
    assert notes == ["no valve frames of lift: taken is what the file would send"]
    assert list(on) == list(FIGURES)
    assert (on["shift"], on["anti_sway"], off["anti_sway"]) == ("2026-09-21 14:13", "on", "off")
    swing = swing_deg(parts)
    first = round(sum(part.seconds for part in CYCLE) / 0.02)
    way_m = 6.0 * tip_m_s(80, "slew") + 0.8 * tip_m_s(48, "slew")
    assert on["way_m"] == pytest.approx(way_m, rel=0.01)
    assert off["way_m"] == pytest.approx(2.0 * tip_m_s(60, "near_far"), rel=0.015)
    assert on["driven_s"] == pytest.approx(6.8, abs=0.07)
    assert on["logged_s"] + off["logged_s"] == pytest.approx(30.0, abs=0.07)
    assert (on["cycles"], on["taps"], on["reversals"]) == (1, 2, 1)
    assert (off["cycles"], off["taps"], off["reversals"]) == (0, 0, 0)
    assert on["peak_deg"] == pytest.approx(max(swing[:first]), abs=0.2)
    assert off["peak_deg"] == pytest.approx(max(swing[first:]), abs=0.2)
    on_s = waited_s(CYCLE, swing)
    assert on["waiting_s"] == pytest.approx(on_s, abs=0.1)
    assert off["waiting_s"] == pytest.approx(waited_s(parts, swing) - on_s, abs=0.1)
    assert on_s > 10.0
    assert on["measured_pct"] == 0.0


@pytest.mark.parametrize(
    ("parts", "taps", "reversals"),
    [
        ([Part(0.6, (40, 0)), Part(1.0)], 1, 0),
        ([Part(0.8, (40, 0)), Part(1.0)], 0, 0),
        ([Part(1.0, (40, 0)), Part(1.0, (-40, 0)), Part(1.0)], 0, 1),
        ([Part(1.0, (40, 0)), Part(0.4), Part(1.0, (-40, 0)), Part(1.0)], 0, 1),
        ([Part(1.0, (40, 0)), Part(0.6), Part(1.0, (-40, 0)), Part(1.0)], 0, 0),
        ([Part(1.0, (40, 0)), Part(0.4), Part(1.0, (40, 0)), Part(1.0)], 0, 0),
        ([Part(0.4, (40, 0)), Part(0.4, (0, 40)), Part(1.0)], 2, 0),
        ([Part(0.4, (1.5, 0)), Part(1.0)], 0, 0),  # within the neutral band
    ],
)
def test_what_a_tap_and_a_reversal_are(
    tmp_path: Path, parts: list[Part], taps: int, reversals: int
) -> None:
    (row,), _ = counted(written(tmp_path / "a.log", [Part(1.0), *parts]))
    assert (row["taps"], row["reversals"]) == (taps, reversals)


@pytest.mark.parametrize(("seconds", "cycles"), [((3, 3, 3, 3), 2), ((3, 3, 3), 1), ((1.5, 3), 0)])
def test_what_a_cycle_is(tmp_path: Path, seconds: tuple[float, ...], cycles: int) -> None:
    """At 1.18 m/s: 2 m take 1.7 s; a shorter way back belongs to the way there."""
    parts = [Part(1.0)]
    for number, one in enumerate(seconds):
        sign = (-1) ** number
        short = [Part(1.0, (-50 * sign, 0), (-80 * sign, 0)), Part(0.5)]
        parts += [Part(one, (50 * sign, 0), (80 * sign, 0)), *short, short[0]._replace(seconds=0.5)]
        parts += [Part(1.5, (50 * sign, 0), (80 * sign, 0))]
    if cycles == 0:
        parts = [Part(1.0), Part(3.0, (50, 0), (80, 0)), Part(1.5, (-50, 0), (-80, 0)), Part(1.0)]
    (row,), _ = counted(written(tmp_path / "a.log", parts))
    assert row["cycles"] == cycles


def test_valve_frames_of_another_controller_are_no_anti_sway(tmp_path: Path) -> None:
    parts = [part._replace(state=None) for part in CYCLE]
    (row,), notes = counted(written(tmp_path / "a.log", parts))
    assert row["anti_sway"] == "off"
    assert "valve frames but no status of slew, near_far: without anti-sway" in notes
    assert row["peak_deg"] == pytest.approx(max(swing_deg(parts)), abs=0.2)


def test_without_valve_frames_it_is_what_the_file_would_send(tmp_path: Path) -> None:
    (row,), notes = counted(written(tmp_path / "a.log", CYCLE, valves=False))
    assert notes[0].startswith("no valve frames of slew, near_far, lift")
    assert (row["anti_sway"], row["cycles"], row["taps"]) == ("on", 1, 2)
    assert 7.0 < row["way_m"] < 12.0  # full speed, less what the filter leaves of taps


def test_a_valve_without_frames_closes(tmp_path: Path) -> None:
    """Its timeout is 200 ms. Until then the crane is driven, though no joystick is held."""
    path = written(tmp_path / "a.log", [Part(1.0), Part(2.0, (0, 0), (80, 0))])
    (row,), _ = counted(written(path, [Part(3.0)], MONDAY_S + 3.0, valves=False))
    assert row["way_m"] == pytest.approx(2.2 * tip_m_s(80, "slew"), abs=0.06)
    assert row["driven_s"] == pytest.approx(2.2, abs=0.05)


def test_an_axis_that_was_never_ready_is_said(tmp_path: Path) -> None:
    log = written(tmp_path / "a.log", OUT, valves=False, Enable=0)
    (row,), notes = counted(log)
    assert "slew was never ready: enable is off (ENABLE_OFF)" in notes
    assert (row["way_m"], row["taps"], row["anti_sway"]) == (0.0, 0, "")


def test_shifts_end_with_an_hour_without_a_frame_a_day_or_a_log(tmp_path: Path) -> None:
    begins = (MONDAY_S, MONDAY_S + 600.0, MONDAY_S + 2.5 * HOUR_S, MONDAY_S + 24 * HOUR_S)
    logs = [written(tmp_path / f"{k}.log", SHORT, at) for k, at in enumerate(begins)]
    rows, _ = counted(*logs)
    assert [row["shift"] for row in rows] == [
        "2026-09-21 14:13",
        "2026-09-21 16:43",
        "2026-09-22 14:13",
    ]
    assert rows[0]["logged_s"] == pytest.approx(2 * rows[1]["logged_s"])
    rows, _ = counted(*logs, by="day")
    assert [row["shift"] for row in rows] == ["2026-09-21", "2026-09-22"]
    rows, _ = counted(*logs, by="file")
    assert [row["shift"] for row in rows] == ["0.log", "1.log", "2.log", "3.log"]


def test_a_pause_within_a_log_ends_a_shift_too(tmp_path: Path) -> None:
    path = written(tmp_path / "a.log", OUT)
    rows, _ = counted(written(path, CYCLE, MONDAY_S + 2 * HOUR_S))
    assert [row["cycles"] for row in rows] == [0, 1]
    assert rows[1]["logged_s"] == pytest.approx(23.0 + 1.0, abs=0.1)  # a second ahead of it
    # It swings on for the 12 s of which a replay has ticks; then nothing is known.
    assert rows[0]["waiting_s"] == pytest.approx(16.0, abs=0.1)


def test_a_grapple_calms_while_a_log_pauses(tmp_path: Path) -> None:
    path = written(tmp_path / "a.log", [Part(0.5), Part(1.0, (100, 0), (80, 0)), Part(1.0)])
    (row,), _ = counted(written(path, [Part(1.0, state="READY")], MONDAY_S + 600.0))
    assert 10.0 < row["waiting_s"] < 14.5  # the last second, and 12 s of which there are ticks


def test_where_the_status_ends_canshaper_does_not_drive(tmp_path: Path) -> None:
    silent = Part(2.1, state=None), Part(1.0, (50, 0), (80, 0), None)
    rows, _ = counted(written(tmp_path / "a.log", [*SHORT, *silent]))
    assert [row["anti_sway"] for row in rows] == ["on", "off"]


def test_a_log_that_cannot_be_used_to_its_end_counts_with_its_last_pause(tmp_path: Path) -> None:
    """Its figures stay in the table."""
    (whole,), _ = counted(path := written(tmp_path / "a.log", OUT))
    shifts, deployment = Shifts("gap", HOUR_S), loader("forwarder.yaml")()
    drive = look(deployment, path, {}, own=False)
    one = LogOfWork("", path.name, first_ns(drive), deployment, drive)
    with path.open("a", encoding="ascii") as log:
        log.write("nonsense\n")
    with pytest.raises(LogError, match="nonsense"):
        shifts.add(one, print)
    (row,) = shifts.rows()
    assert whole["waiting_s"] > 3.0
    assert row["waiting_s"] == pytest.approx(whole["waiting_s"], abs=0.021)  # less a tick


def test_what_two_logs_have_counts_once(tmp_path: Path) -> None:
    whole = written(tmp_path / "a.log", OUT)
    again = tmp_path / "b.log"
    text = whole.read_text().splitlines(keepends=True)
    again.write_text("".join(text[len(text) // 2 :]))
    (both,), notes = counted(whole, again)
    (one,), _ = counted(whole)
    assert both == one
    assert any("s are in a log before it too" in note for note in notes)


@pytest.mark.parametrize("second", ["rear", "front_left"])
def test_each_crane_has_its_rows(tmp_path: Path, second: str) -> None:
    rear = [line.replace(" vcan0 ", " vcan1 ") for line in lines([*OUT, *BACK])]
    path = tmp_path / "a.log"
    path.write_text("".join(sorted([*lines(SHORT), *rear])))
    file = machine_file(tmp_path, "two-cranes", ("rear_", f"{second}_"))
    rows, _ = counted(path, file=str(file))
    assert [(row["crane"], row["cycles"]) for row in rows] == [("front", 0), (second, 1)]
    assert [row["way_m"] for row in rows] == pytest.approx(
        [0.5 * tip_m_s(80, "slew"), 6.0 * tip_m_s(80, "slew")], abs=0.05
    )


def test_each_profile_has_its_row(tmp_path: Path) -> None:
    file = machine_file(tmp_path, "forwarder", BUTTON, (SLEW, FAST))
    path = written(tmp_path / "a.log", OUT)
    written(path, [Part(0.3)], MONDAY_S + 8.0, AntiSwayOff=1)
    rows, _ = counted(written(path, BACK, MONDAY_S + 8.3), file=str(file))
    assert [(row["profile"], row["cycles"]) for row in rows] == [("", 0), ("fast", 1)]


def test_a_break_is_no_waiting() -> None:
    """A minute counts of a pause in which the grapple swings for long."""
    counter, figures = WorkCounter("slew", 2.0), Figures()
    for joystick, seconds in ((1.0, 1.0), (0.0, 300.0), (1.0, 1.0), (0.0, 10.0)):
        for _ in range(round(10 * seconds)):
            stick, speed = {"slew": joystick}, {"slew": 0.0}
            counter.add(figures, 0.1, stick, speed, 5.0, moving=False, measured=False)
    counter.end()
    assert figures.waiting_s == pytest.approx(70.0)
