from pathlib import Path

import pytest

from canshaper.config.filters import DesignedFor
from canshaper.config.section import Origin
from canshaper.edit.edit import written_by
from canshaper.machine.binding import load_deployment
from tests.cli.invocation import invoke
from tests.rigs.files import machine_file


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return machine_file(tmp_path, "forwarder")


def run(*words: str) -> tuple[int, str]:
    done = invoke("robust", *words)
    return done.exit_code, done.output


def test_the_printed_line_is_a_filter_that_check_accepts(file: Path) -> None:
    status, output = run(str(file), "--axis", "near_far", "--duration", "1.8")
    assert status == 0
    assert "at most 7.7 % of the" in " ".join(output.split())
    line = output.strip().splitlines()[-1]
    old = next(row for row in file.read_text().splitlines() if "# near-far tuning" in row)
    file.write_text(file.read_text().replace(old, "    " + line))
    chosen = load_deployment(file).axes["near_far"].config.filter
    assert chosen.kind == "robust"
    assert len(chosen.parameters()["taps"]) == 91


def test_write_changes_the_filter_and_nothing_else(file: Path) -> None:
    before = file.read_text().splitlines()
    status, output = run(str(file), "--axis", "slew", "--range", "30", "--write")
    assert (status, "Written to" in output) == (0, True)
    after = file.read_text().splitlines()
    changed = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
    assert len(changed) == 1
    assert before[changed[0]].split("#")[1:] == after[changed[0]].split("#")[1:]
    chosen = load_deployment(file).axes["slew"].config.filter
    assert chosen.kind == "robust"
    assert chosen.design() == DesignedFor(
        period_s=2.356,
        damping_ratio=0.038,
        length_range_pct=30.0,
        duration_s=1.82,
        valve_rate_per_s=5.0,
        origin=Origin(**written_by("robust", simulated=None)),
    )
    assert "NOTE: axes.slew.filter.kind: robust replaces gff" in output
    line = after[changed[0]].partition(", origin")[0]
    assert len(line) < 280  # no one reads a line of a hundred taps


@pytest.mark.slow
def test_write_lengthens_a_tail_that_is_too_short(file: Path) -> None:
    words = (str(file), "--axis", "near_far", "--duration", "2.4", "--write")
    status, output = run(*words)
    assert status == 0
    lines = [row for row in output.splitlines() if row.startswith("+")]
    assert "tail_s: 2.5, stop_s: 2.0" in lines[1]
    assert load_deployment(file).axes["near_far"].config.limits.tail_s == 2.5
    checked = invoke("check", file).output
    assert "designed_for" not in checked
    warning = "WARNING: near_far: its filter needs 1.25 m; stop_distance_m ends it at 1 m"
    assert warning in " ".join(checked.split())


@pytest.mark.slow
def test_a_filter_that_the_adjustable_range_refuses_is_not_written(file: Path) -> None:
    adjustable = "adjustable: { axes.slew.sway.period_s: [1.5, 3.0] }"
    before = f"{file.read_text()}\ncontrol: {{ socket: /tmp/machine.sock, {adjustable} }}\n"
    file.write_text(before)
    words = (str(file), "--axis", "slew", "--second", "0.6,0.1,20", "--write")
    status, output = run(*words)
    assert (status, "control.adjustable.axes.slew.sway.period_s: at 1.5" in output) == (2, True)
    assert file.read_text() == before


@pytest.mark.slow
def test_it_reports_how_far_the_tip_travels_and_a_tail_that_is_too_short(file: Path) -> None:
    words = (str(file), "--axis", "near_far", "--duration")
    good, long = (" ".join(run(*words, seconds)[1].split()) for seconds in ("1.8", "2.4"))
    assert "near_far travels 0.85 m with it; its limits allow 1.00 m." in good
    assert "stop_distance_m" not in good
    assert "tail_s" not in good
    assert "tail_s is 2 s" in long
    assert "It needs 1.19 m: stop_distance_m cuts it short." in long


@pytest.mark.parametrize(
    "words, message",
    [
        (["--axis", "lift"], "expected one with sway data, slew, near_far, got"),
        (["--axis", "boom"], "expected one with sway data, slew, near_far, got"),
        (["--axis", "slew", "--range", "90"], "range of length: expected 0 to 60 %, got 90 %"),
        (["--axis", "slew", "--duration", "0.1"], "expected 0.2 s or more, got 0.1 s"),
        (["--axis", "slew", "--duration", "1", "--residual", "5"], "one of --duration and"),
        (["--axis", "slew", "--residual", "-1"], "or more"),
    ],
)
def test_what_cannot_be_leaves_the_file_alone(file: Path, words: list[str], message: str) -> None:
    before = file.read_bytes()
    status, output = run(str(file), *words, "--write")
    assert status == 2
    assert message in " ".join(output.split())
    assert file.read_bytes() == before
