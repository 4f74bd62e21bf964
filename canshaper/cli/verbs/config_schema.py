"""``canshaper config-schema``: the JSON schema of the deployment file, for editors."""

import json
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import echo
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from canshaper.shaping.shapers.kind import Parameter, ShaperKind

GROUP = "look"


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
        ValueError: the checksum of a package cannot be loaded, or two packages have its name.
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
