"""A checksum that a package adds by one file: a CRC of 16 bits over the CAN id, as in the docs."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest
from crccheck.crc import Crc16AugCcitt

from tests.rigs.files import ROOT

pytestmark = pytest.mark.processes

EXAMPLE = ROOT / "examples" / "own_checksum"
PAGE = (ROOT / "docs" / "checksums.md").read_text(encoding="utf-8")
COUNTER = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
# In the joystick of Motorola, in the valve of Intel, which has room behind its two bytes.
IN_JOYSTICK = ' SG_ Check : 47|16@0+ (1,0) [0|65535] "" SHAPER\n'
VALVE = "BO_ 512 SlewCommand: 2 SHAPER\n"
IN_VALVE = ' SG_ Check : 16|16@1+ (1,0) [0|65535] "" VALVES\n'
CHECKSUM = "checksum: { signal: Check, kind: crc16_id }"
LEFT = "message: JoystickLeft\n"

# The drive of a process of its own, which prints what was seen on the bus.
DRIVE = """
import json, sys
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import random_script
from pathlib import Path

deployment = load_deployment(Path(sys.argv[1]))
script = random_script(1)
tip = drive(deployment, script).axes["slew"]
controller, hand = Controller(deployment), JoystickNode(deployment, script)
frames, faults = [], []
for time_ms in range(0, 4000, 20):
    now_ns = time_ms * 1_000_000
    for frame in hand.frames(time_ms):
        if frame.can_id == 0x110 and time_ms >= 2000:
            wrong = frame.data[:6] + bytes((frame.data[6] ^ 1,)) + frame.data[7:]
            controller.receive(frame._replace(data=wrong), now_ns)
            faults.append(int(controller.counters.last_fault))
        else:
            controller.receive(frame, now_ns)
            frames.append((frame.can_id, frame.data.hex()))
    frames += [(frame.can_id, frame.data.hex()) for frame in controller.tick(now_ns)]
print(json.dumps({"speed": max(map(abs, tip.speed)), "frames": frames, "faults": faults,
                  "reason": controller.axes["slew"].axis.reason.name}))
"""


class Installed:
    """Packages in a directory of PYTHONPATH, and a machine with a checksum of theirs."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.site = folder, folder / "site"
        self.site.mkdir()
        self.program = (EXAMPLE / "acme_checksum.py").read_text(encoding="utf-8")
        points = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
        rows = re.search(r"\[project\.entry-points.*?\n\n", points, re.DOTALL)
        assert rows
        self.entry_points = rows[0].replace('project.entry-points."', "")
        self.entry_points = self.entry_points.replace('"]', "]").replace('"', "")

    def package(self, name: str = "acme-can", entry_points: str = "") -> None:
        info = self.site / f"{name.replace('-', '_')}-1.5.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
        (info / "entry_points.txt").write_text(entry_points or self.entry_points)
        (self.site / "acme_checksum.py").write_text(self.program)

    def machine(self, name: str = "forwarder.yaml", *changes: tuple[str, str]) -> Path:
        text = (ROOT / "config" / name).read_text().replace("../dbc/forwarder.dbc", "machine.dbc")
        for old, new in [(LEFT, f"{LEFT}    {CHECKSUM}\n"), *changes]:
            assert old in text, old
            text = text.replace(old, new, 1)
        dbc = (ROOT / "dbc" / "forwarder.dbc").read_text("cp1252")
        dbc = dbc.replace(COUNTER, COUNTER + IN_JOYSTICK, 1)
        dbc = dbc.replace(VALVE, VALVE.replace(": 2", ": 4") + IN_VALVE)
        (self.folder / "machine.dbc").write_text(dbc, "cp1252")
        (self.folder / "machine.yaml").write_text(text)
        return self.folder / "machine.yaml"

    def python(self, *arguments: object, code: int = 0) -> str:
        path = os.pathsep.join((str(self.site), str(ROOT / "sim"), str(ROOT)))
        done = subprocess.run(
            [sys.executable, *map(str, arguments)],
            env={**os.environ, "PYTHONPATH": path}, cwd=self.folder, check=False,
            capture_output=True, text=True, timeout=300,
        )  # fmt: skip
        assert done.returncode == code, done.stdout + done.stderr
        assert "Traceback" not in done.stderr
        return done.stdout + done.stderr

    def canshaper(self, *arguments: object, code: int = 0) -> str:
        return self.python("-m", "canshaper", *arguments, code=code)


@pytest.fixture
def installed(tmp_path: Path) -> Installed:
    return Installed(tmp_path)


IN_SLEW = (
    "message: SlewCommand, signal: Velocity,",
    f"message: SlewCommand, signal: Velocity, {CHECKSUM},",
)


@pytest.mark.slow
def test_a_machine_drives_by_it(installed: Installed) -> None:
    installed.package()
    file = installed.machine("forwarder.yaml", IN_SLEW)
    checked = installed.canshaper("check", file)
    program = sha256(installed.program.encode()).hexdigest()
    assert f"{file}: good" in checked
    assert "the gate does not know the checksum of left, the valve of slew: it" in checked
    assert f"checksum=sha256:{program} kind=crc16_id package=acme-can 1.5" in checked
    seen = json.loads(installed.python("-c", DRIVE, file))
    assert seen["speed"] > 0.3
    for can_id, text in seen["frames"]:
        data, number = bytes.fromhex(text), can_id.to_bytes(4, "big")
        if can_id == 0x110:
            assert data[5:7] == Crc16AugCcitt.calc(data[:5] + data[7:] + number).to_bytes(2, "big")
        elif can_id == 0x200:
            assert data[2:] == Crc16AugCcitt.calc(data[:2] + number).to_bytes(2, "little")
    assert {0x110, 0x200} <= {can_id for can_id, _ in seen["frames"]}
    assert seen["faults"] == [8] * 100  # CHECKSUM
    assert seen["reason"] == "JOYSTICK_UNTRUSTED"


@pytest.mark.slow
def test_schema_and_table_have_it(installed: Installed) -> None:
    installed.package()
    schema = json.loads(installed.canshaper("config-schema"))
    assert schema["$defs"]["Checksum"]["properties"]["kind"]["enum"][-1] == "crc16_id"
    rows = installed.canshaper("config-schema", "--checksums").splitlines()
    assert "\n".join(rows[:-1]) in PAGE
    assert rows[-1].startswith("| `crc16_id` | 16 | CRC 0x1021, start 0x1D0F")
    assert rows[-1].endswith("| no |")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["check", "gateway"])
def test_the_kernel_is_not_left_alone_with_it(installed: Installed, command: str) -> None:
    installed.package()
    file = installed.machine(
        "gateway-forwarder.yaml",
        *((f"signal: {s}, timeout_ms", f"signal: {s}, {CHECKSUM}, timeout_ms") for s in JOYSTICKS),
    )
    line = [row.strip()[:8] for row in file.read_text().splitlines()].index("fallback") + 1
    says = f"{file}:{line}: gateway.fallback: expected stop or pass, got neutral:"
    says += " can-gw of the kernel knows no checksum"
    output = installed.canshaper(command, file, code=2)
    assert f"{says} of the kind crc16_id, which JoystickLeft has\n" in output
    file.write_text(file.read_text().replace("fallback: neutral", "fallback: stop"))
    assert "good" in installed.canshaper("check", file)


JOYSTICKS = ("Slew", "NearFar")
Change = Callable[[Installed], None]


def broken(installed: Installed) -> None:
    installed.program = 'raise RuntimeError("no licence\\nfor this PC")\n'
    installed.package()


def two_packages(installed: Installed) -> None:
    installed.package()
    installed.package("other-can")


def ours(installed: Installed) -> None:
    installed.package(entry_points=installed.entry_points.replace("crc16_id =", "crc8_sae_j1850 ="))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "kind", "says"),
    [
        (broken, "crc16_id", "'crc16_id' of the package acme-can 1.5 cannot be loaded:"
         " RuntimeError: no licence for this PC"),
        (two_packages, "crc16_id", "expected one package with the checksum 'crc16_id', got acme-can"
         " 1.5 and other-can 1.5"),
        (ours, "crc8_sae_j1850", "expected one package with the checksum 'crc8_sae_j1850', got"
         " canshaper and acme-can 1.5"),
        (lambda _: None, "crc16_id", "expected one of 'xor', 'sum', 'crc8_sae_j1850',"
         " 'crc8_autosar', 'sum_id', 'sum_length', 'sum4', 'crc16_ccitt_false' or 'crc16_arc',"
         " got 'crc16_id'"),
    ],
)  # fmt: skip
def test_a_package_that_is_wrong_is_one_line_of_the_file(
    installed: Installed, change: Change, kind: str, says: str
) -> None:
    change(installed)
    file = installed.machine("forwarder.yaml", ("kind: crc16_id", f"kind: {kind}"))
    line = next(i for i, row in enumerate(file.read_text().splitlines(), 1) if "kind:" in row)
    output = installed.canshaper("check", file, code=2)
    assert output == f"{file}:{line}: joysticks.left.checksum.kind: {says}\n1 problem\n"
    if change in (broken, two_packages):
        assert installed.canshaper("config-schema", "--checksums", code=2) == f"{says}\n"
