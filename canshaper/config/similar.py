"""Names that look like one that is wrong."""

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """The end of an error about a name that does not exist; empty where none looks like it."""
    by_folded = {one.casefold(): one for one in names}
    similar = get_close_matches(name.casefold(), by_folded, n=1)
    return f"; did you mean {by_folded[similar[0]]}?" if similar else ""
