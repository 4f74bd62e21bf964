"""One number out of a message: what of its signal can be a measurement."""

import sys

import pytest
from cantools.database.can import Signal
from cantools.database.conversion import BaseConversion

from canshaper.inputs.value import measurable

LARGEST = sys.float_info.max


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (-100.0, 100.0, (-100.0002, 100.0002)),  # decimals are rounded
        (0.0, 50.0, (-0.00005, 50.00005)),
        (0.0, 0.0, (-LARGEST, LARGEST)),  # [0|0] says nothing in a DBC
        (None, None, (-LARGEST, LARGEST)),
        (None, 5.0, (-LARGEST, LARGEST)),
        (5.0, None, (-LARGEST, LARGEST)),
        (5.0, 5.0, (-LARGEST, LARGEST)),
    ],
)
def test_the_range_of_the_dbc_where_it_says_one_and_never_infinity(
    low: float | None, high: float | None, expected: tuple[float, float]
) -> None:
    conversion = BaseConversion.factory(1, 0)
    signal = Signal("Flow", 0, 16, conversion=conversion, minimum=low, maximum=high)
    assert measurable(signal) == pytest.approx(expected, rel=1e-12)
