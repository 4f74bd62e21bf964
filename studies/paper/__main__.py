"""``python -m studies.paper``: the paper's figures and numbers on the simulated crane."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from canshaper.cli.common import (
    echo,
    fail,
    install_line,
    loader,
)
from canshaper.report.console import SafeConsole
from canshaper.shipped import data_directory
from tools.marks import with_sections

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from studies.paper.study import Study

EXIT_INTERRUPTED = 130
PAGE = Path(__file__).parents[1] / "README.md"

app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def reproduce(
    out: Path = typer.Option(Path("out/paper"), "--out", help="Directory for what is made."),
    figure: list[int] | None = typer.Option(
        None,
        "--figure",
        metavar="N",
        help="Only this figure, 3, 4, 6, 7 or 8, and no table. May be given several times.",
    ),
    write: bool = typer.Option(False, "--write", help="Write the tables into studies/README.md."),
) -> None:
    """Make the paper's figures again and hold its numbers against ours.

    The paper is "Optimal sway motion reduction in forestry cranes" (2024). Figures 3 and 4: the
    poles of the filter; 6: Bode plot; 7 and 8: without and with the optimal filter. All on the
    nonlinear grapple with assumed parameters, for the paper publishes none: Eq. 13 on a valve that
    only lags, and the shipped controller on a valve with rate limit, deadband and resolution.

    Writes figure-N.png and figure-N.json, and the table as paper.json. Takes some seconds.

    Examples:

      python -m studies.paper

      python -m studies.paper --figure 7 --figure 8

      python -m studies.paper --out paper-figures
    """
    console = SafeConsole()
    try:
        _reproduce(out, figure or [], console, write)
    except KeyboardInterrupt:
        echo("interrupted", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None


def _reproduce(out: Path, chosen: list[int], console: Console, write: bool) -> None:
    from canshaper.errors import ConfigError
    from studies.paper.study import FIGURES, Study, steps
    from studies.paper.table import page_sections, print_paper_table

    for number in chosen:
        if number not in FIGURES:
            known = ", ".join(map(str, FIGURES))
            raise fail(ValueError(f"--figure: expected one of {known}, got {number}"))
    figures = tuple(n for n in FIGURES if n in chosen or not chosen)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise fail(ValueError(f"--out {out}: {error.strerror}")) from None
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), console=console
    ) as progress:
        count = steps(figures, table=not chosen) + len(figures)
        task = progress.add_task("drives and figures", total=count)
        try:
            # The shipped file itself: numbers of the paper are not those of a user's machine.
            load = loader(str(data_directory() / "config" / "forwarder.yaml"))
            study = Study(load(), lambda: progress.advance(task))
            # Every number comes before the first file: an interruption leaves no half of a set.
            numbers = {n: study.figure_numbers(n) for n in figures}
            table = None if chosen else study.table()
        except (ConfigError, ValueError) as error:
            raise fail(error) from None
        drawn: list[tuple[str, Path]] = []
        for n in figures:
            picture = _picture(study, n)
            _write(out / f"figure-{n}.json", numbers[n] | {"finding": picture[0]})
            path = out / f"figure-{n}.png"
            if picture[1] is not None:
                from canshaper.report.style import save

                save(picture[1], path)
                drawn.append((picture[0], path))
            progress.advance(task)
    if table is not None:
        _write(out / "paper.json", table)
        print_paper_table(table, console)
        if write:
            text = with_sections(PAGE.read_text("utf-8"), page_sections(table), "measured")
            PAGE.write_text(text, encoding="utf-8")
        console.print(f"Table: {out / 'paper.json'}")
    for finding, path in drawn:
        console.print(f"{path}: {finding}")
    if not drawn:
        console.print(f"Pictures: none, matplotlib is missing: {install_line('matplotlib')}")


def _picture(study: "Study", number: int) -> "tuple[str, Figure | None]":
    """Finding and picture of a figure; no picture without matplotlib."""
    try:
        from studies.paper import draw as paper_figures
        from studies.paper import draw_bode as paper_bode
    except ImportError:
        return "", None
    if number == 6:
        curves = study.curves()
        drawn = paper_bode.bode_figure(curves, study.turning().omegas_rad_s)
        return paper_bode.bode_finding(curves), drawn
    if number in (3, 4):
        pairs = study.ladder(number)
        return paper_figures.pole_finding(pairs), paper_figures.pole_figure(pairs)
    runs, claims = study.optimal(number), study.claims(number)
    return paper_figures.optimum_finding(runs[0], claims), paper_figures.optimum_figure(
        runs, claims
    )


def _write(path: Path, data: dict[str, Any]) -> None:
    text = json.dumps(data, indent=2, allow_nan=False, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    app(prog_name="python -m studies.paper")
