"""Manoeuvres and outcomes of a comparison."""

from canshaper.design.comparison.manoeuvres import Manoeuvre, manoeuvres
from tests.rigs.files import CONFIG

FILE = CONFIG / "forwarder-robust.yaml"
ROBUST = "robust 1.8 s ±15 %"


def task(name: str) -> Manoeuvre:
    return next(t for t in manoeuvres() if t.name == name)
