"""The JSON schema that ``canshaper config-schema`` prints for editors."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from canshaper.cli.app import app

SHIPPED = sorted((Path(__file__).parents[2] / "config").glob("*.yaml"))


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    result = CliRunner().invoke(app, ["config-schema"])
    assert result.exit_code == 0
    read = json.loads(result.stdout)
    assert isinstance(read, dict)
    return read


@pytest.fixture
def machine() -> dict[str, Any]:
    path = next(p for p in SHIPPED if p.name == "forwarder.yaml")
    # PyYAML takes "off" for false; editors, whose YAML is 1.2, do not
    text = path.read_text(encoding="utf-8").replace("kind: off", "kind: 'off'")
    read = yaml.safe_load(text)
    assert isinstance(read, dict)
    return read


def faults(schema: dict[str, Any], data: Any) -> list[str]:
    return [e.message for e in Draft202012Validator(schema).iter_errors(data)]


def test_it_is_a_json_schema_with_a_title(schema: dict[str, Any]) -> None:
    Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["title"] == "canshaper deployment"
    assert schema["$id"] == "urn:canshaper:deployment:1"


def test_it_accepts_the_shipped_deployment(schema: dict[str, Any], machine: dict[str, Any]) -> None:
    assert faults(schema, machine) == []


def test_it_accepts_off_as_yaml_1_1_reads_it(
    schema: dict[str, Any], machine: dict[str, Any]
) -> None:
    assert machine["axes"]["lift"]["filter"] == {"kind": "off"}
    for kind, good in ((False, True), (True, False), ("Off", False), (0, False)):
        machine["axes"]["lift"]["filter"]["kind"] = kind
        assert (faults(schema, machine) == []) is good, kind


def test_it_refuses_an_unknown_key(schema: dict[str, Any], machine: dict[str, Any]) -> None:
    assert faults(schema, machine | {"unknown": 1})
    open_ones = {
        n for n, s in schema["$defs"].items() if s.get("additionalProperties") is not False
    }
    assert not {n for n in open_ones if "properties" in schema["$defs"][n]}


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("tick_ms",), 0),
        (("tick_ms",), 20.5),
        (("buses",), {}),
        (("dbc",), []),
        (("axes", "slew", "filter", "kind"), "zv"),
        (("axes", "slew", "filter", "a1"), "0.7"),
        (("axes", "slew", "filter"), {"kind": "gff", "poles_rad_s": [-3, 3]}),
        (("axes", "slew", "filter"), {"kind": "gff", "poles_rad_s": [-3]}),
        (("axes", "slew", "limits", "tail_s"), 12.1),
        (("axes", "slew", "command"), None),
    ],
)
def test_it_refuses_what_loading_refuses(
    schema: dict[str, Any], machine: dict[str, Any], place: tuple[str, ...], value: Any
) -> None:
    changed = copy.deepcopy(machine)
    section = changed
    for key in place[:-1]:
        section = section[key]
    section[place[-1]] = value
    assert faults(schema, changed)


def test_every_number_has_a_range_and_a_unit(schema: dict[str, Any]) -> None:
    def numbers(node: Any, path: str = "") -> list[tuple[str, dict[str, Any]]]:
        nodes = []
        if isinstance(node, dict):
            if node.get("type") in ("number", "integer"):
                nodes.append((path, node))
            for key, below in node.items():
                nodes += numbers(below, f"{path}/{key}")
        elif isinstance(node, list):
            for i, below in enumerate(node):
                nodes += numbers(below, f"{path}/{i}")
        return nodes

    nodes = numbers(schema)
    assert len(nodes) > 20
    for path, node in nodes:
        assert {"minimum", "maximum", "unit", "description"} <= node.keys(), path


def test_every_key_is_described(schema: dict[str, Any]) -> None:
    sections = {"": schema, **schema["$defs"]}
    keys = {(n, k): v for n, s in sections.items() for k, v in s.get("properties", {}).items()}
    assert len(keys) > 150
    assert [place for place, key in keys.items() if len(key.get("description", "")) < 8] == []
    assert [name for name, section in sections.items() if not section.get("description")] == []
