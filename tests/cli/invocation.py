"""The command line called in this process, and the files of it that are shipped."""

from typing import Any

import typer
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.rigs.files import ROOT

SHIPPED = ROOT / "config" / "forwarder.yaml"
VERBS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def invoke(*arguments: object, columns: int | None = None) -> Any:
    """Call it; ``columns``: width of the terminal."""
    words, env = [str(one) for one in arguments], {"COLUMNS": str(columns)} if columns else None
    return CliRunner().invoke(app, words, prog_name="canshaper", env=env)
