"""The C against the controller: every valve frame and number of the inner state, bit by bit."""

import struct
from functools import cache
from pathlib import Path

import pytest

from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.errors import NativeError
from canshaper.machine.deployment import Deployment
from canshaper.native.drive import NAMES, play, random_drive, rows
from canshaper.native.library import C_FILES, NativeController, NativeLibrary, compiler
from tests.rigs.files import CONFIG, read

SeenStates = set[tuple[str, str]]


def needs_compiler() -> None:
    """Skip the test where there is no C compiler."""
    try:
        compiler()
    except NativeError as error:
        pytest.skip(str(error))


def native(deployment: Deployment, *flags: str, sources: Path = C_FILES) -> NativeController:
    """The C with the tables of a deployment; the test is skipped where nothing compiles it."""
    needs_compiler()
    return NativeController(NativeLibrary(deployment, *flags, sources=sources))


@cache
def shipped(name: str) -> NativeLibrary:
    """The C with the tables of a shipped deployment; compiled once by each process."""
    needs_compiler()
    return NativeLibrary(read(CONFIG / f"{name}.yaml"))


def difference(
    deployment: Deployment, c: NativeController, seed: str, ticks: int, *, gated: bool = False
) -> tuple[str, SeenStates]:
    """The first difference of frames or states, "" for none; and the states that were seen.

    Args:
        deployment: the machine.
        c: the C with its tables.
        seed: of the drive.
        ticks: of the drive.
        gated: the controller is behind its gate.
    """
    controller = Controller(deployment.unreported)
    python = GatedController(controller) if gated else controller
    seen: SeenStates = set()
    for number, tick in enumerate(random_drive(deployment, seed, ticks)):
        ours, theirs = play(tick, python), play(tick, c)
        controller.events.clear()
        if ours != theirs:
            return f"tick {number}: frames {ours}, C {theirs}", seen
        if wrong := _of_rows(rows(controller), c.rows()):
            return f"tick {number}: {wrong}", seen
        for control in controller.axes.values():
            seen.add((control.axis.state.name, control.axis.reason.name))
    return "", seen


def _of_rows(ours: list[list[float]], theirs: list[list[float]]) -> str:
    """The first number that is not the same to the last bit."""
    for part, (row, other) in enumerate(zip(ours, theirs, strict=True)):
        form = f"<{len(row)}d"
        if struct.pack(form, *row) != struct.pack(form, *other):
            for number, (one, two) in enumerate(zip(row, other, strict=True)):
                if struct.pack("<d", one) != struct.pack("<d", two):
                    name = NAMES[number] if len(row) == len(NAMES) else str(number)
                    return f"part {part}, {name}: {one!r}, C {two!r}"
    return ""
