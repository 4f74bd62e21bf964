"""What a command would take if every question were answered by Enter, to look at as a whole."""

import re
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

from canshaper.cli.answers import NONE, Proposed, answered_with, confirmed
from canshaper.cli.common import echo
from canshaper.errors import UsageError

_T = TypeVar("_T")
# What may be answered, as the end of a question says it.
_CHOICES = re.compile(r", (of|such as) .*|, - for none")


def accepted(ask: Callable[[], _T]) -> _T | None:
    """What the questions make of their proposals, where a person accepts them all.

    Args:
        ask: asks the questions.

    Returns:
        None where not, or where a question has no proposal: then they have to be asked.
    """
    from canshaper.report.console import SafeConsole, new_table

    proposed = Proposed()
    made = None
    with suppress(UsageError, ValueError), answered_with(proposed):
        made = ask()
    if made is None:
        return None
    table = new_table("question", "proposal")
    for question, proposal in proposed.rows:
        table.add_row(_CHOICES.sub("", question), "none" if proposal == NONE else proposal)
    SafeConsole().print(table)
    echo("What no DBC says, such as swing and speeds, is a guess until it is measured.")
    return made if confirmed("Is all of it right (no: each is asked)", default=True) else None
