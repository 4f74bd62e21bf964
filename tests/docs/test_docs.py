"""README and docs name what exists: files, verbs and their options, states, reasons, faults."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from canshaper.cli.app import app
from canshaper.codec.frame import FrameFault
from canshaper.shaping.states import Reason, State
from tests.docs.pages import PAGES, ROOT

COMMANDS: Any = typer.main.get_command(app)
CODE = re.compile(r"`([^`\n]+)`|^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"\b(?<!from )canshaper ([a-z][a-z-]*)((?:[^\S\n]+[^\s`|;&#]+|[^\S\n]*\\\n)*)")
NAMES = {member.name for kind in (State, Reason, FrameFault) for member in kind}


def test_the_drawing_of_the_rooms_is_that_of_the_tree() -> None:
    command = [sys.executable, str(ROOT / "tools" / "architecture.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text)
    local = [link for link in targets if "://" not in link]
    assert [link for link in local if not (page.parent / link).exists()] == []


def headings(page: Path) -> set[str]:
    """Anchors of the headings of a page."""
    text = re.sub(
        r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    lines = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_anchors_are_headings(page: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]*)#([^)\s]+)\)", page.read_text(encoding="utf-8"))
    local = [(page.parent / file if file else page, a) for file, a in links if "://" not in file]
    wrong = [
        (file.name, a) for file, a in local if file.suffix == ".md" and a not in headings(file)
    ]
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_commands_and_options_are_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    wrong = []
    for code in CODE.finditer(text):
        for verb, rest in COMMAND.findall(code[1] or code[2]):
            command = COMMANDS.get_command(None, verb)
            if command is None:
                wrong.append(verb)
                continue
            known = {option for parameter in command.params for option in parameter.opts}
            options = re.findall(r"(?<=\s)--[a-z][a-z-]*", rest)
            wrong += [f"{verb} {o}" for o in options if o not in {*known, "--help"}]
    assert wrong == []


def test_troubleshooting_names_real_states_and_reasons() -> None:
    text = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    names = set(re.findall(r"\b[A-Z]{2,}(?:_[A-Z]+)+\b|\b(?:TRIPPED|STOPPING|READY|START)\b", text))
    assert names
    assert names <= NAMES


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_tests_are_where_a_page_says(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = set(re.findall(r"(?<![\w/])(?:tests/)?((?:[a-z0-9_]+/)+test_[a-z0-9_]+)", text))
    assert [name for name in sorted(named) if not (ROOT / "tests" / f"{name}.py").exists()] == []
