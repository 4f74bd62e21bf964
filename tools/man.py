"""Write the manual pages, from what the commands say of themselves: ``man.py DIRECTORY``.

canshaper.1 has every verb in a line, canshaper-VERB.1 each with its options and examples.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from canshaper.cli.app import app

BULLET = "\b\n"  # click's mark of a paragraph that stays as it is
STATUS = """.SH EXIT STATUS
.TP
.B 0
done, and nothing is wrong
.TP
.B 1
what was examined is not good, or the daemon refuses
.TP
.B 2
a file or an option is wrong
.TP
.B 3
a bus cannot be opened
.TP
.B 130
interrupted by Ctrl\\-C"""
FILES = """.SH FILES
Of the Debian package:
.TP
.I /etc/canshaper
deployments and, in
.IR dbc ,
their DBC files
.TP
.I /usr/share/canshaper
the same as shipped, and examples for systemd\\-networkd and udev
.TP
.I /usr/share/doc/canshaper
these and all other pages; as a site in
.I html
.SH SERVICE
.B systemctl enable \\-\\-now canshaper@\\c
.I NAME
runs
.I /etc/canshaper/NAME.yaml"""


def escaped(text: str) -> str:
    """Return text with what roff would take as a command escaped."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"(?m)^(?=[.'])", r"\\&", text)


def paragraphs(help_text: str) -> Iterator[str]:
    """Yield the help of a verb as roff, paragraph by paragraph; examples keep their lines."""
    for paragraph in help_text.split("\n\n"):
        if paragraph == "Examples:":
            yield ".SH EXAMPLES"
        elif paragraph.startswith(BULLET):
            yield f".PP\n.EX\n{escaped(paragraph.removeprefix(BULLET))}\n.EE"
        else:
            yield f".PP\n{escaped(paragraph)}"


def heading(name: str, summary: str) -> Iterator[str]:
    """Yield the title and the section NAME of a page, as roff."""
    yield f'.TH "{name.upper()}" 1 "" canshaper "User commands"'
    yield f".SH NAME\n{escaped(name)} \\- {escaped(summary)}"


def page(command: Any, context: Any) -> Iterator[str]:
    """Yield the page of a verb as roff; ``command`` and ``context`` are click's."""
    summary, _, rest = command.help.partition("\n\n")
    yield from heading(f"canshaper-{context.info_name}", " ".join(summary.split()).rstrip("."))
    pieces = escaped(" ".join(command.collect_usage_pieces(context)))
    yield f".SH SYNOPSIS\n.B {escaped(context.command_path)}\n{pieces}"
    yield f".SH DESCRIPTION\n{escaped(summary)}"
    about, _, examples = rest.partition("Examples:")
    yield from paragraphs(about.strip())
    yield ".SH OPTIONS"
    for parameter in command.get_params(context):
        words, text = parameter.get_help_record(context)
        yield f".TP\n.B {escaped(words)}\n{escaped(text)}"
    yield from paragraphs(f"Examples:{examples}")
    yield ".SH SEE ALSO\n.BR canshaper (1)"


def overview(group: Any, context: Any) -> Iterator[str]:
    """Yield the page of the program as roff, with a line for each verb."""
    yield from heading("canshaper", group.help.rstrip("."))
    yield ".SH SYNOPSIS\n.B canshaper\n.I COMMAND\n[OPTIONS] [ARGUMENTS]"
    yield ".SH DESCRIPTION\nReads joystick frames from CAN, shapes each axis of a crane and writes"
    yield "valve frames.\n.B canshaper docs\nserves all pages; it is not a safety function."
    yield ".SH COMMANDS"
    for name in group.list_commands(context):
        summary = group.get_command(context, name).get_short_help_str(200)
        yield f".TP\n.BR canshaper\\-{escaped(name)} (1)\n{escaped(summary)}"
    yield STATUS
    yield FILES


def written(directory: Path) -> list[Path]:
    """Write every page into a directory, delete old ones (canshaper*.1) in it; return the pages."""
    group: Any = typer.main.get_command(app)
    context = typer.Context(group, info_name="canshaper")
    texts = {"canshaper": overview(group, context)}
    for name in group.list_commands(context):
        verb = group.get_command(context, name)
        own = typer.Context(verb, parent=context, info_name=name, **verb.context_settings)
        texts[f"canshaper-{name}"] = page(verb, own)
    directory.mkdir(parents=True, exist_ok=True)
    for old in directory.glob("canshaper*.1"):
        old.unlink()
    for name, lines in texts.items():
        text = re.sub(r"\n{2,}", "\n", "\n".join(lines)) + "\n"
        (directory / f"{name}.1").write_text(text, encoding="utf-8")
    return [directory / f"{name}.1" for name in texts]


if __name__ == "__main__":
    written(Path(sys.argv[1]))
