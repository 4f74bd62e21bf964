"""Text edits in one mapping of a YAML file: replace values and comments, insert and remove keys.

The YAML parser locates keys and values; every other byte of the text stays.
"""

import re
from collections.abc import Collection, Iterator

import yaml

from canshaper.config.source import Place
from canshaper.errors import ConfigError, Problem


class Edit:
    """Replacements of spans in one mapping of a text; ``text`` applies them."""

    def __init__(self, text: str, place: Place, name: str) -> None:
        self._text = text
        self._place = place
        self._name = name
        self._spans: list[tuple[int, int, str]] = []
        self._removed: list[int] = []  # indices of the removed pairs
        try:
            root = yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.YAMLError as error:
            raise self._error(None, f"not YAML: {error}") from None
        self._uses: dict[int, int] = {}
        self._count(root)
        node, self._head = root, root
        for key in place:
            if isinstance(node, yaml.SequenceNode) and isinstance(key, int):
                self._head, node = None, node.value[key]
                continue
            pairs = node.value if isinstance(node, yaml.MappingNode) else []
            self._head, node = next(((k, v) for k, v in pairs if k.value == key), (None, None))
            if node is None:
                raise self._error(root, f"no section {key}")
            self._not_shared(node)
        if not isinstance(node, yaml.MappingNode) or not node.value:
            raise self._error(node, "expected a section with keys, got none")
        self._flow = bool(node.flow_style)
        self._section = node
        self._pairs: list[tuple[yaml.Node, yaml.Node]] = node.value
        self._newline = "\r\n" if "\r\n" in text else "\n"

    def replace(self, key: str, value: str) -> bool:
        """Give an existing key a new value; return False if the key is missing."""
        for key_node, node in self._pairs:
            if key_node.value == key:
                self._not_shared(node)
                self._put(key_node, node, value)
                return True
        return False

    def _put(self, key: yaml.Node, node: yaml.Node, value: str) -> None:
        """Replace a value; a new value for a block goes behind its key, on one line."""
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
        """Remove a key with its value; a comment behind it stays, on a line of its own."""
        for i, (key_node, node) in enumerate(self._pairs):
            if key_node.value == key:
                self._not_shared(node)
                if "#" in self._text[key_node.start_mark.index : self._span(node)[1]]:
                    text = f"a comment stands inside {key}; change it by hand"
                    raise self._error(key_node, text)
                self._removed.append(i)

    def replace_comments(self, keys: Collection[str], note: str) -> None:
        """Replace comments on keys by a note, also those on the section if all keys are given."""
        written = [pair for pair in self._pairs if pair[0].value in keys]
        commented = [] if self._flow else written
        if len(written) == len(self._pairs) and self._head:
            commented = [(self._head, self._section), *commented]
        for key, node in commented:
            for start, end in self._comments(key, node):
                if note:
                    self._spans.append((start, end, f"# {note}"))
                else:  # with what is before it on the line, and the line where that is nothing
                    before = self._text[:start].rstrip(" \t").removesuffix("\n").removesuffix("\r")
                    self._spans.append((len(before), end, ""))
                note = ""

    def _comments(self, key: yaml.Node, node: yaml.Node) -> Iterator[tuple[int, int]]:
        """Yield the spans of comments directly above a key, at its column, and behind it."""
        column = key.start_mark.column
        line_start = start = key.start_mark.index - column
        while start:
            above = self._text.rfind("\n", 0, start - 1) + 1
            line = self._text[above:start]
            if not line.startswith("#", column) or line[:column].strip():
                break
            start = above
        if start < line_start:  # the line end and the column of the last line stay
            yield start + column, line_start - len(self._newline)
        block = isinstance(node, yaml.CollectionNode) and not node.flow_style
        end = self._text.index(":", key.end_mark.index) + 1 if block else self._span(node)[1]
        if behind := re.compile(r"[ \t]+(#[^\r\n]*)").match(self._text, end):
            yield behind.span(1)

    def insert(self, pairs: list[tuple[str, str]]) -> None:
        """Insert keys: in place of a removed one, or behind the last one."""
        indent = " " * int(self._pairs[0][0].start_mark.column)
        between = ", " if self._flow else self._newline + indent
        text = between.join(f"{key}: {value}" for key, value in pairs)
        gone = self._removed[1:] if text else self._removed
        first_kept = next((i for i in range(len(self._pairs)) if i not in gone), len(self._pairs))
        for i in self._removed:
            start, end = self._pairs[i][0].start_mark.index, self._span(self._pairs[i][1])[1]
            if text:
                self._spans.append((start, end, text))
                text = ""
            elif self._flow:
                self._spans.append((*self._with_comma(i, start, end, begins=i < first_kept), ""))
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
        """Return the text with all replacements."""
        result = self._text
        for start, end, new in sorted(self._spans, reverse=True):
            result = result[:start] + new + result[end:]
        return result

    def _span(self, node: yaml.Node) -> tuple[int, int]:
        """Return the span of a value; the parser's own span of a block reaches to what follows."""
        start, end = node.start_mark.index, node.end_mark.index
        if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
            last = node.value[-1]
            end = self._span(last[1] if isinstance(last, tuple) else last)[1]
        return start, end

    def _with_comma(self, i: int, start: int, end: int, *, begins: bool) -> tuple[int, int]:
        """Return the span of a pair in a flow mapping with the comma before it.

        Of pairs that no kept one stands before (``begins``), it is the comma behind.
        """
        if begins:
            following = self._pairs[i + 1][0].start_mark.index if i + 1 < len(self._pairs) else end
            between, end = self._text[end:following], following
        else:
            start = self._span(self._pairs[i - 1][1])[1]
            between = self._text[start : self._pairs[i][0].start_mark.index]
        if "#" in between:
            raise self._error(self._pairs[i][0], "a comment stands next to it; change it by hand")
        return start, end

    def _with_line(self, start: int, end: int) -> tuple[int, int]:
        """Return the span of a pair in a block mapping, with its line if it stands there alone."""
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
        """Count the uses of each node: an anchor makes a node stand in several places."""
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
