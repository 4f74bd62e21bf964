"""The version, from the tags of git: ``v1.2.0``, and ``1.2.1.dev5+gabcdef0`` five commits later.

A clone without tags takes the newest release in CHANGELOG.md and counts all its commits; a source
distribution carries its version in PKG-INFO. Hatch reads ``__version__``; run by itself this prints
it.
"""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]


def _git(*words: str) -> str:
    try:
        command = ["git", "-C", str(ROOT), *words]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def _next(tag: str, commits: str, commit: str) -> str:
    """Return the tag itself for 0 commits, else a development version of the release after it."""
    if commits == "0":
        return tag
    *first, last = tag.split(".")
    return ".".join([*first, str(int(last) + 1)]) + f".dev{commits}+g{commit}"


def version() -> str:
    """Return the version of this tree.

    Raises:
        RuntimeError: it is neither a clone nor a source distribution.
    """
    info = ROOT / "PKG-INFO"
    if info.exists() and (match := re.search(r"(?m)^Version: (\S+)$", info.read_text())):
        return match[1]
    described = _git("describe", "--tags", "--long", "--match", "v[0-9]*")
    if match := re.fullmatch(r"v([\d.]+)-(\d+)-g([0-9a-f]+)", described):
        return _next(*match.groups())
    released = re.search(r"(?m)^## \[([\d.]+)\]", (ROOT / "CHANGELOG.md").read_text())
    if released and (commits := _git("rev-list", "--count", "HEAD")):
        return _next(released[1], commits, _git("rev-parse", "--short", "HEAD"))
    raise RuntimeError(f"{ROOT}: expected a clone or a source distribution, got neither")


__version__ = version()
if __name__ == "__main__":
    print(__version__)
