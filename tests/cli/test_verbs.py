"""Verbs: a new one is one file, errors end each of them alike, --help loads none of their work."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli import verbs
from canshaper.cli.app import app

NEW = '''
from canshaper import errors

GROUP = "look"


def greet_crane(kind: str) -> None:
    """Greet the crane, or fail."""
    if kind == "interrupted":
        raise KeyboardInterrupt
    if kind == "refused":
        raise PermissionError(13, "Permission denied", "/there")
    if kind in vars(errors):
        raise vars(errors)[kind]("no luck")
    print(f"hello {kind}")
'''
# What only the work of a verb needs. (typer takes pydantic itself, where it is there.)
NOT_FOR_HELP = ("asammdf", "can", "cantools", "google", "mcap", "numpy", "rich", "yaml")


@pytest.fixture
def with_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "greet_crane.py").write_text(NEW, encoding="utf-8")
    monkeypatch.setattr(verbs, "__path__", [*verbs.__path__, str(tmp_path)])


@pytest.mark.usefixtures("with_another")
def test_a_new_verb_is_one_file() -> None:
    runner = CliRunner()
    assert "  greet-crane    Greet the crane, or fail." in runner.invoke(app, "--help").stdout
    assert runner.invoke(app, "greet-crane there").stdout == "hello there\n"
    assert "Greet the crane" in runner.invoke(app, "greet-crane -h").stdout


def test_help_has_the_verbs_of_a_group_together() -> None:
    *_, setup, drive, measure, design, look = CliRunner().invoke(app, "--help").stdout.split(":\n")
    assert all(verb in setup for verb in ("  check ", "  commission ", "  init "))
    assert "  run " in drive
    assert "  identify " in measure
    assert "  tune " in design
    assert "  demo " in look


def test_help_cuts_no_sentence_off() -> None:
    shown = CliRunner().invoke(app, ["--help"], prog_name="canshaper").output
    assert "..." not in shown.replace("COMMAND [ARGS]...", "")
    assert "say how sure the result is." in " ".join(shown.split())


@pytest.mark.usefixtures("with_another")
@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("CanshaperError", 2),
        ("UsageError", 2),
        ("LogError", 2),
        ("DesignError", 2),
        ("IdentificationError", 2),
        ("CalibrationError", 1),
        ("ControlError", 1),
        ("BusError", 3),
        ("GatewayError", 3),
    ],
)
def test_an_error_for_a_person_is_one_line_and_an_exit_code(kind: str, code: int) -> None:
    result = CliRunner().invoke(app, f"greet-crane {kind}")
    assert (result.exit_code, result.stderr, result.stdout) == (code, "no luck\n", "")


@pytest.mark.usefixtures("with_another")
def test_a_file_that_is_refused_and_ctrl_c_end_any_verb_in_one_line() -> None:
    for kind, code, text in (
        ("refused", 2, "/there: Permission denied\n"),
        ("interrupted", 130, "interrupted\n"),
    ):
        result = CliRunner().invoke(app, f"greet-crane {kind}")
        assert (result.exit_code, result.stderr, result.stdout) == (code, text, "")


def test_ctrl_c_while_modules_are_loaded_is_no_traceback() -> None:
    code = """
import sys
from canshaper.__main__ import main

class Interrupted:
    def find_spec(self, name, *_):
        if name == "canshaper.cli.app":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupted())
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_an_unknown_verb_is_answered_with_one_like_it() -> None:
    result = CliRunner().invoke(app, "chek")
    assert result.exit_code == 2
    assert "No such command 'chek'" in result.stderr


def loaded_by(*arguments: str) -> set[str]:
    """Packages that a command has imported when it ends."""
    code = (
        "import sys, atexit\n"
        "atexit.register(lambda: print(*{m.partition('.')[0] for m in sys.modules}))\n"
        f"sys.argv = ['canshaper', *{arguments!r}]\n"
        "from canshaper.cli.app import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {*done.stdout.splitlines()[-1].split()}


@pytest.mark.parametrize("arguments", [("--help",), ("run", "--help"), ("--version",)])
def test_help_loads_nothing_of_the_work(arguments: tuple[str, ...]) -> None:
    assert not loaded_by(*arguments) & {*NOT_FOR_HELP}


@pytest.mark.slow
def test_the_daemon_does_not_load_asammdf_through_python_can(tmp_path: Path) -> None:
    (tmp_path / "asammdf.py").write_text("MDF = SignalSource = object\nimport os; os._exit(99)\n")
    run = [sys.executable, "-m", "canshaper", "run", str(tmp_path / "none.yaml")]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(run, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2, done.stderr  # there is no such file
    load = [sys.executable, "-c", "import can"]
    assert subprocess.run(load, check=False, env=environment).returncode == 99


@pytest.mark.slow
def test_the_work_would_be_seen() -> None:
    assert {"cantools", "pydantic", "rich", "yaml"} <= loaded_by("check", "forwarder.yaml")


def test_a_shell_completes_verbs_and_options() -> None:
    environment = {"_CANSHAPER_COMPLETE": "complete_bash", "COMP_CWORD": "1"}
    for words, word, expected in (
        ("canshaper ca", "1", "calibrate"),
        ("canshaper run --li", "2", "--listen-only"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "canshaper"],
            env={**environment, "COMP_WORDS": words, "COMP_CWORD": word},
            capture_output=True,
            text=True,
            check=False,
        )
        assert expected in done.stdout.splitlines(), done.stderr
