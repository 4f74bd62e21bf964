"""``canshaper export --fmu``: the C as a co-simulation unit of FMI 3.0, for other simulation tools.

Source: https://fmi-standard.org/docs/3.0. The unit of the controller takes demands and switches,
and makes the joystick frames itself; the unit of the plant is in ``campaign``.
"""

import hashlib
import platform
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

from canshaper.errors import NativeError
from canshaper.machine.deployment import Deployment
from canshaper.native.export import check_exported
from canshaper.native.library import (
    C_FILES,
    FLAGS,
    FMU_FILES,
    compile_library,
    sizes_source,
    tables_source,
)
from canshaper.native.tables import tables
from canshaper.shaping.states import Reason, State
from canshaper.shipped import version

_SHOWN = 'factor="57.29577951308232"/>'
# Elements of a unit of measurement: its base units, and the unit to show it in.
UNITS = {
    "1": "<BaseUnit/>",
    "m": '<BaseUnit m="1"/>',
    "m/s": '<BaseUnit m="1" s="-1"/>',
    "rad": f'<BaseUnit rad="1"/><DisplayUnit name="deg" {_SHOWN}',
    "rad/s": f'<BaseUnit rad="1" s="-1"/><DisplayUnit name="deg/s" {_SHOWN}',
}
_BUILD = """\
<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
<BuildConfiguration modelIdentifier="{name}">
<SourceFileSet language="C99" compilerOptions="{flags}">{files}</SourceFileSet>
</BuildConfiguration>
</fmiBuildDescription>
"""
_MODEL = """\
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{token}"
 description={text} generationTool="canshaper {version}">
<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"
 fixedInternalStepSize="{tick_s!r}"/>
<UnitDefinitions>{units}</UnitDefinitions>
<TypeDefinitions>{types}</TypeDefinitions>
<LogCategories><Category name="logStatusError"/></LogCategories>
<DefaultExperiment startTime="0" stepSize="{tick_s!r}"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"
 description="Simulated time, s"/>
{variables}
</ModelVariables>
<ModelStructure>{outputs}</ModelStructure>
</fmiModelDescription>
"""


@dataclass(frozen=True)
class Variable:
    """A variable of a co-simulation unit.

    Attributes:
        name: name of the variable; "" for a place that this machine does not use.
        text: its description.
        unit: one of ``UNITS``, or State or Reason; "" for a switch.
        start: its initial value.
    """

    name: str
    text: str = ""
    unit: str = ""
    start: float = 0.0

    def element(self, reference: int, kind: str) -> str:
        """Return its element of modelDescription.xml; ``kind``: attributes of its causality."""
        if self.unit in UNITS:
            own, of = f'variability="discrete" start="{self.start!r}" unit="{self.unit}"', "Float64"
        elif self.unit:
            own, of = f'start="{self.start:.0f}" declaredType="{self.unit}"', "Enumeration"
        else:
            own, of = f'start="{str(bool(self.start)).lower()}"', "Boolean"
        names = f'name={quoteattr(self.name)} valueReference="{reference}"'
        return f"<{of} {names} {kind} {own} description={quoteattr(self.text)}/>"


@dataclass(frozen=True)
class Unit:
    """A co-simulation unit.

    Attributes:
        kind: controller or plant.
        text: its description.
        inputs: variables with the value references 1, 2, ...
        outputs: variables with the references after those.
        sources: its C by file name, without the C of FMI.
        header: numbers of this machine for its C, in ``cs_unit.h``.
    """

    kind: str
    text: str
    inputs: Sequence[Variable]
    outputs: Sequence[Variable]
    sources: Mapping[str, str]
    header: str = ""


def controller_unit(deployment: Deployment) -> Unit:
    """Return the controller of a deployment as a unit.

    Raises:
        ConfigError: the C does not support something of the deployment.
    """
    numbers = tables(deployment)
    inputs, outputs, moved = list[Variable](), list[Variable](), dict[tuple[str, str], list[str]]()
    for axis, bound_axis in deployment.axes.items():
        command = bound_axis.config.command
        moved.setdefault((command.joystick, command.signal), []).append(axis)
    for name, bound in deployment.joysticks.items():
        switches = (bound.enable, bound.config.reset, bound.config.anti_sway_off)
        for key, signal in zip(("enable", "reset", "anti_sway_off"), switches, strict=True):
            text = f"Switch {signal}"
            inputs.append(Variable(f"{name}.{key}" if signal else "", text, start=key == "enable"))
        for one in dict.fromkeys(one.name for one in bound.velocities):
            axes = moved[name, one]
            text = f"Demand of {', '.join(axes)} by {one}, a part of full speed"
            inputs.append(Variable(f"{axes[0]}.demand", text, "1"))
    for name, motion in deployment.motions.items():
        if motion.radius:
            text = "Measured distance of the tip from the slew axis; 0: no message comes"
            inputs.append(Variable(f"{name}.radius", text, "m"))
    for name in deployment.axes:
        outputs += [
            Variable(f"{name}.command", "What the valve gets, a part of its full command", "1"),
            Variable(f"{name}.state", "State of the axis", "State"),
            Variable(f"{name}.reason", "Why it is in that state", "Reason"),
        ]
    files = [*(C_FILES / "src").glob("*.[ch]")]
    files += [FMU_FILES / name for name in ("cs_number.h", "cs_unit_controller.c")]
    return Unit(
        "controller",
        f"Anti-sway of {deployment.path.name}: joysticks to valves",
        inputs,
        outputs,
        {
            **{path.name: path.read_text(encoding="utf-8") for path in files},
            "cs_sizes.h": sizes_source(numbers),
            "cs_tables.c": tables_source(numbers),
        },
    )


def write_fmu(unit: Unit, deployment: Deployment, out: Path) -> str:
    """Write a unit into a new or empty folder, with a binary where a compiler works here.

    Returns:
        A line for the user: the platform of its binary, or why it has none.

    Raises:
        ConfigError, UsageError: see ``check_exported``.
    """
    check_exported(deployment, out)
    name = f"canshaper_{unit.kind}"
    sources = {one.name: one.read_text(encoding="utf-8") for one in FMU_FILES.glob("cs_fmu.*")}
    sources |= unit.sources
    starts = ", ".join(float(one.start).hex() for one in (*unit.inputs, *unit.outputs))
    sizes = f"""\
#define CS_UNIT_TICK_NS {deployment.config.tick_ms * 1_000_000}
#define CS_UNIT_INPUTS {len(unit.inputs)}
#define CS_UNIT_VALUES {1 + len(unit.inputs) + len(unit.outputs)}
#define CS_UNIT_START {{0.0, {starts}}}
{unit.header}"""
    made_of = [sizes, *(f"{key}\n{sources[key]}" for key in sorted(sources))]
    token = hashlib.sha256("\n".join(made_of).encode()).hexdigest()
    sources["cs_unit.h"] = f'#define CS_UNIT_TOKEN "{token}"\n{sizes}'
    compiled = [key for key in sorted(sources) if key.endswith(".c")]
    listed = "".join(f'<SourceFile name="{key}"/>' for key in compiled)
    files: dict[str, str | bytes] = {
        "modelDescription.xml": _model_description(unit, deployment, name, token),
        "sources/buildDescription.xml": _BUILD.format(
            name=name, flags=" ".join(FLAGS), files=listed
        ),
        **{f"sources/{key}": text for key, text in sources.items()},
    }
    out.mkdir(parents=True, exist_ok=True)
    path, target = out / f"{unit.kind}.fmu", f"{platform.machine()}-{sys.platform}"
    with tempfile.TemporaryDirectory() as folder:
        for key, text in sources.items():
            Path(folder, key).write_text(text, encoding="utf-8")
        library = Path(folder, "unit.so")
        try:
            if sys.platform != "linux":
                raise NativeError("expected Linux to compile one here")
            compile_library((Path(folder, key) for key in compiled), library, "-fvisibility=hidden")
            files[f"binaries/{target}/{name}.so"] = library.read_bytes()
            said = f"with a binary for {target}"
        except NativeError as error:
            said = f"without a binary, its sources are to be compiled: {error}"
    with zipfile.ZipFile(path, "w") as archive:
        for key, content in files.items():  # without times: the same machine gives the same file
            archive.writestr(zipfile.ZipInfo(key), content, zipfile.ZIP_DEFLATED)
    return f"{path}: FMI 3.0, co-simulation, {unit.kind}, {said}"


def _model_description(unit: Unit, deployment: Deployment, name: str, token: str) -> str:
    elements, outputs = list[str](), ""
    for number, one in enumerate((*unit.inputs, *unit.outputs), 1):
        if number > len(unit.inputs):
            outputs += f'<Output valueReference="{number}"/>'
            elements.append(one.element(number, 'causality="output" initial="exact"'))
        elif one.name:
            elements.append(one.element(number, 'causality="input"'))
    types = ""
    for kind in (State, Reason):
        items = "".join(f'<Item name="{one.name}" value="{one.value}"/>' for one in kind)
        types += f'<EnumerationType name="{kind.__name__}">{items}</EnumerationType>'
    return _MODEL.format(
        name=name,
        token=token,
        text=quoteattr("; ".join([unit.text, *deployment.identity.lines()])),
        version=version(),
        tick_s=deployment.config.tick_ms / 1000.0,
        units="".join(f'<Unit name="{one}">{text}</Unit>' for one, text in UNITS.items()),
        types=types,
        variables="\n".join(elements),
        outputs=outputs,
    )
