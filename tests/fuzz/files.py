"""Deployment and DBC files of any content: a deployment that works, or every reason why not."""

import re
from pathlib import Path

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.files import ROOT

SHIPPED = ("forwarder", "forwarder-robust", "forwarder-joints")
SMALL = "small"

# What the parser of DBC files says without a place.
_NO_PLACE = "not a DBC file that can be used"
# What ends a line for YAML, which counts them so.
_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")


class Files:
    """A deployment file and a DBC file in a directory, written again for every try."""

    def __init__(self, directory: Path) -> None:
        self.yaml = directory / "machine.yaml"
        self.dbc = directory / "machine.dbc"

    def load(self, yaml: bytes, dbc: bytes) -> Deployment | None:
        """Load and, where that goes well, run; None where there are problems, well reported.

        Raises:
            Exception: anything but a ``ConfigError`` with proper problems is a fault.
        """
        self.yaml.write_bytes(yaml)
        self.dbc.write_bytes(dbc)
        try:
            deployment = load_deployment(self.yaml)
        except ConfigError as error:
            self._check(error)
            return None
        runs(deployment)
        return deployment

    def _check(self, error: ConfigError) -> None:
        """Every problem has words, a file that is there, and the line where there is one."""
        assert error.problems
        assert str(error).splitlines()
        for problem in error.problems:
            assert problem.message.strip(), problem
            assert "\n" not in str(problem), problem
            path = Path(problem.file)
            assert path in (self.yaml, self.dbc), problem
            rows = len(_BREAK.findall(path.read_text(encoding="utf-8", errors="replace"))) + 1
            if problem.line is not None:
                assert 1 <= problem.line <= rows + 1, (problem, rows)
            elif path.read_bytes().strip():
                # A file without any key has no line in which one is missing.
                top = problem.message.startswith("missing: ") and "." not in problem.where
                assert top or _NO_PLACE in problem.message, problem


def runs(deployment: Deployment) -> None:
    """A deployment that was accepted has to work: ticks, all its inputs, its last frames."""
    controller = Controller(deployment)
    now_ns = 0
    tick_ns = deployment.config.tick_ms * 1_000_000
    messages = {joystick.key: joystick.message for joystick in deployment.joysticks.values()}
    if stop := deployment.emergency_stop:
        messages[stop.key] = stop.message
    for motion in deployment.motions.values():
        if motion.radius:
            messages[motion.radius.key] = motion.radius.message
    for data in (0x00, 0xFF, 0x55, 0x01):
        for key, message in messages.items():
            controller.receive(Frame(*key, bytes([data]) * message.length), now_ns)
            controller.receive(Frame(*key, b""), now_ns)
        for frame in controller.tick(now_ns):
            assert len(frame.data) <= 8
            assert frame.bus in deployment.config.buses
        now_ns += tick_ns
    list(controller.tick(now_ns, missed=3))
    controller.stalled()
    list(controller.tick(now_ns + tick_ns))
    for frame in controller.neutral_frames():
        controller.send_failed(frame)


def texts(name: str) -> tuple[str, str]:
    """Texts of a deployment, which names machine.dbc, and of its DBC file."""
    if name == SMALL:
        here = Path(__file__).with_name(SMALL)
        return here.with_suffix(".yaml").read_text(), here.with_suffix(".dbc").read_text()
    yaml = (ROOT / "config" / f"{name}.yaml").read_text(encoding="utf-8")
    dbc = "forwarder-joints" if name == "forwarder-joints" else "forwarder"
    assert f"../dbc/{dbc}.dbc" in yaml
    text = (ROOT / "dbc" / f"{dbc}.dbc").read_text(encoding="cp1252")
    return yaml.replace(f"../dbc/{dbc}.dbc", "machine.dbc"), text
