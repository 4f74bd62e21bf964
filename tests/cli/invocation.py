"""The command line called in this process, and the files of it that are shipped."""

from typing import Any

import typer
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.rigs.files import ROOT

SHIPPED = ROOT / "config" / "forwarder.yaml"
VERBS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def invoke(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(one) for one in arguments], prog_name="canshaper")
