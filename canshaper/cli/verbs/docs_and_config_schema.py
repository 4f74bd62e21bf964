"""``canshaper docs`` and ``config-schema``: the pages, and the JSON schema of the file."""

import json
from collections.abc import Iterable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import echo, fail
from canshaper.errors import UsageError
from canshaper.shipped import data_directory, site_directory

if TYPE_CHECKING:
    from canshaper.shaping.shapers.kind import Parameter, ShaperKind

GROUP = "look"

EXIT_NO_ADDRESS = 1
# A browser shows files of these suffixes instead of saving them.
TEXTS = dict.fromkeys((".md", ".py", ".toml", ".yaml", "", ".link", ".network"), "text/plain")


class _Pages(SimpleHTTPRequestHandler):
    extensions_map = {**SimpleHTTPRequestHandler.extensions_map, **TEXTS}  # noqa: RUF012

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing of a request."""


def docs(
    port: int = typer.Option(8378, "--port", help="Port to serve at; 0 takes a free one."),
) -> None:
    """Serve the pages of this version to a browser on this machine, without a network.

    They include search, all commands and the Python API. The files also open without a server.

    Examples:

      canshaper docs

      canshaper docs --port 0
    """
    site = site_directory()
    if site is None:
        pages = data_directory() / "docs"
        where = f"read {pages}, or run make docs" if pages.is_dir() else "install a release"
        raise UsageError(f"the site is not in this installation: {where}")
    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), partial(_Pages, directory=str(site)))
    except OSError as error:
        text = f"cannot serve at port {port}: {error.strerror or error}; try --port 0"
        raise fail(UsageError(text), EXIT_NO_ADDRESS) from None
    with server:
        echo(f"open http://127.0.0.1:{server.server_port}/ in a browser; Ctrl-C ends")
        echo(f"the same as files: {site / 'index.html'}")
        server.serve_forever()


def config_schema(
    filters: bool = typer.Option(
        False, "--filters", help="Print the table of filters instead, as in docs/deployment.md."
    ),
    checksums: bool = typer.Option(
        False, "--checksums", help="Print the table of checksums instead, as in docs/checksums.md."
    ),
) -> None:
    """Print the JSON schema of the deployment file.

    Editors with a YAML language server check and complete a file that starts with

      # yaml-language-server: $schema=deployment.schema.json

    Schema and tables include the filters and checksums of other installed packages.

    Examples:

      canshaper config-schema > deployment.schema.json

      canshaper config-schema --filters

      canshaper config-schema --checksums
    """
    from canshaper.config.load import check_packages
    from canshaper.config.schema import DeploymentConfig
    from canshaper.config.section import VERSION
    from canshaper.shaping.registry import KINDS

    try:
        check_packages()
        table = [*checksum_table()] if checksums else []
    except ValueError as error:  # an installed package is wrong
        raise UsageError(str(error)) from None
    if filters:
        table += filter_table(KINDS.values())
    if table:
        echo("\n".join(table))
        return
    schema = DeploymentConfig.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["$id"] = f"urn:canshaper:deployment:{VERSION}"
    schema["title"] = "canshaper deployment"
    echo(json.dumps(schema, indent=2))


def checksum_table() -> Iterator[str]:
    """Yield the lines of the table of all checksum kinds, in Markdown.

    Raises:
        ValueError: a package is wrong, see ``known_checksum``.
    """
    from canshaper.checksums.kinds import CHECKSUMS, checksum_names, known_checksum

    yield "| kind | bits | what it is | can-gw of the kernel makes it |"
    yield "|---|---|---|---|"
    for name in checksum_names():
        kind = CHECKSUMS[known_checksum(name)]
        yield f"| `{name}` | {kind.bits} | {kind.text} | {'yes' if kind.kernel else 'no'} |"


def filter_table(kinds: "Iterable[ShaperKind]") -> Iterator[str]:
    """Yield the lines of the table of filters, in Markdown."""
    yield "| `kind` | parameters | what it is | needs `sway` |"
    yield "|---|---|---|---|"
    for kind in kinds:
        parameters = "; ".join(_cell(parameter) for parameter in kind.parameters)
        text = kind.summary
        if kind.designed_by:
            text += f" Designed by `canshaper {kind.designed_by}`."
        yield f"| `{kind.name}` | {parameters} | {text} | {'yes' if kind.needs_sway else ''} |"


def _cell(parameter: "Parameter") -> str:
    default = "" if parameter.default is None else f" (default {parameter.default:g})"
    optional = " (optional)" if parameter.optional else ""
    least, most = parameter.entries or (1, 1)
    count = "" if most == 1 else f"{most} of " if least == most else f"{least} to {most} of "
    limits = f"{count}{parameter.low:g} to {parameter.high:g} {parameter.unit}".rstrip()
    return f"`{parameter.name}`{optional}{default}: {parameter.description}, {limits}"
