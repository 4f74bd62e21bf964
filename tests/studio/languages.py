"""The texts of the page, by language."""

import json
import re

from canshaper.studio.server import STATIC

ENGLISH, OTHERS = "en", ("de", "fi", "sv")
PLACE = re.compile(r"\{\w+\}")


def texts(language: str) -> dict[str, str]:
    """The table of a language."""
    table: dict[str, str] = json.loads((STATIC / "languages" / f"{language}.json").read_text())
    return table
