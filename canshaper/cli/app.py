"""The ``canshaper`` command: each module of ``canshaper.cli.verbs`` is a verb, loaded on use."""

import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from inspect import cleandoc
from pkgutil import iter_modules
from textwrap import wrap
from typing import Any, cast

import typer
from typer.core import TyperGroup

from canshaper.cli import verbs
from canshaper.cli.common import EXIT_INTERRUPTED, EXIT_WRONG, EXTRAS, echo, fail, install_line
from canshaper.errors import CanshaperError, UsageError

EXAMPLE_WIDTH = 70  # columns of an example; its indent fits in 80 too
SENTENCE = 200  # letters; no first sentence of a verb is longer
# Each verb's module names its GROUP.
GROUPS = {
    "setup": "Set up a machine",
    "drive": "Drive it",
    "measure": "Measure it",
    "design": "Design its filters",
    "look": "Look, without a machine",
}
# These verbs need a scheduler, sockets and signals that only Linux has.
LINUX_ONLY = {"commission", "doctor", "gateway", "metrics", "run", "set"}


class Verbs(TyperGroup):
    """All verbs as one group, each imported when it is used.

    A CanshaperError, Ctrl-C or an OSError that names a file ends a verb with a message and an exit
    code; any other error passes.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        names = sorted(module.name.replace("_", "-") for module in iter_modules(verbs.__path__))
        self.commands = cast(Any, dict.fromkeys(names))  # each loaded when it is used

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the verbs, sorted, without loading one."""
        return list(self.commands)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a verb, loaded at its first use; None where there is no such verb."""
        if cmd_name not in self.commands:
            return None
        return self.commands[cmd_name] or self._load(cmd_name)

    def _load(self, name: str) -> Any:
        one = typer.Typer(
            add_completion=False,
            rich_markup_mode=None,
            context_settings={"help_option_names": ["-h", "--help"]},
        )
        verb = getattr(_module(name), _word(name))
        checked = _linux_only(verb) if name in LINUX_ONLY else verb
        one.command(name, help=pasteable(verb.__doc__ or ""))(checked)
        self.commands[name] = typer.main.get_command(one)
        return self.commands[name]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the verbs by group, each with its whole first sentence; click would shorten it."""
        rows: dict[str, list[tuple[str, str]]] = {group: [] for group in GROUPS}
        for name in self.commands:
            text = self.get_command(ctx, name).get_short_help_str(SENTENCE)
            rows[_module(name).GROUP].append((name, text))
        for group, title in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl(rows[group])

    def invoke(self, ctx: Any) -> Any:
        """Run the verb; print an error that ends it, and raise typer.Exit with its exit code."""
        try:
            return super().invoke(ctx)
        except CanshaperError as error:
            raise fail(error) from None
        except OSError as error:
            if error.filename is None:
                raise
            raise fail(UsageError(f"{error.filename}: {error.strerror or error}")) from None
        except KeyboardInterrupt:
            echo("interrupted", err=True)
            raise typer.Exit(EXIT_INTERRUPTED) from None


def _word(name: str) -> str:
    """Return the name of a verb in Python: that of its module and its function."""
    return name.replace("-", "_")


def _module(name: str) -> Any:
    return import_module(f"{verbs.__name__}.{_word(name)}")


def pasteable(text: str) -> str:
    """Return the help of a verb, its examples ready to paste: a backslash continues a long one."""
    paragraphs = []
    for paragraph in cleandoc(text).split("\n\n"):
        words = " ".join(paragraph.split())
        if words.startswith(("canshaper ", "sudo canshaper ")):
            # After a line with \b click does not wrap the paragraph.
            first, *others = wrap(words, EXAMPLE_WIDTH, break_on_hyphens=False)
            paragraphs.append("\b\n  " + " \\\n      ".join((first, *others)))
        else:
            paragraphs.append(paragraph)
    return "\n\n".join(paragraphs)


def _linux_only(verb: Callable[..., None]) -> Callable[..., None]:
    @wraps(verb)
    def checked(*arguments: Any, **options: Any) -> None:
        if sys.platform != "linux":
            raise UsageError(f"canshaper {verb.__name__}: expected Linux, got {sys.platform}")
        verb(*arguments, **options)

    return checked


app = typer.Typer(
    cls=Verbs,
    help="Sensor-less anti-sway for hydraulic cranes, between joystick and valves on CAN.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
)


def _version(value: bool) -> None:
    if value:
        from canshaper import __version__

        echo(f"canshaper {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Show the version and exit."
    ),
) -> None:
    """Sensor-less anti-sway for hydraulic cranes, between joystick and valves on CAN."""


def main() -> None:
    """Run the command line; a missing optional package ends it with the way to install it."""
    try:
        app(prog_name="canshaper")
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name not in EXTRAS:
            raise
        echo(f"this command needs {name}, which is missing: {install_line(name)}", err=True)
        sys.exit(EXIT_WRONG)
