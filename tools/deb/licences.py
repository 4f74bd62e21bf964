"""The full texts of all licences in a directory of packages: ``licences.py DIRECTORY``.

Of every Python package that lies in it, of the JavaScript of the live page and of the site.
"""

import re
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution
from pathlib import Path

from bundled import licence

NAMED = re.compile(r"^(licen[cs]es?/|licen[cs]e|copying|notice)", re.IGNORECASE)
VENDORED = ("studio/static/vendor", "data/site")


def texts(library: Path) -> Iterator[tuple[str, str]]:
    """Yield (title, text) of each licence; for a package without one a sentence says so."""
    for about in sorted(library.glob("*.dist-info")):
        one = Distribution.at(about)
        title = f"{one.name} {one.version}: {licence(one)}"
        inside = [path for path in sorted(about.rglob("*")) if path.is_file()]
        files = [path for path in inside if NAMED.search(str(path.relative_to(about)))]
        if not files:
            yield title, "The package comes without the text of its licence."
        for path in files:
            text = path.read_text(encoding="utf-8", errors="replace")
            yield f"{title} ({path.relative_to(about)})", text
    for place in VENDORED:
        for path in sorted((library / "canshaper" / place).rglob("*.LICENSE")):
            yield path.stem, path.read_text(encoding="utf-8")


if __name__ == "__main__":
    for title, text in texts(Path(sys.argv[1])):
        print(f"{'=' * 80}\n{title}\n{'=' * 80}\n\n{text.strip()}\n")
