"""``canshaper docs``: the pages that come with the program."""

from functools import partial

import typer

from canshaper.cli.common import echo, fail
from canshaper.errors import UsageError
from canshaper.shipped import data_directory, site_directory

GROUP = "look"

EXIT_NO_ADDRESS = 1
# A browser shows what it would else save.
TEXTS = dict.fromkeys((".md", ".py", ".toml", ".yaml", "", ".link", ".network"), "text/plain")


def docs(
    port: int = typer.Option(8378, "--port", help="Port to serve at; 0 takes a free one."),
) -> None:
    """Serve the pages of this version to a browser on this machine, without a network.

    They include search, all commands and the Python API. The files also open without a server.

    Examples:

      canshaper docs

      canshaper docs --port 0
    """
    from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

    class Pages(SimpleHTTPRequestHandler):
        extensions_map = {**SimpleHTTPRequestHandler.extensions_map, **TEXTS}  # noqa: RUF012

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing of a request."""

    site = site_directory()
    if site is None:
        pages = data_directory() / "docs"
        where = f"read {pages}, or run make docs" if pages.is_dir() else "install a release"
        raise UsageError(f"the site is not in this installation: {where}")
    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), partial(Pages, directory=str(site)))
    except OSError as error:
        text = f"cannot serve at port {port}: {error.strerror or error}; try --port 0"
        raise fail(UsageError(text), EXIT_NO_ADDRESS) from None
    with server:
        echo(f"open http://127.0.0.1:{server.server_port}/ in a browser; Ctrl-C ends")
        echo(f"the same as files: {site / 'index.html'}")
        server.serve_forever()
