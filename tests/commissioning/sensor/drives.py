"""Logs of the simulated crane, driven by hand, with a sensor that is known."""

import functools
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from canshaper.commissioning.identification.series import Series
from canshaper.commissioning.procedure.bench import log_simulated
from canshaper.commissioning.sensor.fit import hand_driven, read_sensors
from canshaper.commissioning.sensor.verdict import SensorFinding, examine
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.strokes import Script
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.rigs.files import ROOT

FILE = ROOT / "config" / "forwarder-sensor.yaml"
GYRO = (("message: SwayAngle", "message: SwayRate"), ("kind: angle", "kind: rate"))
AXES = ("slew", "near_far")


@functools.cache
def _directory() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="canshaper-sensor-")


@functools.cache
def machine(*changes: tuple[str, str], file: Path = FILE) -> Deployment:
    """A shipped deployment, changed."""
    text = file.read_text(encoding="utf-8")
    for old, new in (*changes, ("../dbc", str(ROOT / "dbc"))):
        assert old in text, old
        text = text.replace(old, new)
    path = Path(_directory().name) / f"{abs(hash((changes, file)))}.yaml"
    path.write_text(text, encoding="utf-8")
    return load_deployment(path)


@dataclass(frozen=True)
class Drive:
    """A drive: commands, swing and sensor.

    Attributes:
        deployment: the machine.
        axis: the axis that is looked at.
        length_pct: real length against that of the file.
        script: what the driver does; by default what is asked for.
    """

    deployment: Deployment
    axis: str = "near_far"
    length_pct: float = 0.0
    script: Script | None = None

    def series(self, crane: CraneParameters | None = None, **sensor: float) -> Series:
        """Measurements of the sensor of the axis."""
        crane = crane or CraneParameters()
        crane = replace(
            crane,
            grapple=crane.grapple.longer(self.length_pct),
            sway_sensor=SwaySensorParameters(**sensor),
        )
        path = Path(_directory().name) / "drive.log"
        script = self.script or hand_driven([self.axis])
        log_simulated(path, self.deployment, crane, script)
        return read_sensors(path, self.deployment, [self.axis])[self.axis]

    def finding(self, **sensor: float) -> SensorFinding:
        """The finding about its sensor."""
        return examine(self.deployment.axes[self.axis], self.series(**sensor))
