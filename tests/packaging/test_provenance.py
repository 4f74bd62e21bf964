"""Sources of a package: exact versions with hashes, vendored files with theirs, a bill."""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from hashlib import sha256
from pathlib import Path

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
VENDOR = ROOT / "canshaper" / "studio" / "static" / "vendor"
LOCKS = ("deb/requirements.txt", "deb/build-requirements.txt", "image/requirements.txt")
PIN = re.compile(r"^([a-z0-9-]+)(?:\[[a-z,-]+\])?==(\S+) \\$")
HASH = re.compile(r"^    --hash=sha256:[0-9a-f]{64}( \\)?$")


def pins(name: str) -> dict[str, str]:
    """Version of every package of a lock; each line is a pin, a hash or a comment."""
    pins: dict[str, str] = {}
    hashes = 1
    for line in (ROOT / "tools" / name).read_text(encoding="utf-8").splitlines():
        if pin := PIN.match(line):
            assert hashes, f"{list(pins)[-1]} has no hash"
            pins[pin[1]], hashes = pin[2], 0
        elif HASH.match(line):
            hashes += 1
        else:
            assert line.startswith("#"), line
    assert hashes
    return pins


@pytest.mark.parametrize("name", LOCKS)
def test_every_package_of_a_lock_has_a_version_and_hashes(name: str) -> None:
    assert pins(name)


@pytest.mark.parametrize(
    ("name", "extras"),
    [("deb/requirements.txt", ()), ("image/requirements.txt", ("tools", "studio"))],
)
def test_the_lock_fits_the_dependencies(name: str, extras: tuple[str, ...]) -> None:
    locked = pins(name)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    optional = [text for extra in extras for text in project["optional-dependencies"][extra]]
    for text in (*project["dependencies"], *optional):
        requirement = Requirement(text)
        assert requirement.specifier.contains(locked[canonicalize_name(requirement.name)]), text


def test_the_package_is_built_from_the_locks_only() -> None:
    lines = (ROOT / "tools" / "deb.sh").read_text(encoding="utf-8").splitlines()
    installs = [line for line in lines if line.startswith("pip_install ")]
    assert len(installs) == 3
    for line in installs:
        assert "--require-hashes" in line or "--no-deps --no-build-isolation" in line


def test_image_and_package_have_the_same_versions() -> None:
    package, image = pins("deb/requirements.txt"), pins("image/requirements.txt")
    assert package.items() <= image.items()


def test_other_packages_and_the_image_are_built_from_the_locks_only() -> None:
    for name in ("debs.sh", "image.sh"):
        text = (ROOT / "tools" / name).read_text(encoding="utf-8").replace("\\\n", "")
        pip = [
            one for one in text.splitlines() if re.match(r'[^#\[]*/pip"? .*(install|load) ', one)
        ]
        assert pip
        for line in pip:
            assert "--require-hashes" in line or "--no-index" in line, line


@pytest.mark.parametrize("vendor", [VENDOR, ROOT / "tools" / "site" / "vendor"])
def test_vendored_files_are_those_that_were_packed(vendor: Path) -> None:
    listed = {}
    for line in (vendor / "SHA256SUMS").read_text(encoding="utf-8").splitlines():
        value, name = line.split()
        listed[name] = value
    there = {p.name: sha256(p.read_bytes()).hexdigest() for p in vendor.iterdir()}
    del there["SHA256SUMS"]
    assert there == listed


def test_packages_of_the_page_have_hashes() -> None:
    lock = json.loads((ROOT / "tools" / "assets" / "package-lock.json").read_text("utf-8"))
    packages = {name: one for name, one in lock["packages"].items() if name}
    assert packages
    assert all(one["integrity"].startswith("sha512-") for one in packages.values())


def test_the_bill_is_valid_and_names_everything(tmp_path: Path) -> None:
    """Of a directory that is laid out as that of a package."""
    vendor = tmp_path / "canshaper" / "studio" / "static" / "vendor"
    shutil.copytree(VENDOR, vendor)
    site = tmp_path / "canshaper" / "data" / "site"
    (site / "assets").mkdir(parents=True)
    (site / "assets" / "mkdocs-material-9.8.1.LICENSE").write_text("")
    shutil.copytree(ROOT / "tools" / "site" / "vendor", site / "site")
    about = tmp_path / "some_package-2.0.dist-info" / "METADATA"
    about.parent.mkdir()
    about.write_text("Metadata-Version: 2.1\nName: some-package\nVersion: 2.0\nLicense: MIT\n")
    command = [sys.executable, str(ROOT / "tools" / "deb" / "sbom.py"), str(tmp_path), "1.2.3"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(done.stdout) is None
    bill = json.loads(done.stdout)
    assert bill["metadata"]["component"]["version"] == "1.2.3"
    parts = {one["name"]: one for one in bill["components"]}
    assert parts.keys() == {
        *("some-package", "three", "uplot"),
        *("iframe-worker", "mkdocs-material"),
    }
    packed = sha256((VENDOR / "three.js").read_bytes()).hexdigest()
    assert parts["three"]["hashes"] == [{"alg": "SHA-256", "content": packed}]
    assert parts["some-package"]["licenses"] == [{"license": {"id": "MIT"}}]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A tree of its own with the module that knows the version."""
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / "version.py", tmp_path / "tools")
    (tmp_path / "CHANGELOG.md").write_text("## [Unreleased]\n\n## [0.3.0] - 2026-01-01\n")
    return tmp_path


def git(tree: Path, *words: str) -> None:
    who = ["-c", "user.name=a", "-c", "user.email=a@b"]
    subprocess.run(["git", *who, *words], cwd=tree, check=True, capture_output=True)


def version_of(tree: Path) -> str:
    command = [sys.executable, "tools/version.py"]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
    return done.stdout.strip() or done.stderr.splitlines()[-1]


def test_the_version_comes_from_the_tags(tree: Path) -> None:
    git(tree, "init")
    for _ in range(2):
        git(tree, "commit", "--allow-empty", "-m", "one")
    assert re.fullmatch(r"0\.3\.1\.dev2\+g[0-9a-f]+", version_of(tree))
    git(tree, "tag", "v1.2.9")
    assert version_of(tree) == "1.2.9"
    git(tree, "commit", "--allow-empty", "-m", "later")
    git(tree, "tag", "another")
    assert re.fullmatch(r"1\.2\.10\.dev1\+g[0-9a-f]+", version_of(tree))


def test_a_source_distribution_carries_its_version(tree: Path) -> None:
    assert "expected a clone or a source distribution" in version_of(tree)
    (tree / "PKG-INFO").write_text("Metadata-Version: 2.4\nName: canshaper\nVersion: 3.4.5\n")
    assert version_of(tree) == "3.4.5"
