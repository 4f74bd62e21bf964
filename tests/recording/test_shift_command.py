"""``canshaper shift`` as a person uses it: on logs of the simulator's operator, on black boxes."""

import csv
import math
from functools import partial
from itertools import accumulate
from pathlib import Path

import pytest

from canshaper.campaign.run import Source
from canshaper.campaign.work import SetUp, Work, do_work, learn
from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.report.shift import FIGURES
from canshaper_sim.operator_model import Skill
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import Recording
from tests.blackbox.driven import SECOND, TRIP, drive
from tests.cli.invocation import invoke
from tests.daemon.bench import Bench
from tests.recording.shift_logs import (
    MONDAY_S,
    OFF,
    OUT,
    SHORT,
    counted,
    dbc,
    tip_m_s,
    written,
)

run = partial(invoke, "shift")


def waits_s(recording: Recording, large_deg: float) -> float:
    """Time between the joysticks' rest and the last large swing of each rest."""
    assert recording.crane
    total_s, large_s = 0.0, math.inf
    joysticks = [one.joystick for one in recording.axes.values()]
    for k, now_s in enumerate(recording.t_s):
        if any(one[k] for one in joysticks):
            large_s = now_s
        elif recording.crane.sway_deg[k] >= large_deg:
            total_s += max(now_s - large_s, 0.0)
            large_s = now_s if large_s < math.inf else large_s
    return total_s


@pytest.mark.slow
@pytest.mark.parametrize("bypass", [False, True])
@pytest.mark.parametrize("file", ["forwarder-robust.yaml", "forwarder-sensor.yaml"])
def test_the_simulators_operator_is_counted_as_it_counted(
    tmp_path: Path, file: str, *, bypass: bool
) -> None:
    """Each tap counts; the way of the tip, the swing and the waits by its own record."""
    deployment = loader(file)()
    source = Source.of(deployment, deployment.config.uncertainty, ())
    set_up = SetUp(bypass=bypass)
    known = learn(source, set_up)
    work = Work(set_up, "catching", Skill(), known, ((0.6, 1.0),) * 2, (0.3, 6.0), "0")
    recorder, path = Recorder(deployment), tmp_path / "work.log"
    with path.open("w") as log:

        def on_frame(frame: Frame, time_s: float) -> None:
            recorder.receive(frame, time_s)
            data = frame.data.hex()
            log.write(f"({MONDAY_S + time_s:.6f}) vcan0 {frame.can_id:03X}#{data}\n")

        moves = do_work(source, work, on_frame, 4)
    (row,), notes = counted(path, file=file)
    recording = recorder.recording()
    assert recording.crane
    crane = recording.crane
    assert notes == []
    assert row["anti_sway"] == ("off" if bypass else "on")
    assert row["taps"] == sum(move.taps for move in moves)
    assert row["cycles"] == len(moves) / 2
    way_m = sum(math.dist(a, b) for a, b in zip(crane.tip_m, crane.tip_m[1:], strict=False))
    assert row["way_m"] == pytest.approx(way_m, rel=0.02)
    sensor = "sensor" in file
    assert row["measured_pct"] == pytest.approx(100.0 if sensor else 0.0, abs=1.0)
    if sensor:  # a swing of about 2 degrees may be on either side of them
        least_s, most_s = (waits_s(recording, at_deg) for at_deg in (2.1, 1.9))
        assert 0.95 * least_s <= row["waiting_s"] <= 1.05 * most_s
    else:
        assert row["waiting_s"] == pytest.approx(waits_s(recording, 2.0), rel=0.45)
    assert row["peak_deg"] == pytest.approx(max(crane.sway_deg), rel=0.03 if sensor else 0.15)


@pytest.mark.slow
def test_a_black_box_is_counted_by_what_its_daemon_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, folder = Bench(tmp_path, monkeypatch), tmp_path / "boxes"
    folder.mkdir()
    drive(bench, folder, TRIP + 6 * SECOND)
    out = tmp_path / "t.csv"
    result = run(folder / "machine-0001.zip", "--out", out)
    assert result.exit_code == 0, result.output
    with out.open() as file:
        (row,) = csv.DictReader(file)
    valve = dbc.get_message_by_name("SlewCommand")
    sent = [f for f in bench.sent if f.can_id == valve.frame_id]
    steps_m = [abs(tip_m_s(valve.decode(f.data)["Velocity"], "slew")) * 0.02 for f in sent]
    ways_m = [*accumulate(steps_m)][
        TRIP + 5 * SECOND - 1 :
    ]  # it is written then, or a little later
    assert any(float(row["way_m"]) == pytest.approx(way_m, rel=0.02) for way_m in ways_m)
    assert (row["anti_sway"], row["cycles"], row["taps"]) == ("on", "0", "0")
    assert "note:" not in result.output


def test_the_command_writes_one_table_three_times(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    folder = tmp_path / "logs" / "seven"
    folder.mkdir(parents=True)
    written(folder / "b.log", SHORT, MONDAY_S + 600.0)
    written(folder / "a.log", [*SHORT, *OFF[:1]])
    outs = tmp_path / "out" / "t.csv", tmp_path / "out" / "t.parquet"
    result = run(
        tmp_path / "logs", "--config", "forwarder.yaml", "--out", outs[0], "--out", outs[1]
    )
    assert result.exit_code == 0, result.output
    assert "seven 2026-09-21 14:13 on" in result.output
    assert "Swing that is not measured is that of the model" in result.output
    with outs[0].open() as file:
        rows = [*csv.DictReader(file)]
    assert [row["anti_sway"] for row in rows] == ["on", "off"]
    kept = parquet.read_table(outs[1]).to_pylist()
    assert [{k: "" if v is None else str(v) for k, v in row.items()} for row in kept] == rows
    assert list(rows[0]) == list(FIGURES)


def test_a_log_that_cannot_be_read_is_named_and_the_others_count(tmp_path: Path) -> None:
    good, bad = written(tmp_path / "a.log", OUT), tmp_path / "b.log"
    bad.write_text("no log\n")
    result = run(bad, good, "--config", "forwarder.yaml")
    assert result.exit_code == 1
    assert result.stderr.startswith("not read: ")
    assert "b.log:1" in result.stderr
    assert "2026-09-21 14:13 on" in result.stdout
    assert run(bad, "--config", "forwarder.yaml").exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["a.log"], "a.log: --config is missing: which deployment?"),
        (["a.log", "--config", "forwarder.yaml", "--out", "t.xls"], "expected a file with .csv or"),
        ([".", "--config", "forwarder.yaml"], ".: expected a log, got none"),
    ],
)
def test_what_is_wrong_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.exit_code == 2
    assert text in result.stderr
    assert result.stderr.count("\n") == 1
