"""Files that others made: each is refused, in words, and takes no more memory than there is."""

import re

import pytest

from tests.hostile.inputs import FILES
from tests.hostile.run import run

MOST_MB = 200
BAD_DEPLOYMENT = 2


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_it_is_refused(name: str) -> None:
    ran = run(FILES[name])
    lines = ran.text.splitlines()
    assert ran.code == BAD_DEPLOYMENT, ran.text[:2000]
    assert re.fullmatch(r"\d+ problems?", lines.pop())
    assert 1 <= len(lines) <= 101
    for line in lines:
        assert re.match(r".*(machine\.yaml|\.dbc)\b.*: |and \d+ more problems$", line), line
        assert len(line) < 2100
    assert ran.peak_mb < MOST_MB
