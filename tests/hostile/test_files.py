"""Files that others made: each is refused, in words, and takes no more memory than there is."""

import pytest

from tests.hostile.inputs import FILES
from tests.hostile.run import run

MOST_MB = 200
BAD_DEPLOYMENT = 2


@pytest.mark.parametrize("name", FILES)
def test_it_is_refused(name: str) -> None:
    ran = run(FILES[name])
    lines = ran.text.splitlines()
    assert ran.code == BAD_DEPLOYMENT, ran.text[:2000]
    assert 1 <= len(lines) <= 102
    assert max(map(len, lines)) < 2100
    assert "Traceback" not in ran.text
    assert all(
        "machine.yaml" in line or ".dbc" in line or " more problems" in line for line in lines
    )
    assert ran.peak_mb < MOST_MB
