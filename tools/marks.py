"""Parts of pages that a command writes: ``<!-- KIND: NAME -->`` to ``<!-- end: NAME -->``."""

import re
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STAMP = re.compile(r"Commit `[0-9a-f]{7,40}`")


def marked(page: str, kind: str) -> list[str]:
    """Names of the sections of a kind, ``generated`` or ``measured``, in their order."""
    return re.findall(rf"^<!-- {kind}: (.*?) -->$", page, re.MULTILINE)


def section_lines(page: str, kind: str, name: str) -> list[str]:
    """Lines of one section, without empty ones; none where its end is missing."""
    _, _, rest = page.partition(f"<!-- {kind}: {name} -->\n")
    lines, end, _ = rest.partition(f"<!-- end: {name} -->\n")
    return [line for line in lines.splitlines() if line] if end else []


def with_sections(page: str, sections: Mapping[str, Iterable[str]], kind: str = "generated") -> str:
    """Text of a page with the lines of its sections of a kind, by their names.

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
    """The commit that a measured table was made at.

    Raises:
        SystemExit: these sources are not as the commit has them.
    """

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
        )
        return done.stdout.strip()

    if changes := git("status", "--porcelain", "--", *sources):
        raise SystemExit(f"commit these first, for a table names its commit:\n{changes}")
    return f"Commit `{git('rev-parse', '--short', 'HEAD')}`"
