"""One thing that was looked at: what was found, and what to do about it."""

from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    """What a finding means for the deployment."""

    OK = "ok"
    NOTE = "note"
    """To be known; neither good nor bad."""
    WARNING = "warning"
    """It works; something can be better, or could not be checked."""
    BAD = "bad"
    """Not fit until it is repaired."""


@dataclass(frozen=True)
class Finding:
    """A finding; ``remedy`` says what to do where there is something to do."""

    subject: str
    level: Level
    found: str
    remedy: str = ""


def fit(findings: list[Finding]) -> bool:
    """Whether nothing is bad."""
    return all(finding.level is not Level.BAD for finding in findings)
