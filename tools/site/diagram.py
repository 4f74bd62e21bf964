"""Diagrams of the pages, drawn when the site is built: the page loads no script for them."""

from typing import Any

import mermaidx


def drawn(source: str, _language: str, _class: str, _options: object, _md: object, **_: Any) -> str:
    """A mermaid block as a picture in the page."""
    return f'<div class="drawn">{mermaidx.render(source).svg()}</div>'
