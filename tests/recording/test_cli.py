"""The commands as a user calls them."""

import json
from array import array
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from canshaper.cli.verbs.replay import _run
from canshaper.recording.log import LogFile
from canshaper.recording.plot import figure
from tests.cli.invocation import invoke

DRIVE = Path(__file__).parents[1] / "golden" / "drive.log"


def called(*arguments: object, code: int = 0) -> str:
    result = invoke("replay", *arguments)
    assert result.exit_code == code, result.output
    return result.output


@pytest.mark.slow
def test_a_log_goes_through_the_controller(tmp_path: Path) -> None:
    text = called(DRIVE, "--config", "forwarder-robust.yaml", "--out", tmp_path)
    assert "those of a clock: the log has none" in text
    data = json.loads((tmp_path / "replay.json").read_text())["forwarder-robust"]
    assert data["compared"] is None
    assert data["seconds"] == pytest.approx(18.0, abs=0.1)
    assert data["axes"]["slew"]["trips"] > 0  # the enable switch is released in motion
    events = (tmp_path / "forwarder-robust.events.txt").read_text()
    assert "state=TRIPPED from=ACTIVE reason=ENABLE_LOST" in events
    assert (tmp_path / "replay.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_new_log_can_be_replayed(tmp_path: Path) -> None:
    """What was sent is in it, and is that of another daemon."""
    again = tmp_path / "again"
    called(DRIVE, "--config", "forwarder.yaml", "--out", tmp_path)
    called(tmp_path / "forwarder.log", "--config", "forwarder.yaml", "--out", again)

    def sent(path: Path) -> list[tuple[int, bytes]]:
        return [(f.can_id, f.data) for f in LogFile(path) if f.can_id >= 0x200]

    assert sent(again / "forwarder.log") == sent(tmp_path / "forwarder.log")


@pytest.mark.slow
def test_two_deployments_side_by_side(tmp_path: Path) -> None:
    out = tmp_path / "out"
    both = ("--config", "forwarder.yaml", "--config", "forwarder-robust.yaml")
    text = called(DRIVE, *both, "--out", out)
    assert "forwarder-robust" in text
    data = json.loads((out / "replay.json").read_text())
    peaks = [data[n]["axes"]["slew"]["replayed"]["peak_deg"] for n in data]
    straight = [data[n]["axes"]["slew"]["straight"]["peak_deg"] for n in data]
    assert len(set(peaks)) == 2
    assert max(peaks) < min(straight)
    assert (out / "forwarder-robust.log").exists()


@pytest.mark.slow
def test_the_same_file_twice_has_two_names(tmp_path: Path) -> None:
    called(DRIVE, "--config", "forwarder.yaml", "--config", "forwarder.yaml", "--out", tmp_path)
    one, two = (tmp_path / f"forwarder-{n}.log" for n in (1, 2))
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.slow
def test_part_of_a_drive(tmp_path: Path) -> None:
    called(DRIVE, "--config", "forwarder.yaml", "--from", "1", "--to", "2", "--out", tmp_path)
    data = json.loads((tmp_path / "replay.json").read_text())["forwarder"]
    assert data["ticks"] == pytest.approx(900, abs=2)  # of which 50 are drawn


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ("(1.0) vcan0 7FF#00\n(2.0) vcan0 7FF#00\n", "none of its joystick messages (JoystickLeft"),
        (
            "(1.0) can3 110#00\n(2.0) can4 110#00\n",
            "bus crane: expected the channel 'vcan0', got 'can3', 'can4'",
        ),
    ],
)
def test_a_log_that_cannot_be_used_is_reported(tmp_path: Path, rows: str, text: str) -> None:
    log = tmp_path / "x.log"
    log.write_text(rows)
    arguments = [log, "--config", "forwarder.yaml", "--out", tmp_path / "out"]
    assert text in called(*arguments, code=2).replace("\n", " ")


def test_options_that_cannot_be(tmp_path: Path) -> None:
    file = ("--config", "forwarder.yaml", "--out", tmp_path)
    assert "which deployment?" in called(DRIVE, code=2)
    assert "expected a black box of these files, without --config" in called(
        DRIVE, *file, "--verify", code=2
    )
    assert "--channel: expected BUS=CHANNEL, got" in called(
        DRIVE, *file, "--channel", "can0", code=2
    )
    assert "expected a bus, got joy; there are crane" in called(
        DRIVE, *file, "--channel", "joy=can0", code=2
    )
    assert "No such file" in called(tmp_path / "none.log", *file, code=2)


def assert_inside(drawn: Figure) -> None:
    """No text leaves the picture."""
    boxes = [text.get_window_extent() for text in drawn.findobj(Text) if text.get_text()]
    assert max(box.x1 for box in boxes) <= drawn.bbox.x1


@pytest.mark.slow
def test_the_picture_has_both_deployments_states_and_reasons_and_leaves_out_what_is_idle(
    tmp_path: Path,
) -> None:
    files = ["forwarder-robust.yaml", "forwarder.yaml"]
    replays = _run(DRIVE, files, {}, (0.0, None), tmp_path, None)
    for one in replays:
        one.measure()
    drawn = figure(replays)
    titles = [panel.get_title(loc="left") for panel in drawn.axes]
    assert "Slew: largest sway" in " ".join(titles)
    words = [text.get_text() for text in drawn.texts]
    assert any("lanes: grey ready" in text for text in words)
    command = drawn.axes[0]
    assert [line.get_linestyle() for line in command.lines][:2] == ["-", "--"]
    reasons = {text.get_text() for panel in drawn.axes for text in panel.texts}
    assert {"enable released in motion", "no joystick message"} <= reasons
    last_s = max(text.get_position()[0] for panel in drawn.axes for text in panel.texts)
    cut = _run(DRIVE, files, {}, (0.0, last_s + 0.5), tmp_path, None)
    for one in cut:
        one.measure()
    assert_inside(figure(cut))  # with a reason at its very end
    for one in replays:  # all numbers that a title can have
        for metrics in (one.measures, one.straight):
            for name in metrics:
                full = {"peak_deg": 12.3, "residual_deg": 12.3, "run_on_s": 1.2}
                metrics[name] = replace(metrics[name], **full)
    drawn = figure(replays)
    assert_inside(drawn)
    for one in replays:  # the lift rests
        for column in one.trace._rows["lift"]:
            column[:] = array("d", [0.0] * len(column))
    drawn = figure(replays)
    assert not any("Lift" in panel.get_title(loc="left") for panel in drawn.axes)
    assert any("idle, left out: lift" in text.get_text() for text in drawn.texts)
