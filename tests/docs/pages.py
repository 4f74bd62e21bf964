"""The pages."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
EVERY_PAGE = {*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "studies" / "README.md"}
# What was once may be named in it.
PAGES = sorted(EVERY_PAGE - {ROOT / "CHANGELOG.md"})
