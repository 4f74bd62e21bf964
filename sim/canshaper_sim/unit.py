"""A third party's crane: a co-simulation unit (FMU) in place of our crane, run by fmpy.

Its variables have the names of the unit that ``canshaper export --fmu plant`` makes. Of a name only
letters and digits count, in either case: ``Slew_Command`` is ``slew.command``.
"""

import math
import shutil
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Final

from canshaper.errors import DesignError, DriveError
from canshaper_sim.axes import LIFT, NEAR_FAR, ROTATOR, SLEW, TIP_AXES
from canshaper_sim.crane import Crane, CraneParameters, CraneState

# Name of the position of an axis.
POSE: Final = {SLEW: "angle", NEAR_FAR: "radius", LIFT: "height"}
SWAY: Final = ("sway.across", "sway.along")
_NUMBER = ("Real", "Float64")  # types in FMI 2.0 and 3.0
_SAME = 1e-9


class Unit:
    """An unpacked unit of FMI 2.0 or 3.0.

    Args:
        path: the FMU file.

    Raises:
        DesignError: the file is no such unit, or not for co-simulation.
        ModuleNotFoundError: fmpy is not installed.
    """

    def __init__(self, path: Path) -> None:
        import fmpy  # noqa: PLC0415  (an extra)

        self._fmpy: Any = fmpy
        self._path = path
        self._folder = mkdtemp(prefix="canshaper-unit-")
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        try:
            self._about: Any = fmpy.read_model_description(str(path))
            fmpy.extract(str(path), unzipdir=self._folder)
        except Exception as error:  # whatever is wrong with another's file
            raise DesignError(f"{path}: expected an FMU: {error}") from None
        if self._about.coSimulation is None or self._about.fmiVersion == "1.0":
            raise DesignError(f"{path}: expected FMI 2.0 or 3.0 for co-simulation")
        self._variables = {
            (one.causality, _plain(one.name)): one.valueReference
            for one in self._about.modelVariables
            if one.type in _NUMBER
        }

    def crane(
        self, axes: Mapping[str, str], tick_s: float, parameters: CraneParameters
    ) -> "UnitCrane":
        """Instantiate the unit and return its crane at the start of a drive.

        Args:
            axes: coordinate -> name of the axis that moves it.
            tick_s: length of each step.
            parameters: full speeds of the axes, which the unit does not have.

        Raises:
            DesignError: an axis moves no tip, or the unit lacks a variable or has another step.
            DriveError: the unit does not start.
        """
        if others := {*axes} - {*TIP_AXES, ROTATOR}:
            text = f"expected axes that move the tip, got {', '.join(sorted(others))}"
            raise DesignError(f"{self._path}: {text}")
        named = {one: name for one, name in axes.items() if one != ROTATOR}
        inputs = [f"{name}.command" for name in named.values()]
        outputs = [f"{name}.{POSE[one]}" for one, name in named.items()]
        outputs += [f"{name}.speed" for name in named.values()]
        outputs += [*SWAY, *(f"{one}_rate" for one in SWAY)]
        kinds = dict.fromkeys(inputs, "input") | dict.fromkeys(outputs, "output")
        known = {
            name: self._variables[kind, _plain(name)]
            for name, kind in kinds.items()
            if (kind, _plain(name)) in self._variables
        }
        if absent := [f"{name} ({kind})" for name, kind in kinds.items() if name not in known]:
            text = f"expected numbers {', '.join(absent)}, got none of these names"
            raise DesignError(f"{self._path}: {text}")
        self._check_step(tick_s)
        references = [known[one] for one in inputs], [known[one] for one in outputs]
        return UnitCrane(self._begin(), [*named], *references, parameters)

    def _check_step(self, tick_s: float) -> None:
        unit, usual = self._about.coSimulation, self._about.defaultExperiment
        own_s = unit.fixedInternalStepSize
        if not own_s and usual and not unit.canHandleVariableCommunicationStepSize:
            own_s = usual.stepSize
        parts = tick_s / float(own_s or tick_s)
        if parts < 0.5 or abs(parts - round(parts)) > _SAME:
            text = f"expected a step of {tick_s:g} s, as tick_ms, or a whole part, got {own_s} s"
            raise DesignError(f"{self._path}: {text}")

    def _begin(self) -> "_Slave":
        said = list[str]()
        try:
            slave = self._fmpy.instantiate_fmu(
                self._folder,
                self._about,
                "CoSimulation",
                logger=lambda *parts: said.append(parts[-1].decode(errors="replace")),
            )
            if self._about.fmiVersion == "2.0":
                slave.setupExperiment(startTime=0.0)
            slave.enterInitializationMode()
            slave.exitInitializationMode()
        except Exception as error:  # from the library of the unit
            raise DriveError(f"{self._path}: {error} {'; '.join(said)}".rstrip()) from None
        return _Slave(self._path, slave, said)


class _Slave:
    """A running instance of a unit."""

    def __init__(self, path: Path, slave: Any, said: list[str]) -> None:
        self._path, self._slave, self._said = path, slave, said
        number = "Real" if hasattr(slave, "getReal") else "Float64"
        self._get, self._set = getattr(slave, f"get{number}"), getattr(slave, f"set{number}")
        weakref.finalize(self, _end, slave)

    def read(self, references: Sequence[int]) -> list[float]:
        """Return the values of the variables with these FMI value references."""
        values: list[float] = self._get(references)
        return values

    def step(self, time_s: float, dt_s: float, commands: Mapping[int, float]) -> None:
        """Hold these commands (value reference -> value) for dt_s seconds from time_s on.

        Raises:
            DriveError: the unit fails.
        """
        try:
            self._set([*commands], [*commands.values()])
            self._slave.doStep(currentCommunicationPoint=time_s, communicationStepSize=dt_s)
        except Exception as error:  # the same
            text = "; ".join([str(error), *self._said])
            raise DriveError(f"{self._path}: at {time_s:.2f} s: {text}") from None


def _end(slave: Any) -> None:
    with suppress(Exception):  # one that has failed may not end either
        slave.terminate()
    slave.freeInstance()


class UnitCrane(Crane):
    """A crane moved by a unit: no load, no initial swing, no parameter but the start pose."""

    def __init__(
        self,
        slave: _Slave,
        axes: Sequence[str],
        inputs: Sequence[int],
        outputs: Sequence[int],
        parameters: CraneParameters,
    ) -> None:
        super().__init__(parameters)
        self._slave, self._moved = slave, axes
        self._inputs, self._outputs = dict(zip(axes, inputs, strict=True)), outputs
        self._commands = dict.fromkeys(axes, 0.0)
        self._values = slave.read(outputs)

    @property
    def state(self) -> CraneState:
        """Pose, tip speeds and sway from the outputs of the unit."""
        pose, speeds = [*self.boom.pose[:3]], [0.0, 0.0, 0.0]
        count, sway = len(self._moved), self._values[-4:]
        for k, axis in enumerate(self._moved):
            at = TIP_AXES.index(axis)
            pose[at], speeds[at] = self._values[k], self._values[count + k]
        return CraneState(self._time_s, *pose, *speeds, *sway)

    def speed(self, axis: str) -> float:
        """Return the speed of an axis that the unit moves, rad/s or m/s."""
        return self._values[len(self._moved) + self._moved.index(axis)]

    def opening(self, axis: str) -> float:
        """Return the command of an axis, since a unit does not report the opening of its valve."""
        return self._commands[axis]

    def step(self, dt_s: float, commands: Mapping[str, float]) -> None:
        """Hold the commands for dt_s seconds; an axis without a command keeps its last one.

        Commands of axes that the unit does not move are ignored.

        Raises:
            DriveError: the unit fails.
        """
        self._commands |= {one: value for one, value in commands.items() if one in self._commands}
        given = {self._inputs[one]: value for one, value in self._commands.items()}
        self._slave.step(self._time_s, dt_s, given)
        self._time_s += dt_s
        self._values = self._slave.read(self._outputs)
        self.swung_over = self.swung_over or any(
            abs(one) > math.pi / 2.0 for one in self._values[-4:-2]
        )


@cache
def unit_of(path: Path) -> Unit:
    """Return the unit of a file; each process unpacks a file once."""
    return Unit(path)


def _plain(name: str) -> str:
    return "".join(one for one in name.lower() if one.isalnum())
