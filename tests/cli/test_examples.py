"""The examples of every --help, as they stand on a terminal of 80 columns: pasted into a shell."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.cli.invocation import VERBS
from tests.rigs.files import ROOT, machine_file

WIDTH = 80
# Of desk work that is done in a second or two; others need a bus, a log, or minutes.
DONE_SOON = ("check", "config-schema", "operator --list", "profiles", "sim --show")


def examples(verb: str) -> list[str]:
    """Its examples, each with all of its lines."""
    text = CliRunner().invoke(app, [verb, "--help"], terminal_width=WIDTH).stdout
    _, _, behind = text.partition("Examples:")
    shown, _, _ = behind.partition("\nArguments:")
    shown, _, _ = shown.partition("\nOptions:")
    paragraphs = [one.strip() for one in re.split(r"\n\s*\n", shown) if one.strip()]
    for one in paragraphs:
        assert max(map(len, one.splitlines())) < WIDTH - 4
    return paragraphs


EVERY = [(verb, example) for verb in VERBS for example in examples(verb)]


def test_every_verb_has_one() -> None:
    assert {verb for verb, _ in EVERY} == {*VERBS}


@pytest.mark.parametrize(("verb", "example"), EVERY)
def test_an_example_is_one_command_with_options_that_exist(verb: str, example: str) -> None:
    joined = example.replace("\\\n", "")
    assert "\n" not in joined
    words = shlex.split(joined.split(" | ")[0].split(" > ")[0], comments=True)
    words = words[words.index("canshaper") + 1 :]
    assert words.pop(0) == verb
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    command = group.get_command(typer.Context(group), verb)
    assert command is not None
    command.make_context(verb, words)


SOON = [
    example
    for verb, example in EVERY
    if any(
        verb == soon.split()[0] and all(word in example for word in soon.split()[1:])
        for soon in DONE_SOON
    )
]


@pytest.mark.slow
@pytest.mark.parametrize("example", SOON)
def test_an_example_of_desk_work_runs_as_it_is_pasted(tmp_path: Path, example: str) -> None:
    (tmp_path / "config").symlink_to(ROOT / "config")
    machine_file(tmp_path, "j1939-profiles")
    script = f'canshaper() {{ {shlex.quote(sys.executable)} -m canshaper "$@"; }}\n{example}\n'
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_there_are_some_that_run() -> None:
    assert len(SOON) >= len(DONE_SOON)
