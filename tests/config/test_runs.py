"""Runs of equal numbers: what is written short is read back to the last bit."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.config.section import expanded
from canshaper.edit.edit import shortened
from tests.config.conftest import Load, Problems

TAPS = st.lists(st.floats(0, 1) | st.sampled_from([0.0, 0.1, 1e-7]), max_size=50)


@given(TAPS)
def test_what_is_short_is_the_same_list(taps: list[float]) -> None:
    short = shortened(taps)
    assert expanded(short) == taps
    assert len(short) <= len(taps)


def test_a_plateau_is_one_entry() -> None:
    assert shortened([0.1, 0.1, 0.1, 0.25, 0.0, 0.0]) == ["3 x 0.1", 0.25, "2 x 0"]


def filtered(text: str, taps: str) -> str:
    old = "{ kind: gff, a1: 0.708, a2: 0.12 }"
    return text.replace(old, f"{{ kind: robust, tick_ms: 20, taps: {taps} }}", 1)


def test_a_file_may_have_them(load: Load, shipped: str) -> None:
    config = load(filtered(shipped, "[2 x 0.25, 0.5, 3 x 0]"))
    assert config.axes["slew"].filter.parameters()["taps"] == [0.25, 0.25, 0.5, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "taps", ["[0 x 1, 1]", "[-1 x 1]", "[2 x -0.5]", "[2x 0.5]", "[2 x .5]", "[x 1]", "[99999 x 0]"]
)
def test_what_is_no_run_is_no_number(problems: Problems, shipped: str, taps: str) -> None:
    (problem,) = problems(filtered(shipped, taps))
    assert "axes.slew.filter.taps.0: expected 0 to 1, got '" in problem


def test_runs_cannot_make_a_list_without_end(problems: Problems, shipped: str) -> None:
    (problem,) = problems(filtered(shipped, f"[{'9999 x 0, ' * 5000}1]"))
    assert "axes.slew.filter.taps: expected 1000 entries at most, got [0.0, 0.0" in problem
    assert len(expanded(["9999 x 0"] * 5000)) < 20_000
