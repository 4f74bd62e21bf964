"""``canshaper commission --simulated``: state, resumption, and what must not get lost."""

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.cli.verbs.commission import Prompts
from canshaper.commissioning.procedure.bench import Simulated
from canshaper.commissioning.procedure.files import Files
from canshaper.commissioning.procedure.procedure import Procedure
from canshaper.commissioning.procedure.state import Status, read_state
from canshaper.errors import UsageError
from canshaper.machine.binding import load_deployment
from tests.commissioning.procedure.rehearsal import COPY, STATE, commission, steps
from tests.rigs.files import text_of

CRANE = ("--set", "grapple.l2_m=1.55")


def procedure(changes: list[str] | None = None) -> Procedure:
    bench = Simulated(Prompts(), changes or [])
    COPY.write_bytes(Path("machine.yaml").read_bytes())
    return Procedure(Files(COPY), bench, load_deployment, origin=Path("machine.yaml"))


@pytest.mark.slow
def test_a_rehearsal_writes_into_its_copy_alone(machine: Path) -> None:
    before = machine.read_bytes()
    shown = commission(*CRANE, "--step", "swing", "--yes")
    assert machine.read_bytes() == before
    sway = load_deployment(COPY).axes["slew"].config.sway
    assert sway and sway.origin and sway.origin.source == "simulated"
    assert f"{sway.period_s}" in steps()["swing"]["diff"]
    assert f"REHEARSAL on a simulated crane, with {COPY}, a copy of machine.yaml" in shown
    assert Path("machine.rehearsal.commission/swing.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_same_command_goes_on_at_the_first_open_step(machine: Path) -> None:
    shown = commission(*CRANE, answers="\nskip\nstop\n", code=1)
    assert "swing stays open" in shown
    done = {name: record["status"] for name, record in steps().items()}
    assert done == {"buses": "done", "joysticks": "skipped", "swing": "open"}
    assert COPY.read_bytes() == machine.read_bytes()
    again = commission(answers="stop\n", code=1)  # with the crane of before
    assert "] swing:" in again
    assert "] buses:" not in again
    assert steps()["swing"]["numbers"]["slew"]["period_s"] == pytest.approx(2.637, abs=0.01)
    assert "skipped" in commission("--list")


def test_a_rehearsal_of_its_copy_goes_on_with_the_copy(machine: Path) -> None:
    commission("--step", "buses", "--yes")
    words = ["commission", str(COPY), "--simulated", "--step", "joysticks", "--yes"]
    shown = CliRunner().invoke(app, words).output
    assert not Path("machine.rehearsal.rehearsal.yaml").exists()
    assert steps()["joysticks"]["status"] == "done"
    assert "was changed since the copy was made" not in shown


def test_another_crane_than_before_is_refused(machine: Path) -> None:
    commission(*CRANE, "--step", "buses", "--yes")
    shown = commission("--set", "grapple.l2_m=1.2", "--yes", code=2)
    assert "expected the crane grapple.l2_m=1.55, got grapple.l2_m=1.2" in shown


@pytest.mark.slow
def test_a_poor_swing_leaves_the_step_open_and_says_what_to_do(machine: Path) -> None:
    crane = ("--set", "slew.deadband=0.5")  # more than max_pct: 40, so the axis does not move
    shown = commission(*crane, "--step", "swing", "--yes", code=1)
    assert "NOT ENOUGH DATA: slew: " in shown
    assert "is it the right signal, and the sensor on?" in shown
    assert "It would write" not in shown
    assert COPY.read_bytes() == machine.read_bytes()
    assert steps()["swing"]["status"] == "open"
    assert steps()["swing"]["problems"]


def exchanged(text: str) -> str:
    """The file with the joysticks of slew and near-far exchanged."""
    text = text.replace("signal: Slew,", "signal: X,").replace("signal: NearFar,", "signal: Slew,")
    return text.replace("signal: X,", "signal: NearFar,")


@pytest.mark.slow
def test_a_joystick_of_another_axis_is_put_right(machine: Path) -> None:
    machine.write_text(exchanged(machine.read_text()))
    real = load_deployment(machine)
    assert real.axes["slew"].config.command.signal == "NearFar"
    bench = _WrongHand(Prompts(), [])
    COPY.write_bytes(machine.read_bytes())
    one = Procedure(Files(COPY), bench, load_deployment, origin=machine)
    one.accept(one.run(one.step("joysticks")))
    after = load_deployment(COPY)
    assert after.axes["slew"].config.command.signal == "Slew"
    assert after.axes["near_far"].config.command.signal == "NearFar"


class _WrongHand(Simulated):
    """A person who moves the joystick that the axis really has, whatever the file says."""

    def drive(self, deployment: Any, log: Path, task: Any) -> None:
        right = Path("right.yaml")
        right.write_text(exchanged(Path("machine.yaml").read_text()))
        super().drive(load_deployment(right), log, task)


@pytest.mark.slow
def test_a_file_that_was_changed_between_steps_is_named_and_kept(machine: Path) -> None:
    commission(*CRANE, "--step", "buses", "--yes")
    COPY.write_text(COPY.read_text() + "# a note of mine\n")
    shown = commission("--step", "swing", "--yes")
    assert f"NOTE: {COPY} was changed by another program since the last step" in shown
    assert COPY.read_text().endswith("# a note of mine\n")
    assert "period_s: 2.637" in COPY.read_text()


@pytest.mark.slow
def test_a_file_that_was_changed_while_a_step_was_looked_at_is_not_written(machine: Path) -> None:
    one = procedure(["grapple.l2_m=1.55"])
    proposal = one.run(one.step("swing"))
    theirs = COPY.read_text() + "# a note of theirs\n"
    COPY.write_text(theirs)
    with pytest.raises(UsageError, match="changed by someone else meanwhile"):
        one.accept(proposal)
    assert COPY.read_text() == theirs
    assert one.state.of("swing").status is Status.OPEN


class _Edited(Simulated):
    """Another program writes into the file while the crane is driven."""

    def drive(self, deployment: Any, log: Path, task: Any) -> None:
        super().drive(deployment, log, task)
        COPY.write_text(COPY.read_text() + "# a note of theirs\n")


@pytest.mark.slow
def test_a_file_that_was_changed_in_the_middle_of_a_step_is_noticed(machine: Path) -> None:
    one = procedure()
    one.accept(one.run(one.step("check")))
    two = Procedure(Files(COPY), _Edited(Prompts(), []), load_deployment, origin=machine)
    with pytest.raises(UsageError, match="changed by someone else meanwhile"):
        two.accept(two.run(two.step("buses")))
    assert two.news == [
        f"{COPY} was changed by another program since the last step; it is checked again,"
        " nothing is lost"
    ]
    assert two.state.of("check").status is Status.OPEN


@pytest.mark.slow
def test_the_machine_has_changed_since_the_copy_was_made(machine: Path) -> None:
    commission("--step", "buses", "--yes")
    machine.write_text(machine.read_text() + "# a note\n")
    assert "machine.yaml was changed since the copy was made" in commission(
        "--yes", "--step", "buses"
    )


@pytest.mark.slow
def test_the_second_commissioning_of_a_file_is_reported(machine: Path) -> None:
    commission("--step", "buses", "--yes")
    before = STATE.read_bytes()
    with Files(COPY).locked():
        shown = commission("--yes", code=2)
    assert "another commissioning of it is under way, process " in shown
    assert STATE.read_bytes() == before
    commission("--step", "buses", "--yes")  # its end lets the next one in


class _Interrupted(Prompts):
    """Ctrl-C in the middle of a drive."""

    def progress(self, what: str) -> Any:
        raise KeyboardInterrupt


@pytest.mark.slow
def test_an_interrupted_step_leaves_the_others_as_they_were(machine: Path) -> None:
    one = procedure()
    one.accept(one.run(one.step("buses")))
    kept = STATE.read_bytes()
    bench = Simulated(_Interrupted(), [])
    two = Procedure(Files(COPY), bench, load_deployment, origin=machine)
    with pytest.raises(KeyboardInterrupt):
        two.run(two.step("joysticks"))
    assert STATE.read_bytes() == kept
    assert sorted(path.name for path in Path().glob(".*")) == []
    assert not Files(COPY).proposal.exists()


@pytest.mark.parametrize("text", ["", "[]", '{"version": 9, "steps": {}}', '{"version": 1}'])
def test_a_damaged_state_is_named_and_left(machine: Path, text: str) -> None:
    STATE.write_text(text)
    shown = commission("--yes", code=2)
    assert f"{STATE}: expected the state of a commissioning" in shown
    assert STATE.read_text() == text


def test_problems_of_an_older_program_are_read(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    path.write_text('{"version": 1, "steps": {"swing": {"status": "open", "poor": ["short"]}}}')
    state = read_state(path)
    assert state is not None
    assert state.of("swing").problems == ["short"]


@pytest.mark.slow
def test_answers_come_from_a_file(machine: Path) -> None:
    Path("answers.txt").write_text("buses: accept = skip\njoysticks: accept = stop\n")
    commission("--answers", "answers.txt", code=1)
    assert [record["status"] for record in steps().values()] == ["skipped", "open"]
    Path("answers.txt").write_text("joysticks: accept = maybe\n")
    shown = commission("--answers", "answers.txt", code=2)
    assert "answers.txt:1: joysticks: accept: expected one of yes, again, skip, stop" in shown


@pytest.mark.slow
def test_state_is_read_as_it_was_written(machine: Path) -> None:
    one = procedure()
    one.accept(one.run(one.step("buses")))
    assert read_state(STATE) == one.state


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("machine.yaml", "--step", "swings"), "--step: expected one of buses"),
        (("machine.yaml", "--set", "grapple.l2_m=1"), "--set: expected --simulated too"),
        (("forwarder.yaml",), "shipped with the package"),
        (("nowhere.yaml",), "nowhere.yaml"),
    ],
)
def test_a_wrong_option_is_one_line(machine: Path, words: tuple[str, ...], text: str) -> None:
    result = CliRunner().invoke(app, ["commission", *words])
    assert result.exit_code == 2, result.output
    assert text in result.output


@pytest.mark.parametrize(
    ("several", "text"),
    [(False, "axes.boom: the crane has slew"), (True, "got 2: front, rear; take a file with")],
)
def test_what_the_simulated_crane_cannot_stand_for_is_refused_at_once(
    machine: Path, several: bool, text: str
) -> None:
    new = machine.read_text().replace("\n  slew:", "\n  boom:").replace("slew: slew", "slew: boom")
    new = new.replace("axes.slew.", "axes.boom.")
    if several:
        new = text_of("two-cranes")
    machine.write_text(new)
    assert text in commission("--yes", code=2)
    assert not COPY.exists()
