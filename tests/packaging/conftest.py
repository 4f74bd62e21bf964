"""Packages that are built once for these tests."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SITE = ROOT / "out" / "site"


def built(tree: Path = ROOT) -> "subprocess.CompletedProcess[str]":
    """Run the builder of the site in a tree."""
    command = [sys.executable, "tools/site/build.py"]
    return subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)


@pytest.fixture(scope="session")
def site() -> Path:
    """The site, built from the pages as they are."""
    done = built()
    assert (done.returncode, done.stderr) == (0, "")
    return SITE
