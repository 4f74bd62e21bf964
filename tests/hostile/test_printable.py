"""Control characters of others reach neither a terminal nor a log."""

import io
import logging
import os
from pathlib import Path

import pytest
from rich.table import Table
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.daemon.journal import JournalHandler
from canshaper.errors import printable
from canshaper.report.console import SafeConsole
from tests.hostile.inputs import DBC, SHIPPED

CLEAR = "\x1b[2J"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("größe °C 吊り\ttab\n", "größe °C 吊り\ttab\n"),
        (f"a{CLEAR}b", "a\\x1b[2Jb"),
        ("\x00\x07\x08\r\x7f\x85\x9b", "\\x00\\x07\\x08\\r\\x7f\\x85\\x9b"),
        ("\u202egnp.exe \u2066x\u2069\u200f\u2028", "\\u202egnp.exe \\u2066x\\u2069\\u200f\\u2028"),
        ("\udcff", "\\udcff"),
    ],
)
def test_what_is_shown(text: str, shown: str) -> None:
    assert printable(text) == shown


@pytest.mark.parametrize("terminal", [False, True])
def test_names_are_text_on_a_console(terminal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")  # a dumb one has no colours
    file = io.StringIO()
    console = SafeConsole(file=file, force_terminal=terminal, width=100)
    table = Table("a name that is as long as what stands below it")
    table.add_row(f"[red]{CLEAR}[/red]")
    console.print(table)
    console.print(f"[bold]{CLEAR} :smile:", style="bold", highlight=False)
    text = file.getvalue()
    assert CLEAR not in text
    assert "[red]\\x1b[2J[/red]" in text
    assert "[bold]\\x1b[2J :smile:" in text
    assert ("\x1b[1m" in text) is terminal  # its own colours stay


def test_a_line_of_the_log_is_one_line_of_text() -> None:
    reads, writes = os.pipe()
    handler = JournalHandler(writes, journal=True)
    record = logging.LogRecord(
        "canshaper", logging.ERROR, "", 0, "%s", (f"a\n<6>stopped\r{CLEAR}",), None
    )
    handler.emit(record)
    assert os.read(reads, 4096) == b"<3>a | <6>stopped\\r\\x1b[2J\n"
    os.close(reads)
    os.close(writes)


def test_a_file_gives_the_terminal_no_commands(tmp_path: Path) -> None:
    (tmp_path / "a.dbc").write_text(f'{DBC}\nCM_ "{CLEAR}" {CLEAR}\n', encoding="cp1252")
    file = tmp_path / "machine.yaml"
    file.write_text(SHIPPED.replace("../dbc/forwarder.dbc", "a.dbc"))
    for name in ("a.dbc", "none.dbc"):
        file.write_text(SHIPPED.replace("../dbc/forwarder.dbc", name))
        result = CliRunner().invoke(app, ["check", str(file)])
        assert result.exit_code == 2
        assert "\x1b" not in result.output
    assert "\\x1b[2J" in CliRunner().invoke(app, ["check", f"no{CLEAR}.yaml"]).output


def test_a_warning_gives_the_terminal_no_commands(tmp_path: Path) -> None:
    row = f'BA_ "SystemMessageLongSymbol" BO_ 5 "a{CLEAR}b";\nBO_ 5 M: 1 A\n'
    signal = ' SG_ S : 0|9@1+ (1,0) [0|0] "" A\n'
    head, tail = DBC.split("BO_ 272", 1)
    defined = 'BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;\n'
    text = f"{head}{defined}{row}{signal}BO_ 272{tail}"
    (tmp_path / "a.dbc").write_text(text, encoding="cp1252")
    file = tmp_path / "machine.yaml"
    file.write_text(SHIPPED.replace("../dbc/forwarder.dbc", "a.dbc"))
    result = CliRunner().invoke(app, ["check", str(file)])
    assert result.exit_code == 0, result.output
    assert "a\\x1b[2Jb: has 1 bytes, and the signal S is not within them" in result.output
    assert "\x1b" not in result.output


def test_the_channel_of_a_log_gives_the_terminal_no_commands(tmp_path: Path) -> None:
    log = tmp_path / "drive.log"
    log.write_text(f"(1.0) a{CLEAR} 110#00\n(1.1) b{CLEAR} 110#00\n")
    command = ["replay", str(log), "--config", "forwarder.yaml", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2
    assert "\\x1b[2J" in result.output
    assert "\x1b" not in result.output
