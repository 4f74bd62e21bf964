"""``canshaper init``: what says that a log is gripped, and what the file has then."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from canshaper.cli.interview.answers import answered_by
from canshaper.cli.interview.first import FirstAxis, FirstLoad, Stopwatch
from canshaper.cli.interview.swing import load_of
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.database import load_dbc
from tests.cli.init_script import DBC, of_dbc

LOAD_DBC = DBC.with_name("grapple-load.dbc")
GRIPPED = "Does any message say that a log is gripped"
USED = {"JoystickLeft.Enable", "JoystickLeft.Slew"}


def asked(folder: Path, text: str, swings: Sequence[str] = ("slew",)) -> FirstLoad | None:
    """Load that the interview knows after these answers; ``swings``: axes that make it swing."""
    messages = []
    for dbc in (DBC, LOAD_DBC):
        file, _ = load_dbc(dbc)
        assert file
        messages += [one for one in file.messages if not one.name.endswith("Command")]
    swing = Stopwatch(23.6, 20.0, 6.67, 1.5)
    axes = [FirstAxis(one, "left", "Slew", "Valve", "V", 200, swing=swing) for one in swings]
    axes.append(FirstAxis("lift", "right", "Lift", "Lift", "V", 200))
    (folder / "answers.txt").write_text(text)
    with answered_by(folder / "answers.txt"):
        return load_of(axes, messages, USED)


@pytest.mark.parametrize(
    ("text", "signal", "timeout_ms", "values"),
    [
        ("", "GrappleLoad.Weight", 500, (0.0, 600.0)),
        ("Weight: its value with a usual log = 900", "GrappleLoad.Weight", 500, (0.0, 900.0)),
        (f"{GRIPPED} = GrappleLoad.Gripped", "GrappleLoad.Gripped", 500, (0.0, 1.0)),
        (
            f"{GRIPPED} = GrappleLoad.Gripped\nGripped: its value while = 0",
            "GrappleLoad.Gripped",
            500,
            (1.0, 0.0),
        ),
        (f"{GRIPPED} = JoystickMode.Profile", "JoystickMode.Profile", 500, (0.0, 1.0)),
    ],
    ids=["weight", "another log", "gripped", "open", "the driver's switch"],
)
def test_a_signal_and_its_values(
    text: str, signal: str, timeout_ms: int, values: tuple[float, float], tmp_path: Path
) -> None:
    load = asked(tmp_path, text, ("slew", "near_far"))
    assert load is not None
    assert (f"{load.message}.{load.signal}", load.timeout_ms) == (signal, timeout_ms)
    assert (load.empty, load.log) == values
    assert load.ten_swings_s == pytest.approx({"slew": 26.9, "near_far": 26.9})


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (f"{GRIPPED} = JoystickLeft.Enable", "expected one of "),
        ("Weight: its value with a usual log = 0", "expected another value than that of an empty"),
        ("Weight: its value with a usual log = 6000", "expected a number, 0 to 5000, got '6000'"),
        ("slew: time of ten full swings with a log = 23", "expected a number, 23.6 to 178.5, got"),
        (f"{GRIPPED} = GrappleLoad.Gripped\nGripped: its value = 2", "a whole number, 0 to 1, got"),
    ],
)
def test_a_wrong_answer_is_named(text: str, fault: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=fault):
        asked(tmp_path, text)


def test_without_a_signal_one_response_may_hold_for_both(tmp_path: Path) -> None:
    none = f"{GRIPPED} = -\n"
    assert asked(tmp_path, none) is None
    times = "slew: time of ten full swings with a log = 25\n"
    load = asked(tmp_path, f"{none}Is one response = yes\n{times}")
    assert load == FirstLoad({"slew": 25.0})


def test_where_nothing_swings_nothing_is_asked(tmp_path: Path) -> None:
    assert asked(tmp_path, "", ()) is None
    with pytest.raises(ConfigError, match="Does any message"):
        asked(tmp_path, f"{GRIPPED} = -", ())


@pytest.mark.parametrize(("answer", "times_ms"), [("", (200, 1000)), ("50", (50, 250))])
def test_the_period_of_its_message_is_asked_where_the_dbc_has_none(
    answer: str, times_ms: tuple[int, int], tmp_path: Path
) -> None:
    lines = LOAD_DBC.read_text(encoding="utf-8").splitlines()
    bare = tmp_path / "load.dbc"
    bare.write_text("\n".join(one for one in lines if not one.startswith('BA_ "GenMsgCycleTime"')))
    text = f"GrappleLoad: period = {answer}\n" if answer else ""
    done = of_dbc(tmp_path, [DBC, bare], text)
    assert done.exit_code == 0, done.output
    load = load_deployment(tmp_path / "machine.yaml").config.load_state
    assert load is not None
    assert (load.cycle_ms, load.timeout_ms) == times_ms


@pytest.mark.slow
@pytest.mark.parametrize("signal", ["Weight", "Gripped", "-"])
def test_the_file_has_both_sets_or_one_for_both(signal: str, tmp_path: Path) -> None:
    name = signal if signal == "-" else f"GrappleLoad.{signal}"
    text = f"{GRIPPED} = {name}\nslew: time of ten full swings with a log = 26.86\n"
    text += "Is one response = yes\n" if signal == "-" else ""
    done = of_dbc(tmp_path, [DBC, LOAD_DBC], text)
    assert done.exit_code == 0, done.output
    deployment = load_deployment(tmp_path / "machine.yaml")
    slew = deployment.axes["slew"].config
    assert slew.sway
    assert slew.sway.mode().period_s == pytest.approx(2.53, abs=0.02)
    assert slew.filter.kind == "robust"
    designed = slew.filter.design()
    assert designed
    assert designed.length_range_pct == pytest.approx(13.0, abs=1.0)
    periods_s = [one.sway.mode().period_s for one in slew.gain_schedule]
    kinds = {one.filter.kind for one in slew.gain_schedule}
    if signal == "-":
        assert deployment.config.load_state is None
        assert not periods_s
        return
    assert deployment.config.load_state
    assert deployment.config.load_state.signal == signal
    assert periods_s == pytest.approx([2.36, 2.686], abs=0.01)
    assert kinds == {"robust"}
    values = [one.breakpoint for one in slew.gain_schedule]
    assert values == [0.0, 600.0 if signal == "Weight" else 1.0]
