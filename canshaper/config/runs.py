"""Long lists of numbers in a file: equal neighbours stand as one entry, such as ``39 x 0``."""

import re
from collections.abc import Sequence
from itertools import groupby
from typing import Any

RUN = r"([1-9][0-9]{0,3}) x ([0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?)"
_RUN = re.compile(RUN)
_MOST = 10_000  # far above any list's own limit: what a few runs could make is not made


def shortened(numbers: Sequence[float]) -> list[float | str]:
    """The list as it is written; ``expanded`` gives the same numbers back, to the last bit."""
    runs: list[float | str] = []
    for number, equal in groupby(numbers):
        count = len([*equal])
        runs.append(number if count == 1 else f"{count} x {number!r}".removesuffix(".0"))
    return runs


def expanded(entries: Any) -> Any:
    """The list as it is meant; what is no run of a number stays for others to judge."""
    if not isinstance(entries, list):
        return entries
    numbers: list[Any] = []
    for entry in entries:
        run = _RUN.fullmatch(entry) if isinstance(entry, str) else None
        numbers += [float(run[2])] * int(run[1]) if run else [entry]
        if len(numbers) > _MOST:
            break
    return numbers
