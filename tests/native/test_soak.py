"""Random ticks without Python: nothing undefined, and every build of every processor the same."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from canshaper.native.library import C_FILES, FMU_FILES, sizes_source, tables_source
from canshaper.native.tables import tables
from tests.rigs.files import CONFIG, read

SOAK = Path(__file__).with_name("soak.c")
FLAGS = ("-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-g", "-fsanitize=address,undefined,float-cast-overflow,float-divide-by-zero")
BUILDS = {
    "x86-64, gcc": (("gcc", "-O2"), ()),
    "not optimised": (("gcc", "-O0"), ()),
    "for this processor": (("gcc", "-O3", "-march=native"), ()),
    "clang": (("clang", "-O2"), ()),
    "arm64": (("aarch64-linux-gnu-gcc", "-O2", "-static"), ("qemu-aarch64-static",)),
}


def needs(*programs: str) -> None:
    """Skip the test where one of them is not here."""
    if missing := [one for one in programs if shutil.which(one) is None]:
        pytest.skip(f"expected {', '.join(missing)}, got none")


def built(name: str, folder: Path, *command: str, float_: bool = False) -> Path:
    """Build the drive with the tables of a shipped deployment."""
    numbers = tables(read(CONFIG / f"{name}.yaml"))
    (folder / "cs_sizes.h").write_text(sizes_source(numbers), encoding="ascii")
    (folder / "cs_tables.c").write_text(tables_source(numbers), encoding="ascii")
    places = [f"-I{folder}", f"-I{C_FILES}/src", f"-I{C_FILES}/test", f"-I{FMU_FILES}"]
    files = [*(C_FILES / "src").glob("*.c"), C_FILES / "test/cs_inspect.c", SOAK]
    files.append(folder / "cs_tables.c")
    done = folder / command[0]
    flags = [*FLAGS, *(["-DCS_FLOAT"] if float_ else [])]
    subprocess.run([*command, *flags, *places, *files, "-o", done, "-lm"], check=True)
    return done


def driven(ticks: int, seed: int, *command: str | Path) -> str:
    """Drive, and return what it prints: that every state was seen, and nothing undefined."""
    done = subprocess.run(
        [*command, str(ticks), str(seed)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("seen 3f\n")
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", ["forwarder-robust", "forwarder-joints", "multicopter"])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("float_", [False, True])
def test_nothing_hostile_is_undefined(
    name: str, compiler: str, float_: bool, tmp_path: Path
) -> None:
    """Any bits, lengths, ids, times and missed ticks, under the sanitizers."""
    needs(compiler)
    driven(200_000, 1, built(name, tmp_path, compiler, "-O2", *SANITIZED, float_=float_))


@pytest.mark.study
def test_every_build_drives_the_same(tmp_path: Path) -> None:
    """``SOAK_TICKS`` of them, 10^7 by itself: frames and states, to the last bit."""
    ticks, seen = int(os.environ.get("SOAK_TICKS", "10000000")), {}
    for name, (command, emulator) in BUILDS.items():
        if all(map(shutil.which, (command[0], *emulator))):
            (folder := tmp_path / name).mkdir()
            program = built("forwarder-robust", folder, *command)
            seen[name] = driven(ticks, 1, *emulator, program)
        else:
            print(f"{name}: not here")
    print(f"{ticks} ticks of {', '.join(seen)}: {seen}")
    assert len(seen) > 1, "expected two builds or more"
    assert len({*seen.values()}) == 1
