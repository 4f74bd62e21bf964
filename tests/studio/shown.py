"""Cranes as a page is shown them: their poses and valves."""

from typing import Any


def pose(shown: dict[str, Any]) -> list[Any]:
    return [crane["pose"] for crane in shown["cranes"].values()]


def valves(shown: dict[str, Any], crane: str) -> list[float]:
    return [axis["valve"] for axis in shown["cranes"][crane]["axes"].values()]
