"""The runner of every path: it confirms claims that hold, and refutes others."""

import pytest

from tests.proof.symbolic import Paths, implies, integer, real, size


def test_every_path_is_run() -> None:
    x, seen = real("x"), set()

    def run() -> object:
        way = "low" if x < 1.0 else "high" if x > 2.0 else "between"
        seen.add(way)
        return implies(x > 3.0, way == "high")

    paths = Paths(x > 0.0)
    paths.prove(run)
    assert seen == {"low", "high", "between"}
    assert paths.count == 3


def test_a_claim_that_does_not_hold_is_refused_with_numbers() -> None:
    n = integer("n")
    with pytest.raises(AssertionError, match="n = "):
        Paths(n > 0).prove(lambda: size(n) < 7 if n < 9 else True)
