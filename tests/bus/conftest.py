"""A port on raw sockets whose time is that of its line."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from canshaper.bus import raw
from tests.bus.raw_line import Line


@pytest.fixture
def make_line(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Line]]:
    """Makes a line; all of them end with the test."""
    made: list[Line] = []

    def make(*arguments: Any, **options: Any) -> Line:
        made.append(Line(*arguments, **options))
        monkeypatch.setattr(raw, "time", made[-1])
        return made[-1]

    yield make
    for one in made:
        one.end()


@pytest.fixture
def line(make_line: Callable[..., Line]) -> Line:
    """One as it is by default."""
    return make_line()
