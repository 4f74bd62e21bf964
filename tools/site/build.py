"""Build the site of the pages: ``build.py`` writes out/site, which opens without a network.

The pages are those of the repository; API and commands are described by the program itself.
"""

import logging
import os
import shutil
import sys
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES, SITE = ROOT / "out" / "pages", ROOT / "out" / "site"
SOURCES = (
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "LICENSE",
    "README.md",
    "SECURITY.md",
    "config",
    "docs",
    "examples",
    "studies/README.md",
)
ASSETS = ("extra.css", "vendor/iframe-worker.js", "vendor/iframe-worker.LICENSE")
# Languages that the search does not use, and what only helps to debug the theme.
UNUSED = ("assets/javascripts/lunr", "**/*.map", "sitemap.xml*")


def reference() -> Iterator[str]:
    """Yield the page of the public API, in Markdown for mkdocstrings."""
    import canshaper  # noqa: PLC0415

    yield "# API reference"
    yield "\nWhat `canshaper.__all__` names. What it is for: [the Python API](docs/api.md).\n"
    for name in sorted(canshaper.__all__, key=str.lower):
        yield f"::: canshaper.{name}\n"


def commands() -> Iterator[str]:
    """Yield the page of all commands in Markdown: what --help of each prints."""
    from typer.testing import CliRunner  # noqa: PLC0415

    from canshaper.cli.app import Verbs, app  # noqa: PLC0415

    yield "# Commands"
    yield "\nWhat `--help` of each prints.\n"
    for name in ("", *Verbs(name="canshaper").list_commands(None)):
        words = [name, "--help"] if name else ["--help"]
        yield f"## {' '.join(['canshaper', *words[:-1]])}\n"
        text = CliRunner().invoke(app, words, prog_name="canshaper", terminal_width=80).stdout
        yield f"```text\n{text.strip()}\n```\n"


def stage() -> None:
    """Write out/pages, emptied first: links to the sources at their places, and generated pages."""
    shutil.rmtree(PAGES, ignore_errors=True)
    for name in SOURCES:
        place = PAGES / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.symlink_to(ROOT / name)
    for name, lines in (("reference", reference()), ("commands", commands())):
        (PAGES / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (PAGES / "site").mkdir()
    for name in ASSETS:
        (PAGES / "site" / Path(name).name).symlink_to(Path(__file__).parent / name)


def main() -> int:
    """Build the site; return 0, or 1 if mkdocs refuses the pages."""
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))  # tools.site.diagram, for mkdocs.yml
    os.environ["NO_MKDOCS_2_WARNING"] = "1"
    from mkdocs.commands.build import build  # noqa: PLC0415
    from mkdocs.config import load_config  # noqa: PLC0415
    from mkdocs.exceptions import Abort  # noqa: PLC0415

    stage()
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    try:
        build(load_config(str(ROOT / "mkdocs.yml")))
    except Abort as error:
        print(error, file=sys.stderr)
        return 1
    for pattern in UNUSED:
        for path in [*SITE.glob(pattern)]:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    theme = distribution("mkdocs-material")
    licence = next(file for file in theme.files or [] if file.name == "LICENSE")
    shutil.copy(str(licence.locate()), SITE / f"assets/mkdocs-material-{theme.version}.LICENSE")
    print(f"{SITE.relative_to(ROOT)}/index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
