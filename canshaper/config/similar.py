"""Names that look like one that is wrong, and which there are."""

from collections.abc import Collection, Iterable
from difflib import get_close_matches

# Of more names than these only the nearest are listed.
MOST_LISTED = 20
LISTED = 5


def there_are(name: str, names: Collection[str]) -> str:
    """The end of an error about a name that does not exist: those that do, of many the nearest."""
    if len(names) <= MOST_LISTED:
        return f"; there are {', '.join(names) or 'none'}{did_you_mean(name, names)}"
    folded = {one.casefold(): one for one in names}
    near = [folded[one] for one in get_close_matches(name.casefold(), folded, LISTED, 0.3)]
    listed = ", ".join(near or [*names][:LISTED])
    return f"; there are {len(names)}, such as {listed}{did_you_mean(name, names)}"


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """The end of an error about a name that does not exist; empty where none looks like it."""
    by_folded = {one.casefold(): one for one in names}
    similar = get_close_matches(name.casefold(), by_folded, n=1)
    return f"; did you mean {by_folded[similar[0]]}?" if similar else ""
