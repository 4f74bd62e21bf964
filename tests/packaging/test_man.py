"""The manual pages: one for every verb, without a warning of man or groff, as --help has it."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import Verbs, app
from tests.lane.outcome import NoLane
from tests.lane.packages import install, missing

ROOT = Path(__file__).parents[2]
VERBS = Verbs(name="canshaper").list_commands(None)
pytestmark = pytest.mark.processes


def run(*words: str, **environment: str) -> str:
    """Standard output of a program that succeeds without a word on standard error."""
    variables = {"PATH": "/usr/bin:/bin", "LC_ALL": "C.UTF-8", **environment}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=variables)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.fixture(scope="module")
def man() -> None:
    try:
        install(missing({"groff": "groff", "man": "man-db"}))
    except NoLane as error:
        pytest.skip(f"nothing shows manual pages: {error}")


@pytest.fixture(scope="module")
def pages(man: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("man")
    run(sys.executable, str(ROOT / "tools" / "man.py"), str(directory))
    return directory


def shown(page: Path) -> str:
    text = run("man", "--warnings", "--local-file", str(page), MANWIDTH="400", MAN_KEEP_STDERR="1")
    return re.sub(r".\x08", "", text)


def test_the_program_names_every_verb(pages: Path) -> None:
    text = shown(pages / "canshaper.1")
    assert {*re.findall(r"canshaper-([a-z-]+)\(1\)", text)} == {*VERBS}
    assert {page.stem for page in pages.iterdir()} == {"canshaper"} | {
        f"canshaper-{verb}" for verb in VERBS
    }


@pytest.mark.parametrize("verb", VERBS)
def test_a_page_has_the_options_and_examples_of_help(verb: str, pages: Path) -> None:
    page = pages / f"canshaper-{verb}.1"
    run("groff", "-man", "-ww", "-z", "-Tutf8", "-Kutf8", str(page))
    text = shown(page)
    printed = CliRunner().invoke(app, [verb, "--help"], terminal_width=400).stdout
    about, _, rest = printed.partition("Examples:")
    options = set(re.findall(r"(?m)^  (--?[a-z][a-z-]*)", rest.partition("Options:")[2] or about))
    assert options
    for option in options:
        assert re.search(rf"(?m)^ +{option}\b", text), option
    examples, _, _ = rest.partition("\nArguments:" if "\nArguments:" in rest else "\nOptions:")
    for line in examples.splitlines():
        assert line.strip() in text, line


def test_text_that_roff_would_read_as_its_own_is_shown(man: None, tmp_path: Path) -> None:
    tool = runpy.run_path(str(ROOT / "tools" / "man.py"))
    text = tool["escaped"](".hidden 'a\n'first \\d a-b")
    (tmp_path / "a.1").write_text(f".TH A 1\n{text}\n")
    assert ".hidden 'a 'first \\d a-b" in shown(tmp_path / "a.1")
