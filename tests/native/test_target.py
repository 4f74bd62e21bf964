"""The self-test of an export on a Cortex-M4F, emulated by QEMU: ``make test-target``.

It prints what docs/export.md has of it. An instruction is no cycle: a real one waits for its flash.
"""

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
COUNTED = "-Wl,--wrap=cs_receive,--wrap=cs_tick,--wrap=cs_selftest,--section-start=.vectors=0"
PROGRAMS = ("qemu-system-arm", "arm-none-eabi-gcc", "arm-none-eabi-size")
MOST_CODE, MOST_STATE = 20_000, 8_000  # bytes
ABSENT = [one for one in PROGRAMS if shutil.which(one) is None]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(ABSENT), reason=f"expected {', '.join(ABSENT)}, got none"),
]


def on_target(folder: Path) -> tuple[int, str]:
    """Build an export for the target, and run its self-test there."""
    program = folder / "selftest.elf"
    sources = [Path(__file__).with_name("cortex_m4.c"), *folder.glob("*/*.c")]
    build = ["arm-none-eabi-gcc", *CORE.split(), *FLAGS.split(), f"-I{folder}/src"]
    paths = [f"-I{folder}/test", *map(str, sources), "-o", str(program), "-lm"]
    subprocess.run([*build, COUNTED, *paths], check=True)
    command = ["qemu-system-arm", *MACHINE.split(), "-icount", "shift=0", "-kernel", str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    return done.returncode, done.stdout


def code_bytes(folder: Path) -> int:
    """Code and tables of an export for the target, without its C library."""
    build = ["arm-none-eabi-gcc", *CORE.split(), *FLAGS.split(), "-c", *folder.glob("src/*.c")]
    subprocess.run(build, check=True, cwd=folder)
    size = ["arm-none-eabi-size", "-t", *folder.glob("*.o")]
    return int(subprocess.run(size, capture_output=True, text=True, check=True).stdout.split()[-6])


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("name", ["forwarder-robust", "forwarder-gff"])
def test_it_is_green_on_the_target(name: str, single: bool, tmp_path: Path) -> None:
    if single:
        needs_compiler()
    export(load_deployment(CONFIG / f"{name}.yaml"), tmp_path / "axis", single=single)
    code, text = on_target(tmp_path / "axis")
    assert code == 0, text
    counted, said = text.splitlines()
    assert re.fullmatch(
        r"canshaper selftest: 500 ticks equal, largest difference of a \S+ \S+", said
    )
    bytes_ = code_bytes(tmp_path / "axis")
    print(f"\n{name}{' --float' * single}: code and tables {bytes_} bytes, {counted}")
    assert bytes_ <= MOST_CODE
    assert 0 < int(counted.split()[1]) <= MOST_STATE


def test_a_wrong_build_is_red_on_the_target(tmp_path: Path) -> None:
    export(load_deployment(CONFIG / "forwarder-gff.yaml"), tmp_path / "axis", single=False)
    source = tmp_path / "axis/src/cs_output.c"
    text = source.read_text(encoding="utf-8")
    source.write_text(text.replace("MOST_CARRY CS_R(0.1)", "MOST_CARRY CS_R(0.11)"))
    code, said = on_target(tmp_path / "axis")
    assert re.search(r"\ncanshaper selftest: FAILED, tick \d+ differs\n$", said)
    assert code == 1
