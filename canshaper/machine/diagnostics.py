"""The problems of a deployment's files: all of them are collected, each with its place."""

from collections.abc import Collection, Iterable

from canshaper.config.section import Section
from canshaper.config.source import Place, Source
from canshaper.errors import ConfigError, Problem


class Diagnostics:
    """Collects every problem, so that a person reads all of them at once.

    Args:
        source: the deployment file.

    Attributes:
        problems: what is wrong so far; those of DBC files are added with file and line of these.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self.problems: list[Problem] = []

    def add(self, place: Place, text: str) -> None:
        """Note a problem at a place of the deployment file."""
        self.problems.append(self._source.problem(place, text))

    def check_axis(self, place: Place, name: str, axes: Collection[str]) -> bool:
        """Whether an axis has this name; a problem where none has."""
        if name not in axes:
            self.add(place, f"expected an axis, got {name!r}; there are {', '.join(axes)}")
        return name in axes

    def check_same(
        self, place: Place, section: Section, keys: Iterable[str], other: Section, text: str
    ) -> None:
        """Note a problem at every key in which a section is not as another one.

        Args:
            place: of the section.
            section: the section.
            keys: those that are compared.
            other: the other section.
            text: what it is, and what makes them equal.
        """
        for key in keys:
            if getattr(section, key) != getattr(other, key):
                self.add((*place, key), f"expected the same as {text}")

    def raise_problems(self) -> None:
        """End here if there is any problem.

        Raises:
            ConfigError: with all of them.
        """
        if self.problems:
            raise ConfigError(self.problems)
