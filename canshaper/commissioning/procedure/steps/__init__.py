"""The steps of a day of commissioning, in order."""

from canshaper.commissioning.procedure.state import Step
from canshaper.commissioning.procedure.steps.buses import BUSES
from canshaper.commissioning.procedure.steps.check import CHECK
from canshaper.commissioning.procedure.steps.drive import DRIVE
from canshaper.commissioning.procedure.steps.dry import DRY
from canshaper.commissioning.procedure.steps.filter import FILTER
from canshaper.commissioning.procedure.steps.joysticks import JOYSTICKS
from canshaper.commissioning.procedure.steps.motion import FIRST_MOTION
from canshaper.commissioning.procedure.steps.report import REPORT
from canshaper.commissioning.procedure.steps.sensor import SENSOR
from canshaper.commissioning.procedure.steps.swing import SWING
from canshaper.commissioning.procedure.steps.valve import VALVE

STEPS: tuple[Step, ...] = (
    BUSES,
    JOYSTICKS,
    SWING,
    VALVE,
    FILTER,
    SENSOR,
    CHECK,
    DRY,
    FIRST_MOTION,
    DRIVE,
    REPORT,
)
