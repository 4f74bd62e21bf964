"""Values as they stand in a deployment file, on one line of YAML."""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from canshaper.config.section import RUN

# Text that is read as itself: a path, a word, several, a run of numbers, a date.
_PLAIN = re.compile(
    r"(?!(?i:true|false|null)$)(?:\.*/)*[^\W\d][\w./+-]*( [\w./+-]+)*"
    rf"|{RUN}|\d{{4}}-\d\d-\d\d"
)

Value = float | str | Sequence[float | str] | Mapping[str, Any] | None
"""A value to write: a number, a text, a list of numbers and of runs of them (``39 x 0``), or
such values by their keys; None takes the key away."""


def plain(text: str) -> str:
    """A text as it stands in YAML: in quotes where it could be read as something else."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)  # YAML too


def flow(value: float | str | Sequence[float | str] | Mapping[str, Any]) -> str:
    """A value on one line; of a number the shortest decimal form that is read back as it is."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key}: {flow(one)}' for key, one in value.items())} }}"
    if not isinstance(value, str | int | float):
        return f"[{', '.join(flow(v) for v in value)}]"
    if isinstance(value, int):
        return str(value).lower()  # true and false too
    if isinstance(value, str):
        return plain(value)
    text = repr(float(value))
    if "e" in text:
        text = f"{value:.12f}".rstrip("0")
    return text


def read_back(value: Any) -> Any:
    """A value as it is read where it was written by ``flow``."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return {key: read_back(one) for key, one in value.items()}
    if isinstance(value, Sequence):
        return [read_back(one) for one in value]
    return yaml.safe_load(flow(value))
