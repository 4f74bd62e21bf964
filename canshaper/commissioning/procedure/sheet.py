"""What a step prints, kept as plain data: for the state file, the terminal, the report, a page."""

import io
from typing import Any

from rich.console import Group
from rich.table import Table

from canshaper.report.console import SafeConsole, new_table

Part = dict[str, Any]
"""``{"text": lines}``, or ``{"title": words, "columns": heads, "rows": cells}``."""


class Sheet(SafeConsole):
    """A console that shows nothing and keeps what is printed.

    Attributes:
        parts: what was printed, in order.
    """

    def __init__(self) -> None:
        super().__init__(file=io.StringIO(), width=100)
        self.parts: list[Part] = []

    def print(self, *objects: Any, **_options: Any) -> None:
        """Keep lines and tables."""
        for one in objects:
            if isinstance(one, Group):
                self.print(*one.renderables)
            elif isinstance(one, Table):
                rows = zip(*(column.cells for column in one.columns), strict=True)
                self.parts.append(
                    {
                        "title": str(one.title) if one.title else "",
                        "columns": [str(column.header) for column in one.columns],
                        "rows": [[str(cell) for cell in row] for row in rows],
                    }
                )
            else:
                self.parts.append({"text": str(one)})


def shown(part: Part) -> str | Table:
    """A part as it is printed again."""
    if "text" in part:
        return str(part["text"])
    table = new_table(*part["columns"], title=part["title"] or None)
    for row in part["rows"]:
        table.add_row(*row)
    return table
