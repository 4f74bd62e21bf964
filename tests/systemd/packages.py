"""The packages that these tests install. They are built on the host, before the machine starts."""

import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TREE = ROOT / "out" / "deb" / "root"  # where tools/deb.sh lays out the package
FIRST, NEXT = "CANSHAPER_DEB", "CANSHAPER_DEB_NEXT"
NEXT_VERSION = "999"
# What the next version ships changed; the administrator changes the second one, too.
CHANGED = ("forwarder-robust.yaml", "forwarder-joints.yaml")
CHANGE = "# changed by the next version\n"


def build() -> dict[str, str]:
    """Build the package and one of a later version; return the environment that names both.

    Raises:
        subprocess.CalledProcessError: a build failed; its output says why.
    """
    built = subprocess.run([ROOT / "tools" / "deb.sh"], check=True, stdout=subprocess.PIPE)
    first = ROOT / built.stdout.decode().splitlines()[-1]
    control = TREE / "DEBIAN" / "control"
    text = re.sub(r"(?m)^Version: .*$", f"Version: {NEXT_VERSION}", control.read_text())
    control.write_text(text)
    for name in CHANGED:
        file = TREE / "etc" / "canshaper" / name
        file.write_text(file.read_text() + CHANGE)
    later = ROOT / "out" / "deb" / f"canshaper_{NEXT_VERSION}.deb"
    command = ["dpkg-deb", "--root-owner-group", "-Zgzip", "--build", TREE, later]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return {FIRST: str(first), NEXT: str(later)}


def path(name: str) -> str:
    """File of a package, from the environment inside the machine."""
    file = os.environ.get(name)
    assert file, f"{name} names no package: run python -m tests.lane.services"
    return file


def install(package: str) -> str:
    """Install a package; the administrator's files win. Return what dpkg said.

    Without the triggers of other packages, such as man-db's walk through all manual pages.
    """
    command = ["dpkg", "--no-triggers", "--force-confold", "--install", package]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


if __name__ == "__main__":
    for variable, file in build().items():
        print(f"{variable}={file}")
