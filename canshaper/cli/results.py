"""Output of a verb: lines and tables on the terminal, pictures, and all of it as one HTML file."""

import io
import json
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.table import Table

from canshaper import __version__
from canshaper.cli.common import echo, install_line
from canshaper.errors import UsageError
from canshaper.report import html
from canshaper.report.console import SafeConsole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.machine.deployment import Deployment

FORMATS = (".png", ".svg", ".pdf")
# A larger SVG enters the report as PNG, so that the report stays below 2 MB.
MOST_SVG_BYTES = 400_000


class Results(SafeConsole):
    """Console of a verb; what ``print`` gets also goes into the report.

    Args:
        title: title of the report.
        deployment: deployment that the results are about, if any; a verb may set it later.
        report: file to write the report to; None for no report.
        picture: file for the picture, instead of the verb's default.
        options: options of rich's console.

    Raises:
        UsageError: report or picture has a suffix that cannot be written.
        OSError: the folder of either cannot be made.
    """

    def __init__(
        self,
        title: str,
        deployment: "Deployment | None",
        report: Path | None,
        picture: Path | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        suffixes = (("--report", report, (".html",)), ("--picture", picture, FORMATS))
        for option, path, known in suffixes:
            if path and path.suffix not in known:
                got = f"got {path}"
                raise UsageError(f"{option}: expected a file with {' or '.join(known)}, {got}")
            if path:  # an error here comes before minutes of driving
                path.parent.mkdir(parents=True, exist_ok=True)
        self._title = title
        self.deployment = deployment
        self._report = report
        self._picture = picture
        self._date = datetime.now().astimezone()
        self._parts: list[str] = []

    def print(self, *objects: Any, **options: Any) -> None:
        """Print on the terminal, and keep it for the report."""
        for one in objects:
            self._parts.append(html.table(one) if isinstance(one, Table) else html.text(str(one)))
        super().print(*objects, **options)

    def picture(self, path: Path | None, figure: Callable[[], "Figure"]) -> Path | None:
        """Draw a picture, stamp it with file, version and date, write it and add it to the report.

        Args:
            path: file unless --picture names one; None to draw it for the report only.
            figure: draws the picture; not called where neither a file nor a report is asked for.

        Returns:
            The written file; None if none was written or matplotlib is missing.
        """
        path = self._picture or path
        if not (path or self._report):
            return None
        try:
            from canshaper.report.style import save, stamp
        except ImportError:
            self._parts.append(html.text(_no_picture()))
            return None
        drawn = figure()
        name = f"{self.deployment.path.name}, " if self.deployment else ""
        stamp(drawn, f"{name}canshaper {__version__}, {self._date:%Y-%m-%d}")
        if path:
            path.parent.mkdir(parents=True, exist_ok=True)
            save(drawn, path)
        if self._report:
            self._parts.append(_embedded(drawn, self._title))
        return path

    def picture_line(self, path: Path | None) -> None:
        """Print, not in the report, where the picture is; None means that matplotlib is missing."""
        super().print(f"Picture: {path or _no_picture()}", soft_wrap=True)

    def conclude(
        self,
        show: Callable[["Results"], None],
        *,
        figure: Callable[[], "Figure"] | None = None,
        path: Path | None = None,
        data: Callable[[Path | None], Mapping[str, Any]] | None = None,
        finish: Callable[[], Sequence[str]] = list,
        code: int = 0,
    ) -> None:
        """End a verb: draw, write, then show, as the reader of the output may end at any line.

        Args:
            show: prints the results.
            figure: draws their picture; None where there is nothing to draw.
            path: file of the picture unless --picture names one; None: for the report only.
            data: returns what --json prints, given the written picture; None without --json.
            finish: writes into the deployment file; returns lines on that, and what to do next.
            code: exit code.

        Raises:
            typer.Exit: the exit code is not 0.
        """
        before = len(self._parts)
        drawn = self.picture(path, figure) if figure else None
        drawing, self._parts[before:] = self._parts[before:], []
        lines = finish()
        show(self)
        self._parts += drawing
        if data:
            echo(json.dumps(data(drawn), indent=2, default=str))
        if figure and (path or self._picture):
            self.picture_line(drawn)
        if lines:
            self.print("\n".join(lines), soft_wrap=True)
        self.write(code)

    def write(self, code: int = 0) -> None:
        """Write the report if --report asks for one; then raise the exit code, if it is not 0."""
        if self._report:
            command = ("command", shlex.join(["canshaper", *sys.argv[1:]]))
            facts = [command, *html.facts(self.deployment, self._date)]
            whole = html.document(self._title, facts, self._parts)
            self._report.write_text(whole, encoding="utf-8")
            super().print(f"Report: {self._report}", soft_wrap=True)
        if code:
            raise typer.Exit(code)


def _no_picture() -> str:
    return f"none, matplotlib is missing: {install_line('matplotlib')}"


def _embedded(drawn: "Figure", name: str) -> str:
    """Return a picture for the report: SVG, or PNG if the SVG is too large."""
    data = _file(drawn, "svg")
    if len(data) < MOST_SVG_BYTES:
        return html.picture(data, "svg+xml", name)
    return html.picture(_file(drawn, "png"), "png", name)


def _file(drawn: "Figure", kind: str) -> bytes:
    file = io.BytesIO()
    drawn.savefig(file, dpi=drawn.dpi, format=kind)
    return file.getvalue()
