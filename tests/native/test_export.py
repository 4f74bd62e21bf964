"""``canshaper export``: what it writes is built by make and CMake, and tests itself."""

import json
import re
import shutil
import subprocess
import zipfile
from hashlib import sha256
from pathlib import Path

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

from canshaper.cli.common import EXIT_WRONG
from canshaper.machine.identity import program_sha256
from tests.cli.invocation import invoke
from tests.native.judge import needs_compiler
from tests.rigs.files import CONFIG, machine_file, read


def run(*arguments: str) -> tuple[int, str]:
    result = invoke("export", *arguments)
    return result.exit_code, result.output


def run_program(*command: str | Path) -> tuple[int, str]:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export") / "axis"
    code, text = run("forwarder-gff.yaml", "--out", str(folder))
    assert (code, text.splitlines()[0]) == (
        0,
        "double: equal to the controller's, in Python, to the last bit.",
    )
    return folder


def built(folder: Path, where: Path) -> Path:
    """A copy of an export that make has built without a warning, unoptimised."""
    needs_compiler()
    if shutil.which("make") is None:
        pytest.skip("expected make, got none")
    shutil.copytree(folder, where)
    flags = "CFLAGS=-O0 -Wall -Wextra -Werror -pedantic"
    code, text = run_program("make", "-s", "-C", where, flags)
    assert (code, text) == (0, "")
    return where


def test_make_builds_it_and_the_self_test_is_green(exported: Path, tmp_path: Path) -> None:
    code, text = run_program(built(exported, tmp_path / "axis") / "selftest")
    assert text == "canshaper selftest: 500 ticks equal, largest difference of a state 0\n"
    assert code == 0


def changed(folder: Path, file: str, old: str, new: str) -> None:
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("src/cs_limits.c", "cs_real out = 0; /* within", "cs_real out = 1; /* within"),
        ("src/cs_output.c", "MOST_CARRY CS_R(0.1)", "MOST_CARRY CS_R(0.11)"),  # frames as before
        ("src/cs_tables.c", ".tail = 130", ".tail = 129"),
    ],
)
def test_a_wrong_build_is_red(
    exported: Path, tmp_path: Path, file: str, old: str, new: str
) -> None:
    other = tmp_path / "other"
    shutil.copytree(exported, other)
    changed(other, file, old, new)
    code, text = run_program(built(other, tmp_path / "axis") / "selftest")
    assert re.fullmatch(r"canshaper selftest: FAILED, tick \d+ differs\n", text)
    assert code == 1


def test_another_arithmetic_is_red(exported: Path, tmp_path: Path) -> None:
    needs_compiler()
    where = tmp_path / "axis"
    shutil.copytree(exported, where)
    run_program("make", "-s", "-C", where, "CFLAGS=-O1 -ffast-math")
    assert run_program(where / "selftest") == (
        1,
        "canshaper selftest: FAILED, another arithmetic: see README.md\n",
    )


@pytest.mark.slow
def test_cmake_builds_it_too(exported: Path, tmp_path: Path) -> None:
    needs_compiler()
    if shutil.which("cmake") is None:
        pytest.skip("expected cmake, got none")
    code, text = run_program("cmake", "-S", exported, "-B", tmp_path)
    assert code == 0, text
    code, text = run_program("cmake", "--build", tmp_path)
    assert code == 0, text
    assert run_program(tmp_path / "selftest")[0] == 0


@pytest.mark.slow
def test_in_float_it_says_what_differs(tmp_path: Path) -> None:
    needs_compiler()
    folder = tmp_path / "float"
    code, text = run("forwarder-robust.yaml", "--out", str(folder), "--float")
    found = re.match(r"float: (\d+) of 1500 valve frames of the golden drive differ from", text)
    assert code == 0
    assert found
    assert 0 < int(found[1]) < 150
    assert found[0] in (folder / "README.md").read_text(encoding="utf-8").replace("`", "")
    code, text = run_program(built(folder, tmp_path / "axis") / "selftest")
    assert text == "canshaper selftest: 500 ticks equal, largest difference of a state 0\n"


def test_the_readme_names_the_deployment_and_the_program(exported: Path) -> None:
    text = (exported / "README.md").read_text(encoding="utf-8")
    assert "| near_far | 1 | 1 | NearFarCommand |" in text
    for name in ("digest=0x", "program=sha256:", "deployment=sha256:", "dbc=sha256:"):
        assert f"\n    {name}" in text


def test_the_bill_of_materials_has_every_file(exported: Path) -> None:
    text = (exported / "sbom.cdx.json").read_text(encoding="utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    hashes = {one["name"]: one["hashes"][0]["content"] for one in json.loads(text)["components"]}
    identity = read(CONFIG / "forwarder-gff.yaml").identity
    assert hashes.pop("canshaper") == program_sha256()
    assert hashes.pop("forwarder-gff.yaml") == identity.deployment
    assert [hashes.pop(name) for name in identity.dbc] == list(identity.dbc.values())
    files = {one for one in exported.rglob("*") if one.is_file()} - {exported / "sbom.cdx.json"}
    assert hashes == {
        str(one.relative_to(exported)): sha256(one.read_bytes()).hexdigest() for one in files
    }


def test_a_folder_with_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    code, text = run("forwarder.yaml", "--out", str(tmp_path))
    assert code == EXIT_WRONG
    assert text == f"--out: expected a new or empty folder, got {tmp_path}\n"
    assert [one.name for one in tmp_path.iterdir()] == ["mine"]


def test_what_c_has_no_part_for_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    out = tmp_path / "axis"
    code, text = run("forwarder-sensor.yaml", "--out", str(out))
    assert code == EXIT_WRONG
    assert "axes.slew.sway_sensor: expected none in an export" in text
    assert not out.exists()


def test_a_stop_over_a_way_that_is_not_stated_is_refused(tmp_path: Path) -> None:
    file = machine_file(tmp_path, "forwarder", (", stop_distance_m: 4.7", ""))
    code, text = run(str(file), "--out", str(tmp_path / "axis"))
    assert code == EXIT_WRONG
    assert "axes.slew.limits.stop_distance_m: missing: to stop, the limits allow" in text


@pytest.mark.parametrize(
    ("file", "options", "text"),
    [
        (
            "forwarder.yaml",
            ("--fmu", "plant", "--float"),
            "--fmu: expected controller or plant, without --float",
        ),
        ("forwarder-sensor.yaml", ("--fmu", "controller"), "axes.slew.sway_sensor: expected none"),
        ("forwarder-joints.yaml", ("--fmu", "plant"), "crane: expected one crane moved by its tip"),
    ],
)
def test_a_unit_that_c_has_no_part_for_is_refused(
    tmp_path: Path, file: str, options: tuple[str, ...], text: str
) -> None:
    code, said = run(file, "--out", str(tmp_path / "unit"), *options)
    assert code == EXIT_WRONG
    assert text in said
    assert not (tmp_path / "unit").exists()


def test_a_unit_without_a_compiler_has_its_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "absent-cc")
    code, said = run("forwarder.yaml", "--out", str(tmp_path / "unit"), "--fmu", "controller")
    assert code == 0
    assert "without a binary, its sources are to be compiled: CC: expected a C compiler" in said
    with zipfile.ZipFile(tmp_path / "unit/controller.fmu") as archive:
        names = archive.namelist()
        built = archive.read("sources/buildDescription.xml").decode()
    assert [one for one in names if one.startswith("binaries")] == []
    assert {f"sources/{one}" for one in re.findall(r'SourceFile name="(.+?)"', built)} == {
        one for one in names if one.endswith(".c")
    }
