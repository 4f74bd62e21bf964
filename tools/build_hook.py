"""Builds site and manual pages before a wheel or a source distribution, which both have them.

An installation from a checkout in which neither was built goes without them.
"""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):
    """Puts them in; a source distribution keeps them where its wheel looks for them."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before a target is built."""
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
