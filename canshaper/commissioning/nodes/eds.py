"""Reader of EDS and DCF files (CiA 306) on top of the library ``canopen``.

Faults that the library ignores, or reports without a place, are errors here with their section.
"""

import configparser
import io
import logging
import re
from pathlib import Path

from canopen.objectdictionary import ObjectDictionary
from canopen.objectdictionary.eds import import_eds

from canshaper.config.source import encoding_of, read_bounded
from canshaper.errors import ConfigError, Problem

# canopen warns of types that no PDO has, which is nothing for the operator's terminal.
logging.getLogger("canopen.objectdictionary").setLevel(logging.ERROR)
MOST_BYTES = 4 << 20
_OBJECT = re.compile(r"([0-9A-F]{4})(sub[0-9A-F]+)?", re.IGNORECASE)
_OF_OBJECTS = re.compile(r"([0-9A-F]{1,4})(?:(sub(?=.)|Name$|Value$)([0-9A-F]*))?", re.IGNORECASE)
_NODE = "DeviceComissioning"  # as the standard spells it
_MAY_BE_EMPTY = ("ObjectType", "PDOMapping", "LowLimit", "HighLimit", "SubNumber", "CompactSubObj")
_OTHERS = ("ParameterName", "ParameterValue", "DataType", "AccessType", "DefaultValue", "NodeID")
_KEYS = {key.lower(): key for key in (*_MAY_BE_EMPTY, *_OTHERS)}
_PARTS = {part.lower(): part for part in ("", "sub", "Name", "Value")}
_VARIABLES = (0x2, 0x7)  # DOMAIN, VAR


class Eds:
    """An EDS or DCF file.

    Attributes:
        node: node id of a DCF; None where it has none.

    Raises:
        OSError: it cannot be read.
        ConfigError: it is no EDS or DCF.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        data = read_bounded(path, MOST_BYTES)
        try:
            self._text = data.decode(encoding_of(data[:4]) or "utf-8")
        except UnicodeDecodeError:
            self._text = data.decode("latin-1")
        if self._text.lstrip().startswith("<"):
            text = "expected an EDS or DCF, got XML; export an EDS of an XDD or XDC"
            raise ConfigError([Problem(str(path), 1, "", text)])
        self._file = configparser.RawConfigParser(inline_comment_prefixes=(";",))
        self._file.optionxform = str  # type: ignore[method-assign,assignment]
        try:
            self._file.read_string(self._text)
        except configparser.Error as error:
            raise self._not_one(error) from None
        self._file = _canonical(self._file)
        sections = [name for name in self._file.sections() if _OBJECT.fullmatch(name)]
        if not sections:
            raise self._wrong("", "expected objects, such as [1000], got none; not an EDS or DCF")
        for section in sections:
            self._check(section)
        node = self._file.get(_NODE, "NodeID", fallback="").strip()
        self.node = self._whole(_NODE, "NodeID", node) if node else None

    def objects(self, node: int) -> ObjectDictionary:
        """Return the object dictionary of the node with this id.

        Raises:
            ConfigError: the library cannot read it.
        """
        parser = configparser.RawConfigParser()
        parser.optionxform = str  # type: ignore[method-assign,assignment]
        parser.add_section("DeviceInfo")  # of which nothing is used
        for section in self._file.sections():
            if _OF_OBJECTS.fullmatch(section):
                parser[section] = dict(self._file[section])
        text = io.StringIO()
        parser.write(text)
        text.seek(0)
        try:
            objects: ObjectDictionary = import_eds(text, node)  # type: ignore[no-untyped-call]
        except configparser.NoOptionError as error:
            text_ = f"expected {error.option}, got none"
            raise self._wrong(error.section, text_) from None
        except (configparser.Error, KeyError, ValueError, TypeError) as error:
            raise self._wrong("", f"not an EDS or DCF that can be read: {error}") from None
        return objects

    def elements(self, index: int) -> int:
        """Return the number of elements of an array with one section (CompactSubObj), else 0."""
        section, key = f"{index:04X}", "CompactSubObj"
        return self._whole(section, key, self._file.get(section, key, fallback="0"))

    def problem(self, section: str, text: str) -> Problem:
        """Return a problem at a section, with its line."""
        pattern = re.compile(rf"^\s*\[{re.escape(section)}\]", re.IGNORECASE | re.MULTILINE)
        place = pattern.search(self._text) if section else None
        line = self._text.count("\n", 0, place.end()) + 1 if place else None
        return Problem(str(self.path), line, f"[{section}]" if section else "", text)

    def _wrong(self, section: str, text: str) -> ConfigError:
        return ConfigError([self.problem(section, text)])

    def _not_one(self, error: configparser.Error) -> ConfigError:
        """Return the error of a file that is not made of sections, with the line."""
        several = getattr(error, "errors", ())  # of a ParsingError, with their lines
        line = several[0][0] if several else getattr(error, "lineno", None)
        got = self._text.splitlines()[line - 1].strip()[:40] if line else "another"
        text = "expected sections of KEY=VALUE, each once, as an EDS or DCF has them"
        return ConfigError([Problem(str(self.path), line, "", f"{text}, got {got!r}")])

    def _check(self, section: str) -> None:
        """Raise ConfigError for what canopen would report without its section."""
        match = _OBJECT.fullmatch(section)
        assert match
        options = self._file[section]
        needed = ["ParameterName"]
        kind = self._whole(section, "ObjectType", options.get("ObjectType", "0x7"))
        if match[2] and not self._file.has_section(match[1]):
            raise self._wrong(section, f"expected a section [{match[1]}] as well, got none")
        if match[2] or kind in _VARIABLES:
            needed += ["DataType", "AccessType"]
        for key in needed:
            if key not in options:
                raise self._wrong(section, f"expected {key}, got none")
        for key in ("DataType", "PDOMapping", "CompactSubObj"):
            if key in options:
                self._whole(section, key, options[key])

    def _whole(self, section: str, key: str, text: str) -> int:
        try:
            return int(text, 0)
        except ValueError:
            raise self._wrong(section, f"{key}: expected a whole number, got {text!r}") from None


def _canonical(file: configparser.RawConfigParser) -> configparser.RawConfigParser:
    """Return the file with sections and keys in the standard's spelling, without empty numbers."""
    result = configparser.RawConfigParser()
    result.optionxform = str  # type: ignore[method-assign,assignment]
    for section in file.sections():
        name = _NODE if section.lower() == _NODE.lower() else section
        if match := _OF_OBJECTS.fullmatch(section):
            index, part, subindex = match.groups("")
            name = index.upper() + _PARTS[part.lower()] + subindex.upper()
        if not result.has_section(name):
            result.add_section(name)
        for key, value in file[section].items():
            known = _KEYS.get(key.lower(), key)
            if value or known not in _MAY_BE_EMPTY:
                result[name][known] = value
    return result
