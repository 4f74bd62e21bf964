"""``canshaper commission --simulated`` of machine.yaml in this folder, and what it leaves."""

import json
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from canshaper.cli.app import app

COPY = Path("machine.rehearsal.yaml")
STATE = Path("machine.rehearsal.commission.json")
FOLDER = Path("machine.rehearsal.commission")


def commission(*words: str, answers: str = "", code: int = 0) -> str:
    arguments = ["commission", "machine.yaml", "--simulated", *words]
    result = CliRunner().invoke(app, arguments, input=answers)
    assert result.exit_code == code, result.output
    return result.output


def steps() -> Any:
    return json.loads(STATE.read_text())["steps"]
