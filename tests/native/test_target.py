"""The self-test of an export on a Cortex-M4F, emulated by QEMU: ``make test-target``."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from canshaper.native.export import FLAGS, export
from tests.native.judge import needs_compiler
from tests.rigs.files import CONFIG

CORE = "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 --specs=rdimon.specs -Os"
MACHINE = "-M mps2-an386 -nographic -monitor none -serial none -semihosting-config enable=on"
PROGRAMS = ("qemu-system-arm", "arm-none-eabi-gcc")
ABSENT = [one for one in PROGRAMS if shutil.which(one) is None]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(ABSENT), reason=f"expected {', '.join(ABSENT)}, got none"),
]


def on_target(folder: Path) -> tuple[int, str]:
    """Build an export for the target, and run its self-test there."""
    program = folder / "selftest.elf"
    sources = [Path(__file__).with_name("cortex_m4.c"), *folder.glob("*/*.c")]
    build = ["arm-none-eabi-gcc", *CORE.split(), *FLAGS.split(), "-Wl,--section-start=.vectors=0"]
    paths = [f"-I{folder}/src", f"-I{folder}/test", *map(str, sources), "-o", str(program), "-lm"]
    subprocess.run([*build, *paths], check=True)
    command = ["qemu-system-arm", *MACHINE.split(), "-kernel", str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    return done.returncode, done.stdout


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("name", ["forwarder-robust", "forwarder-gff"])
def test_it_is_green_on_the_target(name: str, single: bool, tmp_path: Path) -> None:
    if single:
        needs_compiler()
    export(load_deployment(CONFIG / f"{name}.yaml"), tmp_path / "axis", single=single)
    code, text = on_target(tmp_path / "axis")
    assert code == 0, text
    assert re.match(
        r"canshaper selftest: 500 ticks equal, largest difference of a state \S+\n", text
    )


def test_a_wrong_build_is_red_on_the_target(tmp_path: Path) -> None:
    export(load_deployment(CONFIG / "forwarder-gff.yaml"), tmp_path / "axis", single=False)
    source = tmp_path / "axis/src/cs_output.c"
    text = source.read_text(encoding="utf-8")
    source.write_text(text.replace("MOST_CARRY CS_R(0.1)", "MOST_CARRY CS_R(0.11)"))
    code, said = on_target(tmp_path / "axis")
    assert re.fullmatch(r"canshaper selftest: FAILED, tick \d+ differs\n", said)
    assert code == 1
