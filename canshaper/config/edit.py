"""Change single values of a deployment file and leave every other byte as it is.

The YAML parser says where keys and values stand; only those spans are replaced. The result is
written beside the file, must load as a deployment, and then takes the file's place in one step: at
no moment is there a half-written file, and a file that cannot be changed stays as it was.
"""

import copy
import os
import re
import stat
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from canshaper.config.bounded import read_bounded
from canshaper.config.load import load_config
from canshaper.config.runs import RUN
from canshaper.config.source import MOST_BYTES, Place, Source
from canshaper.errors import ConfigError, Problem

Value = float | str | Sequence[float | str] | Mapping[str, Any] | None
"""A value to write: a number, a plain word, a list of numbers and of runs of them (``39 x 0``), or
such values by their keys; None takes the key away."""


def set_values(path: Path, place: Place, values: Mapping[str, Value]) -> None:
    """Write values into a section of a deployment file.

    Keys that are there get the new value, keys that are not are put in, keys with None are taken
    out. Comments, order, spacing, line ends and everything else stay.

    Args:
        path: the deployment file; a symbolic link is followed.
        place: keys down to the section, such as ("axes", "slew", "filter").
        values: values by key.

    Raises:
        ConfigError: the section is not there or cannot be changed without touching anything
            else, the result is no valid deployment, or the file cannot be written. The file is as
            it was.
    """
    path = path.resolve()
    before = _read(path)
    text = edited(before, place, values, str(path))
    _replace(path, before, text, _expected(Source(path).data, place, values))


def edited(text: str, place: Place, values: Mapping[str, Value], name: str = "") -> str:
    """Return the text of a YAML file with values of one section changed; see ``set_values``.

    Raises:
        ConfigError: the section cannot be changed; ``name`` is the file it names.
    """
    edit = _Edit(text, place, name)
    absent = []
    for key, value in values.items():
        if value is None:
            edit.remove(key)
        elif not edit.replace(key, flow(value)):
            absent.append((key, flow(value)))
    edit.insert(absent)
    return edit.text()


class _Edit:
    """Replacements of spans in one mapping of a text."""

    def __init__(self, text: str, place: Place, name: str) -> None:
        self._text = text
        self._place = place
        self._name = name
        self._spans: list[tuple[int, int, str]] = []
        self._removed: list[int] = []  # which pairs are taken out
        try:
            root = yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.YAMLError as error:
            raise self._error(None, f"not YAML: {error}") from None
        self._uses: dict[int, int] = {}
        self._count(root)
        node = root
        for key in place:
            pairs = node.value if isinstance(node, yaml.MappingNode) else []
            node = next((v for k, v in pairs if k.value == key), None)
            if node is None:
                raise self._error(root, f"no section {key}")
            self._not_shared(node)
        if not isinstance(node, yaml.MappingNode) or not node.value:
            raise self._error(node, "expected a section with keys, got none")
        self._flow = bool(node.flow_style)
        self._pairs: list[tuple[yaml.Node, yaml.Node]] = node.value
        self._newline = "\r\n" if "\r\n" in text else "\n"

    def replace(self, key: str, value: str) -> bool:
        """Give a key that is there a new value; False where it is not there."""
        for key_node, node in self._pairs:
            if key_node.value == key:
                self._not_shared(node)
                self._put(key_node, node, value)
                return True
        return False

    def _put(self, key: yaml.Node, node: yaml.Node, value: str) -> None:
        """Put a value in place of another; that of a block, however indented, behind its key."""
        start, end = self._span(node)
        if isinstance(node, yaml.CollectionNode) and not node.flow_style:
            colon = self._text.index(":", key.end_mark.index) + 1
            if "#" in self._text[start:end]:
                raise self._error(key, f"a comment stands inside {key.value}; change it by hand")
            self._spans.append((colon, colon, f" {value}"))
            start = self._text.rindex("\n", 0, start)
            start -= self._text[:start].endswith("\r")
            value = ""
        self._spans.append((start, end, value))

    def remove(self, key: str) -> None:
        """Take a key out with its value; a comment behind it stays, on a line of its own."""
        for i, (key_node, node) in enumerate(self._pairs):
            if key_node.value == key:
                self._not_shared(node)
                if "#" in self._text[key_node.start_mark.index : self._span(node)[1]]:
                    text = f"a comment stands inside {key}; change it by hand"
                    raise self._error(key_node, text)
                self._removed.append(i)

    def insert(self, pairs: list[tuple[str, str]]) -> None:
        """Put keys in: where a removed one stood, or behind the last one."""
        between = ", " if self._flow else self._newline + self._indent()
        text = between.join(f"{key}: {value}" for key, value in pairs)
        for i in self._removed:
            start, end = self._pairs[i][0].start_mark.index, self._span(self._pairs[i][1])[1]
            if text:
                self._spans.append((start, end, text))
                text = ""
            elif self._flow:
                self._spans.append((*self._with_comma(i, start, end), ""))
            else:
                self._spans.append((*self._with_line(start, end), ""))
        if text:
            kept = [node for i, (_, node) in enumerate(self._pairs) if i not in self._removed]
            end = self._span(kept[-1])[1]
            if not self._flow:  # behind a comment on that line
                line_end = self._text.find(self._newline, end)
                end = len(self._text) if line_end < 0 else line_end
            self._spans.append((end, end, between + text))

    def text(self) -> str:
        """The text with all replacements."""
        result = self._text
        for start, end, new in sorted(self._spans, reverse=True):
            result = result[:start] + new + result[end:]
        return result

    def _indent(self) -> str:
        return " " * int(self._pairs[0][0].start_mark.column)

    def _span(self, node: yaml.Node) -> tuple[int, int]:
        """Where a value stands; the parser ends a block at what follows it."""
        start, end = node.start_mark.index, node.end_mark.index
        if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
            last = node.value[-1]
            end = self._span(last[1] if isinstance(last, tuple) else last)[1]
        return start, end

    def _with_comma(self, i: int, start: int, end: int) -> tuple[int, int]:
        """Span of a pair of a flow mapping with the comma that goes with it."""
        if i > 0:
            start = self._span(self._pairs[i - 1][1])[1]
            between = self._text[start : self._pairs[i][0].start_mark.index]
        else:
            following = self._pairs[1][0].start_mark.index if len(self._pairs) > 1 else end
            between, end = self._text[end:following], following
        if "#" in between:
            raise self._error(self._pairs[i][0], "a comment stands beside it; change it by hand")
        return start, end

    def _with_line(self, start: int, end: int) -> tuple[int, int]:
        """Span of a pair of a block mapping with its line, where nothing else stands on that."""
        line_end = self._text.find("\n", end)
        line_end = len(self._text) if line_end < 0 else line_end + 1
        line_start = self._text.rfind("\n", 0, start) + 1
        alone = not self._text[line_start:start].strip() and not self._text[end:line_end].strip()
        if alone:
            return line_start, line_end
        while end < line_end and self._text[end] in " \t":
            end += 1
        return start, end

    def _count(self, node: yaml.Node | None) -> None:
        """Count how often each node is used: anchors make one stand in several places."""
        if node is None:
            return
        self._uses[id(node)] = self._uses.get(id(node), 0) + 1
        if self._uses[id(node)] == 1 and not isinstance(node, yaml.ScalarNode):
            for child in node.value:
                for part in child if isinstance(child, tuple) else (child,):
                    self._count(part)

    def _not_shared(self, node: yaml.Node) -> None:
        if self._uses[id(node)] > 1:
            text = "shared with another place by an anchor; change it by hand"
            raise self._error(node, text)

    def _error(self, node: yaml.Node | None, message: str) -> ConfigError:
        line = node.start_mark.line + 1 if node is not None else None
        where = ".".join(str(key) for key in self._place)
        return ConfigError([Problem(self._name, line, where, message)])


def flow(value: float | str | Sequence[float | str] | Mapping[str, Any]) -> str:
    """A value on one line; of a number the shortest decimal form that is read back as it is."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key}: {flow(one)}' for key, one in value.items())} }}"
    if not isinstance(value, str | int | float):
        return f"[{', '.join(flow(v) for v in value)}]"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, str):
        if not value.isidentifier() and not re.fullmatch(RUN, value):
            raise ValueError(f"expected a word, got {value!r}")
        return value
    text = repr(float(value))
    if "e" in text:
        text = f"{value:.12f}".rstrip("0")
    return text


def _expected(data: Any, place: Place, values: Mapping[str, Value]) -> Any:
    """Data of the file as it has to be afterwards."""
    result = copy.deepcopy(data)
    section = result
    for key in place:
        section = section[key]
    for name, value in values.items():
        if value is None:
            section.pop(name, None)
        elif isinstance(value, str):
            section[name] = value
        else:
            section[name] = yaml.safe_load(flow(value))
    return result


def _read(path: Path) -> str:
    try:
        return read_bounded(path, MOST_BYTES).decode("utf-8")
    except OSError as error:
        raise _failed(path, error) from None
    except UnicodeDecodeError:
        raise ConfigError([Problem(str(path), None, "", "not YAML: not UTF-8")]) from None


def _replace(path: Path, before: str, text: str, expected: Any) -> None:
    """Write beside the file, check, and put it in place of the file; all or nothing."""
    temporary: Path | None = None
    try:
        status = path.stat()
        number, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=".yaml")
        temporary = Path(name)
        with os.fdopen(number, "wb") as file:
            file.write(text.encode("utf-8"))
            file.flush()
            os.fsync(file.fileno())
            owner = (status.st_uid, status.st_gid)
            if hasattr(os, "fchown") and owner != (os.geteuid(), os.getegid()):
                os.fchown(file.fileno(), *owner)
        temporary.chmod(stat.S_IMODE(status.st_mode))
        _check(path, temporary, expected)
        if _read(path) != before:
            text = "changed by someone else meanwhile; nothing was written"
            raise ConfigError([Problem(str(path), None, "", text)])
        temporary.replace(path)
        temporary = None
    except OSError as error:
        raise _failed(path, error) from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _check(path: Path, temporary: Path, expected: Any) -> None:
    """The new file is a valid deployment and differs in nothing but what was asked."""
    try:
        _, source = load_config(temporary)
    except ConfigError as error:
        problems = [Problem(str(path), p.line, p.where, p.message) for p in error.problems]
        raise ConfigError(problems) from None
    if source.data != expected:
        text = "cannot be changed without changing something else; change it by hand"
        raise ConfigError([Problem(str(path), None, "", text)])


def _failed(path: Path, error: OSError) -> ConfigError:
    text = f"not written, the file is as it was: {error.strerror or error}"
    return ConfigError([Problem(str(path), None, "", text)])
