"""The C computes as the controller does: frames and inner states equal to the last bit."""

import platform
import subprocess
import sys
from pathlib import Path

import pytest

from canshaper.errors import NativeError
from canshaper.native.library import NativeController, NativeLibrary
from canshaper.shaping.states import REACTION_OF, Reaction, Reason
from tests.native.judge import SeenStates, difference, native, needs_compiler, shipped
from tests.native.machines import SHIPPED, VARIANTS, changed
from tests.rigs.files import CONFIG, ROOT, Machine, read

STATES = {"NEUTRAL_WAIT", "READY", "ACTIVE", "BYPASS_ON", "STOPPING", "TRIPPED"}


def check_seen(seen: SeenStates) -> None:
    """The drive was no idle one."""
    assert {state for state, _ in seen} == STATES
    reactions = {REACTION_OF[Reason[reason]] for _, reason in seen}
    assert reactions == {*Reaction}


@pytest.mark.parametrize("seed", ["first", "second"])
@pytest.mark.parametrize("name", SHIPPED)
def test_the_c_is_the_controller_for_a_shipped_machine(name: str, seed: str) -> None:
    """30 000 ticks in all."""
    c = NativeController(shipped(name))
    wrong, seen = difference(read(CONFIG / f"{name}.yaml"), c, seed, 3_750)
    assert wrong == ""
    check_seen(seen)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_it_is_so_in_a_long_drive_behind_the_gate(name: str) -> None:
    c = NativeController(shipped(name))
    wrong, _ = difference(read(CONFIG / f"{name}.yaml"), c, "long", 100_000, gated=True)
    assert wrong == ""


@pytest.mark.study
@pytest.mark.parametrize("name", SHIPPED)
def test_it_is_so_in_ten_million_ticks(name: str) -> None:
    """All machines share them; half an hour of a processor."""
    c, ticks = NativeController(shipped(name)), -(-10_000_000 // len(SHIPPED))
    assert difference(read(CONFIG / f"{name}.yaml"), c, "ten million", ticks)[0] == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", VARIANTS)
def test_the_c_is_the_controller_for_every_part(name: str, machine: Machine) -> None:
    deployment = changed(machine, VARIANTS[name]).load()
    wrong, seen = difference(deployment, native(deployment), name, 10_000, gated=True)
    assert wrong == ""
    check_seen(seen)


@pytest.mark.parametrize("name", ["motorola", "periods"])
def test_it_is_so_with_fields_and_periods_of_every_kind(name: str, machine: Machine) -> None:
    deployment = changed(machine, VARIANTS[name]).load()
    assert difference(deployment, native(deployment, "-O0"), "few", 800)[0] == ""


@pytest.mark.skipif(
    "fma" not in Path("/proc/cpuinfo").read_text(encoding="utf-8").split(),
    reason="the processor has no FMA",
)
def test_a_build_that_contracts_is_refused() -> None:
    """Products that keep their digits: a processor with FMA, whose compiler may use it."""
    needs_compiler()
    with pytest.raises(NativeError, match="expected arithmetic as Python's, got another one"):
        NativeLibrary(read(CONFIG / "forwarder.yaml"), "-mfma", "-ffp-contract=fast")


FLUSHED = """
__attribute__((constructor)) static void flush(void)
{ __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040u); }
"""


@pytest.mark.parametrize("more", ["-ffast-math", "-funsafe-math-optimizations", FLUSHED])
def test_a_build_with_quick_arithmetic_is_refused(more: str, tmp_path: Path) -> None:
    """By its flags, or by a target that rounds small numbers to 0."""
    needs_compiler()
    if more is FLUSHED:
        if platform.machine() != "x86_64":
            pytest.skip("expected x86-64, got another processor")
        (tmp_path / "flushed.c").write_text(FLUSHED, encoding="ascii")
        more = str(tmp_path / "flushed.c")
    # In a process of its own: once loaded, it rounds subnormal numbers to 0 everywhere.
    code = f"""
from canshaper.native.library import NativeLibrary
from tests.rigs.files import CONFIG, read
NativeLibrary(read(CONFIG / "forwarder.yaml"), {more!r})"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert "expected arithmetic as Python's, got another one" in done.stderr


def test_what_the_compiler_says_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    needs_compiler()
    with pytest.raises(NativeError, match=r"failed: .*no-such-flag"):
        NativeLibrary(read(CONFIG / "forwarder.yaml"), "-fno-such-flag")
