"""Numbers that were changed in a running machine, written into its file."""

from collections.abc import Mapping
from pathlib import Path

from canshaper.config.adjust import Key
from canshaper.config.edit import set_values
from canshaper.config.source import Place


def sections_of(values: Mapping[str, float]) -> dict[Place, dict[str, float | None]]:
    """What a file's sections get: numbers by their keys, such as ``axes.slew.sway.period_s``.

    What says where a sway model was measured is taken out: it is no longer what was measured.
    """
    sections: dict[Place, dict[str, float | None]] = {}
    for text, number in values.items():
        key = Key.parsed(text)
        assert key is not None  # the daemon took it
        numbers = sections.setdefault(("axes", key.axis, key.section), {})
        numbers[key.name] = number
        if key.section == "sway":
            numbers["origin"] = None
    return sections


def write_numbers(path: Path, values: Mapping[str, float]) -> None:
    """Write numbers into a deployment file; see ``set_values``.

    Raises:
        ConfigError: the file cannot be changed.
    """
    for place, numbers in sections_of(values).items():
        set_values(path, place, numbers)
