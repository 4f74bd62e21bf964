"""A setting as a table for the terminal, next to the one in the file."""

from collections.abc import Callable

from rich.table import Table

from canshaper.design.tuning.deploy import Setting
from canshaper.report.console import new_table


def table(setting: Setting, before: Setting | None, method: str) -> Table:
    """The setting next to the one in the file; residuals through the machine, filter alone."""
    columns = [setting] if before is None else [before, setting]
    result = new_table("", *([] if before is None else ["in the file"]), method)

    def row(title: str, cell: Callable[[Setting], str]) -> None:
        result.add_row(title, *(cell(column) for column in columns))

    row("poles, rad/s", lambda c: f"{c.poles_rad_s[0]:.3f}  {c.poles_rad_s[1]:.3f}")
    if any(c.third_pole_rad_s for c in columns):
        row("third pole", lambda c: f"{c.third_pole_rad_s:.3f}" if c.third_pole_rad_s else "-")
    row("a1, s", lambda c: f"{c.a1:g}")
    row("a2, s²", lambda c: f"{c.a2:g}")
    row("first jump, %", lambda c: f"{100 * c.measures.first_jump:.0f}")
    row("largest output, %", lambda c: f"{100 * c.measures.peak:.0f}")
    row("rise to 95 %, s", lambda c: f"{c.measures.rise_s:.2f}")
    row("run-on, s", lambda c: f"{c.measures.run_on_s:.2f}")
    row("mean delay, s", lambda c: f"{c.measures.mean_delay_s:.2f}")
    result.add_row("swing left, %: machine | filter alone")
    for i, residual in enumerate(setting.measures.residuals):
        row(
            f"  length {residual.length_pct:+.0f} %" if residual.length_pct else "  length right",
            lambda c, i=i: (  # type: ignore[misc]
                f"{100 * c.measures.residuals[i].machine:.1f} |"
                f" {100 * c.measures.residuals[i].linear:4.1f}"
            ),
        )
    return result
