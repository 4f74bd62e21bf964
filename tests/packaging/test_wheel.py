"""The wheel: made by the source distribution as by the tree, the same twice, complete by itself."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path
from urllib.request import urlopen

import pytest

from canshaper.cli.app import Verbs
from tests.packaging.conftest import ROOT

pytestmark = pytest.mark.processes


def hatch(tree: Path, target: str, directory: Path) -> Path:
    """Files of one build."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(directory)]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
    subprocess.run(command, cwd=tree, check=True, capture_output=True, env=environment)
    (file,) = directory.iterdir()
    return file


@pytest.fixture(scope="module")
def sdist(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    man = [sys.executable, str(ROOT / "tools" / "man.py"), str(ROOT / "out" / "man")]
    subprocess.run(man, check=True)
    return hatch(ROOT, "sdist", tmp_path_factory.mktemp("sdist"))


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made from the source distribution, without a repository."""
    tree = tmp_path_factory.mktemp("tree")
    subprocess.run(["tar", "-xf", str(sdist), "-C", str(tree)], check=True)
    (inside,) = tree.iterdir()
    return hatch(inside, "wheel", tmp_path_factory.mktemp("wheel"))


@pytest.mark.slow
def test_the_tree_gives_the_same_bytes(sdist: Path, wheel: Path, tmp_path: Path) -> None:
    assert hatch(ROOT, "sdist", tmp_path / "sdist").read_bytes() == sdist.read_bytes()
    assert hatch(ROOT, "wheel", tmp_path / "wheel").read_bytes() == wheel.read_bytes()


@pytest.mark.slow
def test_the_wheel_has_pages_manuals_and_licences(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert "canshaper/data/site/index.html" in names
    assert "canshaper/native/c/src/canshaper.h" in names
    assert "canshaper/native/fmu/cs_fmu.c" in names
    manuals = {name.rpartition("/")[2] for name in names if "/share/man/man1/" in name}
    verbs = Verbs(name="canshaper").list_commands(None)
    assert manuals == {"canshaper.1", *(f"canshaper-{verb}.1" for verb in verbs)}
    licences = [name for name in names if ".dist-info/licenses/" in name]
    of = ("/LICENSE", "/three.LICENSE", "/uplot.LICENSE", "/iframe-worker.LICENSE")
    assert all(any(name.endswith(one) for name in licences) for one in of)


@pytest.mark.slow
def test_it_runs_without_the_repository(wheel: Path, tmp_path: Path) -> None:
    """In an empty directory; what it depends on is that of these tests."""
    library, empty = tmp_path / "library", tmp_path / "empty"
    zipfile.ZipFile(wheel).extractall(library)
    empty.mkdir()
    environment = {**os.environ, "PYTHONPATH": str(library)}
    begin = [sys.executable, "-um", "canshaper"]

    def run(*words: str) -> str:
        done = subprocess.run(
            [*begin, *words],
            cwd=empty,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "residual sway, deg" in run("demo", "--lockstep")
    assert (empty / "out" / "demo" / "report.json").exists()
    assert "Serve a page" in run("studio", "--help")
    assert "good" in run("check", "two-cranes.yaml")
    with subprocess.Popen(
        [*begin, "docs", "--port", "0"],
        cwd=empty,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            url = process.stdout.readline().split()[1]
            where = process.stdout.readline().rpartition(" ")[2].strip()
            assert Path(where).is_relative_to(library)
            with urlopen(f"{url}docs/guide.html") as page:
                assert b"From a new machine to a calm grapple" in page.read()
            process.terminate()  # a shell's background job has Ctrl-C ignored
            process.wait()
        finally:
            process.kill()
