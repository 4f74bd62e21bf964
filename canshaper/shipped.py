"""Version of the program, and the deployments and DBC files that come with it."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
"""Directory of the modules."""


def version() -> str:
    """Version by the tags of git, as it was installed."""
    from importlib import metadata  # noqa: PLC0415  # slow, and --help needs none

    return metadata.version("canshaper")


def data_directory() -> Path:
    """Directory that holds ``config`` and ``dbc``: in the installed package, or the checkout."""
    inside = PACKAGE / "data"
    return inside if inside.is_dir() else PACKAGE.parent


def deployment_path(name: str | Path) -> Path:
    """Path of a deployment: a file that is there, else a shipped one of that name."""
    path = Path(name)
    if path.exists():
        return path
    shipped = data_directory() / "config" / path.name
    return shipped if shipped.exists() and path.parent in (Path(), Path("config")) else path


def site_directory() -> Path | None:
    """Directory of the built site of the pages; None where it is neither installed nor built."""
    data = data_directory()
    places = (data / "site", data / "out" / "site")
    return next((one for one in places if (one / "index.html").exists()), None)
