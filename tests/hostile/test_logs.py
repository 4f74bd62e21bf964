"""Bundles and logs that others made: refused, and nothing outside of them is read or written."""

from pathlib import Path

import pytest

from tests.hostile.inputs import LOGS, SECRET
from tests.hostile.run import run

MOST_MB = 200
BAD_LOG = 2


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS)
def test_it_is_refused(name: str) -> None:
    ran = run(LOGS[name])
    assert ran.code == BAD_LOG, ran.text[:2000]
    assert not Path("/tmp/evil").exists()
    (line,) = ran.text.splitlines()
    assert len(line) < 2100
    assert "bundle.zip: " in line or "machine.yaml:" in line or "drive.log.gz:" in line
    assert SECRET not in line
    assert "root:" not in line
    assert ran.peak_mb < MOST_MB
