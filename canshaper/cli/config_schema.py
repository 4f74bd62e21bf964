"""``canshaper config-schema``: the JSON schema of the deployment file, for editors."""

import json

from canshaper.cli.console import echo


def config_schema() -> None:
    """Print the JSON schema of the deployment file.

    Editors with a YAML language server check and complete a file that starts with

      # yaml-language-server: $schema=deployment.schema.json

    Examples:

      canshaper config-schema > deployment.schema.json
    """
    from canshaper.config.schema import DeploymentConfig

    schema = DeploymentConfig.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "canshaper deployment"
    echo(json.dumps(schema, indent=2))
