"""Diagrams of the pages, drawn when the site is built: the page loads no script for them."""

from typing import Any

import mermaidx


def drawn(source: str, _language: str, _class: str, _options: object, _md: object, **_: Any) -> str:
    """Return a block of Mermaid as HTML with a picture in SVG."""
    return f'<div class="drawn">{mermaidx.render(source).svg()}</div>'
