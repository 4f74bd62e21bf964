"""Change single values of a deployment file and leave every other byte as it is.

The YAML parser locates keys and values; only their spans are replaced. The module writes all
changes of a call to a temporary file next to the file, loads that as a deployment with its DBC
files, and then replaces the file in one step: a killed program leaves the old file or the new one.
"""

import copy
import json
import os
import re
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from difflib import unified_diff
from itertools import groupby
from pathlib import Path
from typing import Any

import yaml

from canshaper.config.adjust import AxisKey
from canshaper.config.schema import AxisSection
from canshaper.config.section import RUN
from canshaper.config.source import MOST_BYTES, Place, Source, read_bounded
from canshaper.edit.spans import Edit
from canshaper.errors import ConfigError, Problem, printable
from canshaper.machine.binding import load_deployment
from canshaper.shipped import version

# Text that is read as itself: a path, a word, several, a run of numbers, a date.
_PLAIN = re.compile(
    r"(?!(?i:true|false|null)$)(?:\.*/)*[^\W\d][\w./+-]*( [\w./+-]+)*"
    rf"|{RUN}|\d{{4}}-\d\d-\d\d"
)

FileValue = float | str | Sequence[float | str] | Mapping[str, Any] | None
"""A value to write: a number, a text, a list of numbers and of runs of them (``39 x 0``), or
such values by their keys; None takes the key away."""


def plain(text: str) -> str:
    """Return a text as YAML: in quotes if YAML could read it as something else."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)  # YAML too


def flow(value: float | str | Sequence[float | str] | Mapping[str, Any]) -> str:
    """Return a value as YAML on one line; a number in its shortest form that reads back equal."""
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
    """Return a value as YAML reads it after ``flow`` has written it."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return {key: read_back(one) for key, one in value.items()}
    if isinstance(value, Sequence):
        return [read_back(one) for one in value]
    return yaml.safe_load(flow(value))


Change = tuple[Place, Mapping[str, FileValue], str]
"""Keys down to a section, values by key, and one line in place of comments on them or none."""


def of_limits(name: str, axis: AxisSection, values: Mapping[str, Any]) -> Change:
    """Return the change of values in the section limits of an axis, which may be missing."""
    if "limits" in axis.model_fields_set:
        return ("axes", name, "limits"), values, ""
    return ("axes", name), {"limits": values}, ""


def change(path: Path, changes: Iterable[Change]) -> list[str]:
    """Write values into sections of a deployment file, all of them or none.

    Existing keys get the new value, missing keys are inserted, keys with None are removed.
    Comments, order, spacing, line ends and everything else stay.

    A note replaces the comments that described the old values: directly above a written key and
    behind it on its line; if all keys of the section are written, also those of the section. In a
    section on one line it replaces only the comments of the section.

    Args:
        path: the deployment file; a symbolic link is followed.
        changes: (section, values, note) of each, the section such as ("axes", "slew", "filter").

    Returns:
        The changed lines, marked with - and + as in a diff.

    Raises:
        ConfigError: the section is missing or cannot be changed without changing something
            else, the result is no valid deployment, or the file cannot be written. The file then
            is unchanged.
    """
    path = path.resolve()
    text = before = _read(path)
    expected = Source(path).data
    for place, values, note in changes:
        text = edited(text, place, values, str(path), note)
        expected = _expected(expected, place, values)
    _replace(path, before, text, expected)
    return list(_changed(before, text))


def replace_text(path: Path, text: str) -> None:
    """Replace the whole text of a deployment file, in one step as ``change`` does.

    Raises:
        ConfigError: the text is no valid deployment or cannot be written; the file is unchanged.
    """
    path = path.resolve()
    _replace(path, _read(path), text, None)


def _changed(before: str, after: str) -> Iterator[str]:
    """Yield the removed and the added lines of the file."""
    lines = unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    for line in list(lines)[2:]:
        if not line.startswith("@@"):
            yield line


def edited(
    text: str, place: Place, values: Mapping[str, FileValue], name: str = "", note: str = ""
) -> str:
    """Return the text of a YAML file with values of one section changed; see ``change``.

    Raises:
        ConfigError: the section cannot be changed; the message names the file ``name``.
    """
    if note:
        edit = Edit(text, place, name)
        edit.replace_comments(values, note)
        text = edit.text()
    edit = Edit(text, place, name)
    absent = []
    for key, value in values.items():
        if value is None:
            edit.remove(key)
        elif not edit.replace(key, flow(value)):
            absent.append((key, flow(value)))
    edit.insert(absent)
    return edit.text()


def _expected(data: Any, place: Place, values: Mapping[str, FileValue]) -> Any:
    """Return the data that the file must have after the change."""
    result = copy.deepcopy(data)
    section = result
    for key in place:
        section = section[key]
    for name, value in values.items():
        if value is None:
            section.pop(name, None)
        else:
            section[name] = read_back(value)
    return result


def _read(path: Path) -> str:
    try:
        return read_bounded(path, MOST_BYTES).decode("utf-8")
    except OSError as error:
        raise _failed(path, error) from None
    except UnicodeDecodeError:
        raise ConfigError([Problem(str(path), None, "", "not YAML: not UTF-8")]) from None


def _replace(path: Path, before: str, text: str, expected: Any) -> None:
    """Write a temporary file, check it, and put it in place of the file; all or nothing."""
    temporary: Path | None = None
    try:
        status = path.stat()
        number, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
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


def sections_of(values: Mapping[str, float]) -> dict[Place, dict[str, float | None]]:
    """Return the numbers of each section of a file, by keys such as ``axes.slew.sway.period_s``.

    A changed sway section loses its ``origin``: its numbers are no longer the measured ones.
    """
    sections: dict[Place, dict[str, float | None]] = {}
    for text, number in values.items():
        key = AxisKey.parsed(text)
        assert key is not None  # the daemon took it
        numbers = sections.setdefault(("axes", key.axis, key.section), {})
        numbers[key.name] = number
        if key.section == "sway":
            numbers["origin"] = None
    return sections


def _check(path: Path, temporary: Path, expected: Any) -> None:
    """Check that the new file is a valid deployment with no other difference than the changes."""
    try:
        source = load_deployment(temporary).source
    except ConfigError as error:
        problems = [
            replace(p, file=str(path)) if p.file == str(temporary) else p for p in error.problems
        ]
        raise ConfigError(problems) from None
    if expected is not None and source.data != expected:
        text = "cannot be changed without changing something else; change it by hand"
        raise ConfigError([Problem(str(path), None, "", text)])


def _failed(path: Path, error: OSError) -> ConfigError:
    text = f"not written, the file is as it was: {error.strerror or error}"
    return ConfigError([Problem(str(path), None, "", text)])


def shortened(numbers: Sequence[float]) -> list[float | str]:
    """Return the list with runs, as a file has it; ``config.section.expanded`` undoes this."""
    runs: list[float | str] = []
    for number, equal in groupby(numbers):
        count = len([*equal])
        runs.append(number if count == 1 else f"{count} x {number!r}".removesuffix(".0"))
    return runs


def written_by(verb: str, *, simulated: bool | None, log: str | None = None) -> dict[str, Any]:
    """Return the origin of numbers that are written now, as keys of a section.

    Args:
        verb: the verb that writes the numbers.
        simulated: the numbers were measured on a simulated crane; None if unknown.
        log: name of the log from which the numbers were computed.
    """
    values: dict[str, Any] = {"date": f"{datetime.now(UTC).date()}"}
    if log is not None:
        values["log"] = printable(log)
    values["by"] = f"canshaper {verb} {version()}"
    if simulated is not None:
        values["source"] = "simulated" if simulated else "machine"
    return values


def note(verb: str) -> str:
    """Return the comment that replaces those on numbers written by a verb."""
    return f"Written by canshaper {verb}."
