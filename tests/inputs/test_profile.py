"""The operator's choice by a code: which name it has, and what is the axis' own filter."""

from typing import cast

import pytest

from canshaper.config.load import load_config
from canshaper.inputs.value import ProfileSwitch, ValueInput, profile_names
from tests.rigs.files import ROOT


class Display:
    """Repeats a code, or is silent."""

    def __init__(self, code: float | None) -> None:
        self.code = code

    def fresh(self, _now_ns: int) -> float | None:
        """The code."""
        return self.code


@pytest.mark.parametrize(
    ("code", "name"), [(1.0, "quick"), (519 * 0.1 + 0.1 - 50.0, "fine"), (3.0, ""), (None, "")]
)
def test_a_code_that_names_none_and_silence_are_the_own_filter(
    code: float | None, name: str
) -> None:
    value = cast(ValueInput, Display(code))
    assert ProfileSwitch(value, {"quick": 1, "fine": 2}).name(0) == name


def test_the_own_filter_comes_first_and_each_profile_once() -> None:
    config, _ = load_config(ROOT / "config/j1939-profiles.yaml")
    assert profile_names(config) == ["", "quick", "fine"]
