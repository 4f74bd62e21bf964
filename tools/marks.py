"""Parts of pages that a command writes: ``<!-- KIND: NAME -->`` to ``<!-- end: NAME -->``."""

import re
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STAMP = re.compile(r"Commit `[0-9a-f]{7,40}`")


def marked(page: str, kind: str) -> list[str]:
    """Return the names of a page's ``generated`` or ``measured`` sections, in their order."""
    return re.findall(rf"^<!-- {kind}: (.*?) -->$", page, re.MULTILINE)


def section_lines(page: str, kind: str, name: str) -> list[str]:
    """Return the lines of one section, without empty ones; none if begin or end is missing."""
    _, _, rest = page.partition(f"<!-- {kind}: {name} -->\n")
    lines, end, _ = rest.partition(f"<!-- end: {name} -->\n")
    return [line for line in lines.splitlines() if line] if end else []


def with_sections(page: str, sections: Mapping[str, Iterable[str]], kind: str = "generated") -> str:
    """Return a page with these lines in its sections of a kind, name -> lines; others stay.

    Raises:
        ValueError: a section has no begin or no end.
    """
    for name, lines in sections.items():
        begin, end = f"<!-- {kind}: {name} -->\n", f"<!-- end: {name} -->\n"
        before, _, rest = page.partition(begin)
        _, there, after = rest.partition(end)
        if not there:
            raise ValueError(f"expected {begin.strip()} and after it {end.strip()}")
        page = before + begin + "\n" + "".join(f"{line}\n" for line in lines) + "\n" + end + after
    return page


def stamped(*sources: str) -> str:
    """Return "Commit `ID`" of HEAD, for a table that was measured with these sources.

    Raises:
        SystemExit: a source differs from the commit, or git does not know it.
    """

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
        )
        return done.stdout.strip()

    if changes := git("status", "--porcelain", "--", *sources):
        raise SystemExit(f"commit these first, for a table names its commit:\n{changes}")
    return f"Commit `{git('rev-parse', '--short', 'HEAD')}`"
