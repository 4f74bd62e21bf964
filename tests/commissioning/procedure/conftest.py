"""A machine that ``canshaper init`` has described, in a folder of its own."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.rigs.files import ROOT


@pytest.fixture(scope="session")
def described(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("described")
    shutil.copy(ROOT / "dbc" / "forwarder.dbc", folder / "machine.dbc")
    words = ["init", str(folder / "machine.yaml"), "--dbc", str(folder / "machine.dbc")]
    made = CliRunner().invoke(app, words, input="\n")  # one decision
    assert made.exit_code == 0, made.output
    return folder


@pytest.fixture
def machine(first_day: Path) -> Path:
    """Its two-axis motion is on, as after the first motion."""
    first_day.write_text(first_day.read_text().replace("    waits: true\n", ""))
    return first_day


@pytest.fixture
def first_day(described: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for path in described.iterdir():
        shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    return Path("machine.yaml")
