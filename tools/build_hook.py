"""Puts the site and the manual pages of out/ into a wheel or a source distribution.

Without a site (``make docs`` builds it), and in an editable installation, both are left out.
"""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):
    """Adds site and manual pages; a source distribution keeps them in out/, for its wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the files to ``build_data``; version is "standard" or "editable"."""
        out = Path(self.root) / "out"
        if version == "editable" or not (out / "site" / "index.html").exists():
            return
        pages = sorted((out / "man").glob("*.1"))
        if self.target_name == "wheel":
            build_data["force_include"][str(out / "site")] = "canshaper/data/site"
            for page in pages:
                build_data["shared_data"][str(page)] = f"share/man/man1/{page.name}"
        else:
            for path in (out / "site", *pages):
                build_data["force_include"][str(path)] = str(path.relative_to(self.root))
