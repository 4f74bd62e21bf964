"""YAML with line numbers, and the problems found in files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

Place = tuple[str | int, ...]


@dataclass(frozen=True)
class Problem:
    """One fault of a file, as a person reads it."""

    file: str
    line: int | None
    where: str
    message: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return ": ".join(part for part in (place, self.where, self.message) if part)


class DeploymentError(Exception):
    """A deployment that must not start; carries every problem found."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__("\n".join(str(p) for p in problems))
        self.problems = problems


class Source:
    """A YAML file as data, with the line of every key.

    Raises:
        DeploymentError: the file cannot be read or is not YAML, or a key stands twice.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lines: dict[Place, int] = {}
        self._problems: list[Problem] = []
        try:
            text = path.read_text(encoding="utf-8")
            loader = yaml.SafeLoader(text)
            node = loader.get_single_node()
            self.data: Any = {} if node is None else self._build(loader, node, ())
        except OSError as error:
            raise DeploymentError([self.problem((), error.strerror or str(error))]) from None
        except (yaml.YAMLError, ValueError) as error:  # ValueError: not UTF-8, or a bad scalar
            mark = getattr(error, "problem_mark", None)
            text = getattr(error, "problem", None) or str(error).splitlines()[0]
            line = mark.line + 1 if mark else None
            raise DeploymentError([Problem(str(path), line, "", f"not YAML: {text}")]) from None
        if self._problems:
            raise DeploymentError(self._problems)

    def problem(self, path: Place, message: str) -> Problem:
        """A problem at a place of this file, such as ("axes", "slew", "filter")."""
        near = path
        while near and near not in self._lines:
            near = near[:-1]
        return Problem(
            str(self.path), self._lines.get(near), ".".join(str(p) for p in path), message
        )

    def _build(self, loader: yaml.SafeLoader, node: yaml.Node, path: Place) -> Any:
        self._lines.setdefault(path, node.start_mark.line + 1)
        if isinstance(node, yaml.MappingNode):
            result: dict[Any, Any] = {}
            for key_node, value_node in node.value:
                key = loader.construct_object(key_node, deep=True)
                here = (*path, key)
                if not isinstance(key, str):
                    self._add(here, key_node, f"found key {key!r}, allowed are words")
                    continue
                if key in result:
                    self._add(
                        here, key_node, f"key stands twice, first in line {self._lines[here]}"
                    )
                    continue
                self._lines[here] = key_node.start_mark.line + 1
                result[key] = self._build(loader, value_node, here)
            return result
        if isinstance(node, yaml.SequenceNode):
            return [self._build(loader, n, (*path, i)) for i, n in enumerate(node.value)]
        if node.tag == "tag:yaml.org,2002:bool" and node.value.lower() not in ("true", "false"):
            return node.value  # YAML 1.1 reads "off" as false; here it is the name of a filter
        return loader.construct_object(node, deep=True)

    def _add(self, path: Place, node: yaml.Node, message: str) -> None:
        where = ".".join(str(p) for p in path)
        self._problems.append(Problem(str(self.path), node.start_mark.line + 1, where, message))
