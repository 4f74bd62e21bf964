"""The parts of the test suite: what each runs, and what it needs of the machine."""

import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.lane.outcome import NoLane  # noqa: E402
from tests.lane.packages import cache_lock, install, missing  # noqa: E402

BIN = Path(sys.executable).parent
JOBS = os.environ.get("JOBS") or str(len(os.sched_getaffinity(0)))
SPREAD = ("-n", JOBS, "--dist", "loadfile")
# Rooms of what decides whether a valve moves.
GATE = "codec machine shaping inputs gate promises bus protocols controller daemon"
COUNTED = re.compile(r"(\d+) (passed|failed|skipped|error)")
SKIPPED = re.compile(r"^SKIPPED \[(\d+)\] [^ ]+ (.+)$")
FAILED = re.compile(r"^(FAILED|ERROR) ")

Command = list[str]


def pytest(*arguments: str) -> Command:
    """Return the command of pytest; without a path, on all tests but kernel and browser."""
    paths = [] if any(word.startswith("tests/") for word in arguments) else ["tests", "studies"]
    ignored = ["--ignore=tests/hil", "--ignore=tests/systemd"]
    ignored = [*ignored, "--ignore-glob=*/test_browser*.py"] if paths else []
    return [sys.executable, "-m", "pytest", "-q", *arguments, *ignored, *paths]


def hil(names: str, *arguments: str) -> Command:
    """Return the command that runs tests/hil/test_NAME.py where a busy host makes nothing late."""
    files = [f"tests/hil/test_{name}.py" for name in names.split()]
    return [sys.executable, "-m", "tests.lane.hil", "--steady", "-q", *arguments, *files]


def browser(*arguments: str) -> Command:
    """Return the command that runs the tests of the live page in Chromium."""
    files = sorted((ROOT / "tests/studio").glob("test_browser*.py"))
    return pytest(*arguments, *(str(file.relative_to(ROOT)) for file in files))


def no_lane() -> str | None:
    """Prepare a kernel with SocketCAN, this or an emulated one; return why not, None if done."""
    command = [sys.executable, "-m", "tests.lane", "--prepare"]
    done = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, check=False)
    print(done.stderr, end="", flush=True)
    return done.stderr.strip().split("\n")[-1].removeprefix("lane: ") if done.returncode else None


def _no_program(tools: dict[str, str]) -> str | None:
    """Install absent programs (program -> Debian package); return why not, or None if they are."""
    try:
        with cache_lock():
            install(missing(tools))
    except NoLane as error:
        return str(error)
    return None


def no_chromium() -> str | None:
    """Install Chromium where it is absent; return why not, or None if it is there."""
    return _no_program({"chromium": "chromium"})


def no_target() -> str | None:
    """Install compiler and emulator of a Cortex-M; return why not, or None if they are there."""
    tools = {"qemu-system-arm": "qemu-system-arm", "arm-none-eabi-gcc": "gcc-arm-none-eabi"}
    if not NEWLIB.exists():  # the compiler's package only recommends it
        tools["its C library"] = "libnewlib-arm-none-eabi"
    return _no_program(tools)


FOREIGN = BIN.parent / "foreign"
NEWLIB = Path("/usr/lib/arm-none-eabi/newlib")


def no_foreign() -> str | None:
    """Install what reads MF4, FMU and MCAP into .venv/foreign; return why not, or None if done.

    Wherever python-can finds asammdf, every start takes a third of a second more.
    """
    names = ["asammdf", "fmpy>=0.3.20", "foxglove-sdk"]
    if (FOREIGN / "fmpy").is_dir():
        return None
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--target", str(FOREIGN), *names]
    done = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, check=False)
    return done.stderr.strip().split("\n")[-1] if done.returncode else None


@dataclass
class Part:
    """Commands that belong together, and what became of them.

    ``absent`` prepares what the part needs and returns why that cannot be had here, or None.
    """

    name: str
    shows: str
    commands: Sequence[Command]
    absent: Callable[[], str | None] = lambda: None
    environment: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    status: int | None = None
    not_run: str | None = None
    counts: Counter[str] = field(default_factory=Counter)
    skipped: Counter[str] = field(default_factory=Counter)
    failed: list[str] = field(default_factory=list)

    @property
    def result(self) -> str:
        """The word of the table: ok, FAILED, not run, not ended."""
        if self.not_run is not None:
            return "not run"
        return "not ended" if self.status is None else "FAILED" if self.status else "ok"

    def note(self, line: str) -> None:
        """Count what a line of pytest says: sums, a failed test, skipped ones with their reason."""
        if skipped := SKIPPED.match(line):
            self.skipped[skipped[2].partition(": ")[2] or skipped[2]] += int(skipped[1])
        elif FAILED.match(line):
            self.failed.append(line)
        elif re.search(r" in [\d.]+s\b", line):  # the last line of pytest
            self.counts.update({word: int(number) for number, word in COUNTED.findall(line)})


WINDOW = {"CANSHAPER_BROWSER": "1"}
TOGETHER = "socketcan daemon closed_loop doctor"
MACHINES = (
    "j1939 j1939_read canopen canopen_shipped canfd calibrate gateway gateway_rules commission"
)
FAULTS = "faults process_faults interface_faults lying_buses"


def rows_of_test() -> list[list[Part]]:
    """Return what `make test` runs, in order; the parts of a row run side by side."""
    style = [[f"{BIN}/ruff", "check"], [f"{BIN}/ruff", "format", "--check"]]
    repeatable = "--hypothesis-profile=repeatable"
    fast = pytest(*SPREAD, "--budget", repeatable, "-m", "not slow and not study")
    few = browser("--budget", "-m", "not slow")
    kernel = hil("socketcan daemon", "-m", "not slow")
    return [
        [Part("lint", "style and format", style)],
        [
            Part("fast", "all tests of less than a second of a processor", [fast]),
            Part(
                "socketcan", "ports and a drive of the daemon on a real kernel", [kernel], no_lane
            ),
        ],
        [Part("browser", "the live page in Chromium", [few], no_chromium, WINDOW)],
    ]


def rows_of_more() -> list[list[Part]]:
    """Return what `make test-all` runs besides, in order."""
    types = [[f"{BIN}/mypy"], [f"{BIN}/lint-imports"]]
    gate = [f"tests/{room}" for room in GATE.split()]
    few = "--hypothesis-profile=few"  # lines need no more
    cover = [pytest(*SPREAD, few, "-m", "not slow", "--cov", "--cov-report=term", *gate)]
    core = [[sys.executable, "tools/mutation.py", f"-j{JOBS}", "core"]]
    service = [[sys.executable, "-m", "tests.lane.services", "-q"]]
    slow = pytest(
        *SPREAD,
        "-m",
        "slow and not study",
        "--ignore=tests/proof",
        "--ignore=tests/native/test_target.py",
    )
    study = pytest(*SPREAD, "-m", "study")
    proof = pytest(*SPREAD, "tests/proof")
    apart = {"PYTHONPATH": str(FOREIGN)}
    of = ("recording/test_mcap", "recording/test_mf4", "native/test_fmu", "campaign/test_unit")
    files = [f"tests/{one}.py" for one in of]
    return [
        [Part("types", "mypy, import contracts", types)],
        [Part("coverage", "every line and branch of what decides whether a valve moves", cover)],
        [Part("mutation-core", "a test notices every small change of the core", core)],
        [Part("proof", "rules of the gate, for all numbers", [proof])],
        [Part("slow", "tests of a second and more", [slow])],
        [
            Part(
                "target",
                "self-test of an export on an emulated Cortex-M4F",
                [pytest("-s", "tests/native/test_target.py")],
                no_target,
            )
        ],
        [Part("exports", "MCAP, MF4, FMI by others", [pytest(*files)], no_foreign, apart)],
        [
            Part(
                "socketcan-all",
                "daemon, closed loop, doctor on a real kernel",
                [hil(TOGETHER)],
                no_lane,
            ),
            Part(
                "browser-all", "the whole live page in Chromium", [browser()], no_chromium, WINDOW
            ),
        ],
        [
            Part("machines", "foreign nodes and tools, CAN FD, gateway", [hil(MACHINES)], no_lane),
            Part(
                "faults", "every fault of docs/safety.md on a real kernel", [hil(FAULTS)], no_lane
            ),
        ],
        [Part("service", "the Debian package under a real systemd", service, no_lane)],
        [Part("studies", "every seed of noise, every instant of a fault", [study])],
    ]
