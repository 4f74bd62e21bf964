"""The commands of README and docs: every one is well formed; those of a desk run, as pasted.

What the pages show as their output is what they print.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.docs.pages import PAGES, ROOT

COMMANDS: Any = typer.main.get_command(app)
CONSOLE = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHOWN = re.compile(r"<!-- canshaper (.*?) -->\n(?:```text\n)?(.*?)(?:^```|<!-- end)", re.M | re.S)
# Pages whose commands are pasted into a shell, where config/ and dbc/ are as in the repository.
PASTED = {"calibration.md": 1, "identification.md": 2, "tuning.md": 2}
# Of a page that is pasted: what needs a machine, or a log that the page does not make.
ELSEWHERE = ("/etc/canshaper/", "sudo ", "drive.log", "Gyroscope.csv")
NOT_PASTED = {
    "campaign.md": "hours of drives, or a cluster",
    "commission.md": "tests/commissioning/procedure/test_day.py goes its way",
    "doctor.md": "examines this PC for a minute, as root; tests/hil/test_doctor.py",
    "export.md": "needs a compiler; tests/native/test_export.py",
    "guide.md": "tests/docs/test_guide.py goes its way in lock-step",
    "monitor.md": "a daemon, logs of a machine; tests/commissioning/monitor, tests/recording",
    "replay.md": "logs of a machine; tests/recording",
    "sensor.md": "a machine",
    "studio.md": "serves until it is stopped; tests/studio/test_playback.py opens drives",
    "study.md": "serves until it is stopped; tests/studio/test_browser_study.py",
    "work.md": "minutes of drives; tests/campaign/test_work.py",
    "service.md": "installs the package; tests/systemd, and tools/image.sh tries the image",
}
# Outputs that are not compared, by how their commands begin, and why.
NOT_COMPARED = {
    "compare": "minutes; tests/design holds the table of the first file",
    **dict.fromkeys(("work", "profiles forwarder-load.yaml"), "minutes; tests/campaign has them"),
    "monitor forwarder.yaml, next to run, sim and operator": "a picture of one moment",
}


def pasted(page: Path) -> list[str]:
    """The shell commands of a page, each with all of its lines."""
    blocks = CONSOLE.findall(page.read_text(encoding="utf-8"))
    lines = "".join(blocks).replace("\\\n", "").splitlines()
    return [line[2:].strip() for line in lines if line.startswith(("$ ", "# "))]


def words_of(command: str) -> list[str] | None:
    """Return the words behind canshaper on a command line; None for another program."""
    shell = shlex.shlex(command, posix=True, punctuation_chars=True)
    shell.whitespace_split = True
    words = [*takewhile(lambda word: not set(word) <= set("|&;>"), shell)]
    words = words[words[:1] == ["sudo"] :]
    return words[1:] if words[:1] == ["canshaper"] else None


OURS = [
    (page.name, command)
    for page in PAGES
    for command in pasted(page)
    if words_of(command) is not None
]
RUN = [
    (page.name, command)
    for page in PAGES
    if page.name in PASTED
    for command in pasted(page)
    if not any(word in f"{command} " for word in ELSEWHERE)
]
OUTPUTS = [
    (page.name, command, text)
    for page in PAGES
    for command, text in SHOWN.findall(page.read_text(encoding="utf-8"))
    if not command.startswith(tuple(NOT_COMPARED))
]


@pytest.mark.parametrize(("page", "command"), OURS)
def test_a_command_is_well_formed(page: str, command: str) -> None:
    words = words_of(command)
    assert words
    if words == ["--help"]:
        return
    group = typer.Context(COMMANDS)
    verb = COMMANDS.get_command(group, words[0])
    assert verb is not None
    verb.make_context(words[0], [word for word in words[1:] if word != "$BUS"])


def test_every_page_with_commands_is_pasted_or_says_why_not() -> None:
    pages = {page for page, _ in OURS}
    assert pages == {*PASTED, *NOT_PASTED}
    counts = {page: sum(one == page for one, _ in RUN) for page in PASTED}
    assert all(counts[page] >= least for page, least in PASTED.items()), counts


@pytest.mark.slow
@pytest.mark.processes
@pytest.mark.parametrize("page", PASTED)
def test_the_commands_of_a_page_run_as_they_are_pasted(page: str, tmp_path: Path) -> None:
    for name in ("config", "dbc"):
        shutil.copytree(ROOT / name, tmp_path / name)
    (tmp_path / "docs").mkdir()
    commands = [command for one, command in RUN if one == page]
    python = shlex.quote(sys.executable)
    begin = ["set -e", f'canshaper() {{ {python} -m canshaper "$@"; }}']
    script = "\n".join([*begin, f'python() {{ {python} "$@"; }}', *commands])
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("page", "command", "shown"), OUTPUTS)
def test_a_page_shows_what_the_command_prints(
    page: str, command: str, shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Line by line; a page may leave lines out, and spaces at their begin."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")  # not of the terminal of who runs it
    printed = CliRunner().invoke(app, shlex.split(command)).stdout
    there = {" ".join(line.split()) for line in printed.splitlines()}
    rows = [" ".join(line.split()) for line in shown.splitlines() if line.strip()]
    assert rows
    assert [row for row in rows if row not in there] == []
