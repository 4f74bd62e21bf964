"""The paper's numbers against ours: for the terminal, in 80 columns, and for studies/README.md."""

from collections.abc import Mapping
from typing import Any, Final

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

_METRICS: Final = ("peak", "rms", "residual")
_VERDICT: Final = {True: "yes", False: "no", None: "open"}


def print_paper_table(data: Mapping[str, Any], console: Console) -> None:
    """Print the reductions, what they say in words, and the other numbers.

    Args:
        data: content of paper.json, see ``studies.paper.study``.
        console: where to print.
    """
    console.print(Text("Reduction of the swing in percent; + where it exceeds the paper's", "bold"))
    console.print(_reductions(data["reductions"]))
    for sentence in data["in_words"]:
        console.print(f"- {sentence}", highlight=False)
    console.print()
    console.print(Text("Other printed numbers", "bold"))
    console.print(_others(data["others"]))
    for i, row in enumerate(data["others"], 1):
        console.print(Text(f"{i}: section {row['section']}; {row['remark']}."))
    console.print()
    console.print(f"Drive: {data['drive']}.", highlight=False, style="dim")
    console.print(f"Assumed: {data['assumed']['why']}.", highlight=False, style="dim")


def page_sections(data: Mapping[str, Any]) -> dict[str, list[str]]:
    """Tables of studies/README.md by the names of their marks; bold where the paper's number holds.

    Args:
        data: content of paper.json, see ``studies.paper.study``.
    """
    heads = ["section", "stroke, plane", "filter of", "paper, %"]
    for plant in ("linear", "real"):
        heads += [f"{plant} valve: peak", "RMS", "residual"]
    reductions = [*_head(*heads)]
    for row in data["reductions"]:
        note = f" ({row['remark']})" if row["remark"] and row["axis"] != "both" else ""
        cells = [row["section"], _what(row) + note, row["poles_of"].replace("_", "-")]
        cells.append(f"> {row['more_than_pct']:g}")
        for plant, values in row["ours_pct"].items():
            texts = {metric: f"{value:.0f}" for metric, value in values.items()}
            holds = row["holds_for"][plant]
            cells += [f"**{text}**" if m in holds else text for m, text in texts.items()]
        reductions.append(_line(*cells))
    keys = ("section", "what", "paper", "ours")
    others = [_line(*(row[key] for key in keys)) for row in data["others"]]
    names = ("reductions of make paper", "numbers of make paper")
    return dict(zip(names, (reductions, [*_head(*keys), *others]), strict=True))


def _head(*heads: str) -> tuple[str, str]:
    return _line(*heads), f"|{'---|' * len(heads)}"


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _reductions(rows: list[dict[str, Any]]) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("\nstroke, plane", no_wrap=True)
    table.add_column("filter\nof axis", no_wrap=True)
    table.add_column("\npaper", justify="right", no_wrap=True)
    for plant in ("linear", "real"):
        for metric, head in zip(_METRICS, ("peak", "RMS", "res."), strict=True):
            first = f"{plant}\n" if metric == "peak" else "\n"
            table.add_column(first + head, justify="right", no_wrap=True)
    for row in rows:
        cells = [_what(row), row["poles_of"].replace("_", "-"), f"> {row['more_than_pct']:g}"]
        for plant in ("linear", "real"):
            cells += [
                f"{row['ours_pct'][plant][m]:.0f}{'+' if m in row['holds_for'][plant] else ' '}"
                for m in _METRICS
            ]
        table.add_row(*cells)
    return table


def _what(row: Mapping[str, Any]) -> str:
    if row["plane"] == "average":
        return "mean of rows 1 to 3"
    if row["plane"] == "least":
        return "smaller of 1 and 3"
    return f"{row['axis'].replace('_', '-')}, {row['plane']}"


def _others(rows: list[dict[str, Any]]) -> Table:
    """The numbers; the remarks follow as notes, which need the whole width."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("", justify="right", no_wrap=True)
    for head in ("", "paper", "ours"):
        table.add_column(head)
    table.add_column("same", no_wrap=True)
    for i, row in enumerate(rows, 1):
        cells = (row["what"], row["paper"], row["ours"], _VERDICT[row["agrees"]])
        table.add_row(Text(f"{i}", "dim"), *cells)
    return table
