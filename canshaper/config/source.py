"""YAML with line numbers, and all problems of files, each with its place."""

import errno
import os
import re
import stat
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Collection, Iterable, Iterator, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import yaml

from canshaper.errors import ConfigError, Problem


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """Return the content of a file.

    Raises:
        OSError: the file cannot be read, is a device, pipe or directory, or is longer than
            ``most_bytes``.
    """
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # no one need write to a pipe
    try:
        mode = os.fstat(number).st_mode
        if stat.S_ISDIR(mode):
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            text = "expected a regular file, got a device or a pipe"
            raise OSError(errno.EINVAL, text, str(path))
        with os.fdopen(number, "rb", closefd=False) as file:
            data = file.read(most_bytes + 1)
    finally:
        os.close(number)
    if len(data) > most_bytes:
        text = f"expected {most_bytes} bytes at most, got more"
        raise OSError(errno.EFBIG, text, str(path))
    return data


def encoding_of(head: bytes) -> str:
    """Return the encoding of a text with a byte order mark, or of UTF-16 without one; else ""."""
    if head.startswith(BOM_UTF8):
        return "utf-8-sig"
    if head.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return "utf-16"
    # Every text that is read here begins with an ASCII character.
    little, big = head[1:2] == b"\0", head[:1] == b"\0"
    return "utf-16-le" if little else "utf-16-be" if big else ""


Place = tuple[str | int, ...]

# Far beyond any machine: the shipped files have 5 kB and 500 nodes at most. A foreign file must not
# exhaust the memory or the time of its reader.
MOST_BYTES = 262_144
MOST_NODES = 10_000  # anchors within anchors can make a few lines grow without end
MOST_NESTED = 50

_TAG = "tag:yaml.org,2002:"
_SCALARS = frozenset(_TAG + t for t in ("str", "int", "float", "bool", "null", "timestamp"))
_WHOLE = re.compile(r"[-+]?(0|[1-9][0-9]{0,17})")
_HEX = re.compile(r"0x[0-9a-fA-F]{1,8}")
_DECIMAL = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
# Escapes can put control characters into text. No name has any; no path with NUL can be opened.
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff]")


class _Loader(yaml.SafeLoader):
    """YAML loader with limits on nodes and nesting: deep nesting slows down every further token."""

    _nodes = _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose the next node; refuse too many, too deep or self-containing nodes."""
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise yaml.MarkedYAMLError(None, None, "too large", self.get_mark())
        event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]
        mark: Any = event.start_mark
        if self._depth > MOST_NESTED:
            raise yaml.MarkedYAMLError(None, None, "nested too deeply", mark)
        if isinstance(event, yaml.AliasEvent):
            whole = self.anchors.get(event.anchor)
            if whole is not None and whole.end_mark is None:  # it is being composed
                text = f"the anchor {event.anchor} contains itself"
                raise yaml.MarkedYAMLError(None, None, text, mark)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def fetch_flow_collection_start(self, token: type[yaml.Token]) -> None:
        """Scan an opening bracket; refuse more than ``MOST_NESTED`` open ones."""
        if self.flow_level >= MOST_NESTED:
            raise yaml.MarkedYAMLError(None, None, "nested too deeply", self.get_mark())
        super().fetch_flow_collection_start(token)


class Source:
    """A YAML file as data, with the line of every key.

    Attributes:
        content: bytes of the file.
        sha256: SHA-256 of the content, in hexadecimal digits.

    Raises:
        ConfigError: the file cannot be read or is not YAML, or a key stands twice.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lines: dict[Place, int] = {}
        self._problems: list[Problem] = []
        self._count = 0
        content = ""
        try:
            self.content = data = read_bounded(path, MOST_BYTES)
            self.sha256 = sha256(data).hexdigest()
            content = data.decode("utf-8")
            node = yaml.compose(content, Loader=_Loader)
            if node is None:  # an empty file, which has a first line all the same
                self._lines[()] = 1
            self.data: Any = {} if node is None else self._build(node, ())
        except OSError as error:
            raise ConfigError([self.problem((), error.strerror or str(error))]) from None
        # ValueError: not UTF-8; ValueError and OverflowError: an escape that is no character
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            text = getattr(error, "problem", None) or str(error).splitlines()[0]
            problem = Problem(str(path), _line(error, content), "", f"not YAML: {text}")
            raise ConfigError([problem]) from None
        if self._problems:
            raise ConfigError(self._problems)

    def problem(self, path: Place, message: str) -> Problem:
        """Return a problem at a place of this file, such as ("axes", "slew", "filter")."""
        near = path
        while near and near not in self._lines:
            near = near[:-1]
        return Problem(
            str(self.path), self._lines.get(near), ".".join(str(p) for p in path), message
        )

    def places(self, pattern: Sequence[str]) -> Iterator[Place]:
        """Yield the places that fit a pattern: * fits any name, | separates alternatives."""
        for place in self._lines:
            if len(place) == len(pattern) and all(
                names == "*" or part in names.split("|")
                for names, part in zip(pattern, place, strict=True)
            ):
                yield place

    def rename(self, place: Place, name: str) -> None:
        """Rename a key in the data; the key keeps its value, and its line in problems."""
        *inside, old = place
        section = self.data
        for part in inside:
            section = section[part]
        section.setdefault(name, section.pop(old))
        end = len(inside)
        for one, line in [*self._lines.items()]:
            if one[: end + 1] == place:
                self._lines.setdefault((*inside, name, *one[end + 1 :]), line)
                del self._lines[one]

    def _build(self, node: yaml.Node, path: Place) -> Any:
        """Return the data of a node: only dict, list and scalars, whatever tags the file has."""
        self._lines.setdefault(path, node.start_mark.line + 1)
        self._count += 1
        if self._count > MOST_NODES:
            raise yaml.MarkedYAMLError(None, None, "too large", node.start_mark)
        if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
            return [self._build(n, (*path, i)) for i, n in enumerate(node.value)]
        if isinstance(node, yaml.ScalarNode) and node.tag in _SCALARS:
            value = _scalar(node)
            if isinstance(value, str) and _CONTROL.search(value):
                text = f"expected text without control characters, got {value!r}"
                self._add(path, node, text)
            return value
        self._add(path, node, f"expected no tag, got {node.tag.replace(_TAG, '!!')}")
        return None

    def _mapping(self, node: yaml.MappingNode, path: Place) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            plain = isinstance(key_node, yaml.ScalarNode) and key_node.tag in _SCALARS
            key = _scalar(key_node) if plain else None
            if not isinstance(key, str) or _CONTROL.search(key):
                got = repr(key_node.value) if key_node.id == "scalar" else f"a {key_node.id}"
                self._add(path, key_node, f"expected a word as key, got {got}")
                continue
            here = (*path, key)
            if key in result:
                text = f"key stands twice, first in line {self._lines[here]}"
                self._add(here, key_node, text)
                continue
            self._lines[here] = key_node.start_mark.line + 1
            result[key] = self._build(value_node, here)
        return result

    def _add(self, path: Place, node: yaml.Node, message: str) -> None:
        where = ".".join(str(p) for p in path)
        self._problems.append(Problem(str(self.path), node.start_mark.line + 1, where, message))


def _line(error: Exception, content: str) -> int | None:
    """Return the line of a YAML error, from its mark or its position; None where it has neither."""
    if isinstance(error, UnicodeDecodeError):
        return error.object.count(b"\n", 0, error.start) + 1
    if isinstance(error, yaml.reader.ReaderError):
        return content.count("\n", 0, error.position) + 1
    mark = getattr(error, "problem_mark", None)
    return mark.line + 1 if mark else None


def _scalar(node: yaml.ScalarNode) -> str | int | float | bool | None:
    """Return the value of a scalar by the rules of YAML 1.2.

    PyYAML follows YAML 1.1, where off is false, 010 is 8, 1:30 is 90 and 1e3 is text. Here off is
    the name of a filter, and no one means the other three so.
    """
    text: str = node.value
    plain = node.style is None
    if plain and node.tag == _TAG + "null":
        return None
    if plain and node.tag == _TAG + "bool" and text.lower() in ("true", "false"):
        return text.lower() == "true"
    if plain and _WHOLE.fullmatch(text):
        return int(text)
    if plain and _HEX.fullmatch(text):
        return int(text, 16)
    if plain and (_DECIMAL.fullmatch(text) or _NOT_FINITE.fullmatch(text)):
        return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text


class Diagnostics:
    """Collects every problem, so that a person reads all of them at once.

    Args:
        source: the deployment file.

    Attributes:
        problems: the problems so far; those of a DBC file carry the file and line of that one.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self.problems: list[Problem] = []

    def add(self, place: Place, text: str) -> None:
        """Add a problem at a place of the deployment file."""
        self.problems.append(self._source.problem(place, text))

    def check_name(self, place: Place, what: str, name: str, names: Collection[str]) -> bool:
        """Return whether a name is one of these; else add a problem that lists them.

        ``what`` is the thing that has to have such a name, such as "an axis".
        """
        if name not in names:
            there = ", ".join(names) or "none"
            self.add(place, f"expected {what}, got {name!r}; there are {there}")
        return name in names

    def check_same(
        self, place: Place, section: object, keys: Iterable[str], other: object, text: str
    ) -> None:
        """Add a problem for every key in which two sections differ.

        Args:
            place: place of the section.
            section: the section.
            keys: keys that are compared.
            other: the section to compare with.
            text: end of the sentence "expected the same as ...".
        """
        for key in keys:
            if getattr(section, key) != getattr(other, key):
                self.add((*place, key), f"expected the same as {text}")

    def raise_problems(self) -> None:
        """Raise all problems at once, if there is any.

        Raises:
            ConfigError: with every problem.
        """
        if self.problems:
            raise ConfigError(self.problems)
