"""Report of a verb as one HTML file, to read without a network, to print on A4, and to sign."""

import socket
from base64 import b64encode
from collections.abc import Iterable
from datetime import datetime
from html import escape
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

import canshaper
from canshaper.errors import printable

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment

_STYLE = """
@page { size: A4; margin: 15mm 20mm }
body { font: 10pt/1.35 "DejaVu Sans", Arial, sans-serif; color: #222; background: #fff;
  max-width: 170mm; margin: 8mm auto; overflow-wrap: anywhere }
@media screen { body { padding: 0 4mm } }
h1 { font-size: 16pt; margin: 0 0 4mm } h2 { font-size: 11pt; margin: 5mm 0 1mm }
pre { font: 8pt/1.3 "DejaVu Sans Mono", monospace; white-space: pre-wrap; margin: 1.5mm 0 }
p { margin: 1.5mm 0; white-space: pre-wrap }
.verdict { font-size: 12pt; font-weight: bold; border: .5mm solid #222; padding: 2mm 3mm }
table { border-collapse: collapse; margin: 3mm 0; font-size: 9pt; break-inside: avoid }
.facts th { white-space: nowrap; overflow-wrap: normal }
caption { text-align: left; font-weight: bold; padding-bottom: 1mm }
th, td { padding: .6mm 2.5mm .6mm 0; border-bottom: .2mm solid #bbb; text-align: left;
  vertical-align: top; white-space: pre-wrap }
.figures { overflow-wrap: break-word } .figures td:empty { min-width: 28mm; height: 7mm }
.right { text-align: right; font-variant-numeric: tabular-nums }
figure { margin: 4mm 0; break-inside: avoid } img { width: 100% }
.sign { margin-top: 12mm; break-inside: avoid } .sign td { width: 50mm; height: 14mm;
  vertical-align: bottom; border-bottom: .3mm solid #222 } .sign th { border: 0; font-weight: 400 }
.sign td, .sign th { border-right: 6mm solid #fff }
"""
_SIGNATURES = ("name", "date", "signature")


def document(
    title: str,
    facts: Iterable[tuple[str, str]],
    parts: Iterable[str],
    first: Iterable[str] = (),
    *,
    signed: bool = True,
) -> str:
    """Return the whole HTML file; it loads nothing and runs no script.

    Args:
        title: title of the report.
        facts: (name, value) of each fact about the report, in order.
        parts: results of ``text``, ``table`` and ``picture``, in order.
        first: such parts before the facts.
        signed: leave room for name, date and signature.
    """
    rows = "".join(f"<tr><th>{_safe(k)}</th><td>{_safe(v)}</td></tr>" for k, v in facts)
    lines = "".join("<td></td>" for _ in _SIGNATURES)
    words = "".join(f"<th>{word}</th>" for word in _SIGNATURES)
    sign = f'<table class="sign"><tr>{lines}</tr><tr>{words}</tr></table>' * signed
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        '<meta http-equiv="Content-Security-Policy"'
        " content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">"
        f"<title>{_safe(title)}</title><style>{_STYLE}</style></head><body>\n"
        f"<h1>{_safe(title)}</h1>\n"
        + "\n".join(first)
        + f'\n<table class="facts">{rows}</table>\n'
        + "\n".join(parts)
        + f"\n{sign}\n</body></html>\n"
    )


def facts(deployment: "Deployment | None", date: datetime) -> list[tuple[str, str]]:
    """Return (name, value) of date, host, program, and the deployment, if given, with hashes."""
    rows = [
        ("date", f"{date:%Y-%m-%d %H:%M %Z}"),
        ("machine", socket.gethostname()),
        ("canshaper", canshaper.__version__),
    ]
    if deployment:
        rows.append(("deployment", str(deployment.path)))
        rows += [("", line) for line in deployment.identity.lines()]
    return rows


def verdict(line: str) -> str:
    """Return the result of the verb, a sentence, as HTML in a frame."""
    return f'<p class="verdict">{_safe(line)}</p>'


def heading(line: str) -> str:
    """Return a heading as HTML."""
    return f"<h2>{_safe(line)}</h2>"


def listing(lines: str) -> str:
    """Return lines of a file as HTML that keeps their spaces."""
    return f"<pre>{_safe(lines)}</pre>"


def text(line: str) -> str:
    """Return one or more lines of text as HTML."""
    return f"<p>{_safe(line)}</p>"


def table(shown: Table) -> str:
    """Return a table of the terminal as HTML, its columns aligned as on the terminal."""
    sides = [' class="right"' if column.justify == "right" else "" for column in shown.columns]

    def row(kind: str, cells: Iterable[object]) -> str:
        pairs = zip(sides, cells, strict=True)
        return "".join(f"<{kind}{side}>{_cell(cell)}</{kind}>" for side, cell in pairs)

    heads = row("th", (column.header for column in shown.columns))
    rows = zip(*(column.cells for column in shown.columns), strict=True)
    body = "".join(f"<tr>{row('td', cells)}</tr>\n" for cells in rows)
    caption = f"<caption>{_cell(shown.title)}</caption>" if shown.title else ""
    return f'<table class="figures">{caption}<tr>{heads}</tr>\n{body}</table>'


def picture(data: bytes, kind: str, name: str) -> str:
    """Return a picture as HTML that contains its data.

    Args:
        data: content of the picture file.
        kind: "svg+xml" or "png".
        name: description for readers who cannot see the picture.
    """
    code = b64encode(data).decode("ascii")
    return f'<figure><img alt="{_safe(name)}" src="data:image/{kind};base64,{code}"></figure>'


def _cell(cell: object) -> str:
    return _safe(cell.plain if isinstance(cell, Text) else str(cell))


def _safe(words: str) -> str:
    return escape(printable(words))
