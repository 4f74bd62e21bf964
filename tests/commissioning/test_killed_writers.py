"""Verbs that write a machine's file, killed at any moment: the old file stands or the new one."""

import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from canshaper.commissioning.calibration.fit import write_curve
from canshaper.commissioning.identification.report import write_sway
from canshaper.commissioning.origins import write_filters, write_numbers
from canshaper.edit.edit import change, replace_text, written_by
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.files import ROOT

pytestmark = pytest.mark.processes

CURVE = [-100, -50, -5, 5, 50, 100], [-100, -50, 0, 0, 50, 100]
SWAY = {"length_m": 1.3, "damping_nms": 120.0, "mass_kg": 300.0, "full_speed_m_s": 1.0}
DESIGNED = {"period_s": 2.356, "damping_ratio": 0.038}


class Measured:
    """Values of a measurement, as far as they are written."""

    axis = "near_far"
    sway = SWAY

    def curve(self) -> tuple[list[int], list[int]]:
        return CURVE


def tuned(deployment: Deployment) -> None:
    values = {"kind": "gff", "a1": 0.7, "a2": 0.11, "designed_for": DESIGNED}
    write_filters(deployment, "slew", [((), values)], 2.1, "tune")


def measured(deployment: Deployment) -> None:
    one: Any = Measured()
    write_sway(deployment, (), [one], written_by("identify", simulated=False))


def calibrated(deployment: Deployment) -> None:
    one: Any = Measured()
    write_curve(deployment, "slew", one, written_by("calibrate", simulated=True))


def adjusted(deployment: Deployment) -> None:
    numbers = {"axes.slew.filter.a1": 0.75, "axes.near_far.filter.a1": 0.72}
    write_numbers(deployment.path, numbers)


def commissioned(deployment: Deployment) -> None:
    text = deployment.path.read_text(encoding="utf-8")
    replace_text(deployment.path, text.replace("length_m: 1.2", "length_m: 1.4"))


Writer = Callable[[Deployment], None]
WRITERS: list[Writer] = [tuned, measured, calibrated, adjusted, commissioned]
# Calls that change what is on the disk.
CHANGES = {"write", "flush", "close", "fsync", "fchown", "chmod", "rename", "replace", "unlink"}
OF_KERNEL = {"posix", "_io"}


@pytest.fixture(
    params=[pytest.param(one, marks=pytest.mark.slow) for one in WRITERS],
    ids=[one.__name__ for one in WRITERS],
)
def writer(request: pytest.FixtureRequest) -> Writer:
    one: Writer = request.param
    return one


@pytest.fixture
def before(tmp_path: Path) -> Deployment:
    """A machine's file, which others may read."""
    folder = tmp_path / "config"
    folder.mkdir()
    (tmp_path / "dbc").symlink_to(ROOT / "dbc")
    file = folder / "machine.yaml"
    file.write_bytes((ROOT / "config" / "forwarder.yaml").read_bytes())
    file.chmod(0o644)
    return load_deployment(file)


def killed(work: Callable[[], None], watch: Callable[[], None], after_s: float = 0.0) -> bool:
    """Do it in a process of its own; whether it was killed."""
    child = os.fork()
    if child == 0:
        try:
            watch()
            work()
            os._exit(0)
        finally:
            os._exit(1)
    if after_s:
        time.sleep(after_s)
        os.kill(child, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status in (0, -signal.SIGKILL)
    return status != 0


def kill_at(number: int) -> Callable[[], None]:
    """Kill this process before one of the calls that change what is on the disk."""
    left = [number]

    def watch(_frame: FrameType, event: str, called: Any) -> None:
        if event != "c_call" or called.__name__ not in CHANGES:
            return
        if (called.__module__ or type(called.__self__).__module__) in OF_KERNEL:
            left[0] -= 1
            if left[0] == 0:
                os.kill(os.getpid(), signal.SIGKILL)

    return lambda: sys.setprofile(watch)


def check(file: Path, old: bytes, new: bytes) -> bool:
    """The file is one of both, as it was readable; whether it is the new one."""
    content = file.read_bytes()
    assert content in (old, new)
    assert file.stat().st_mode & 0o777 == 0o644
    assert [*file.parent.glob("*.yaml")] == [file]  # what is left behind is no deployment file
    return content == new


def written(writer: Writer, deployment: Deployment) -> tuple[bytes, bytes]:
    """Return the content before and after a write; the file is as it was again."""
    old = deployment.path.read_bytes()
    writer(deployment)
    new = deployment.path.read_bytes()
    assert new != old
    load_deployment(deployment.path)
    deployment.path.write_bytes(old)
    return old, new


@pytest.mark.slow
def test_killed_at_any_call_into_the_kernel(writer: Writer, before: Deployment) -> None:
    old, new = written(writer, before)
    seen, number = set(), 1
    while killed(lambda: writer(before), kill_at(number)):
        seen.add(check(before.path, old, new))
        before.path.write_bytes(old)
        number += 1
    assert False in seen
    assert 5 <= number < 40, "not the calls that are meant"


@pytest.mark.slow
def test_killed_at_fifty_random_moments(writer: Writer, before: Deployment) -> None:
    old, new = written(writer, before)
    began = time.monotonic()
    writer(before)
    takes_s = time.monotonic() - began
    moments = random.Random(writer.__name__)
    for _ in range(50):
        before.path.write_bytes(old)
        killed(lambda: writer(before), lambda: None, moments.uniform(0.001, 1.2 * takes_s))
        check(before.path, old, new)


def test_what_is_no_deployment_with_its_dbc_files_never_stands_there(before: Deployment) -> None:
    old = before.path.read_bytes()
    with pytest.raises(ConfigError, match=r"machine.yaml:.*NoSuchSignal"):
        change(before.path, [(("axes", "slew", "command"), {"signal": "NoSuchSignal"}, "")])
    assert before.path.read_bytes() == old
    assert [*before.path.parent.iterdir()] == [before.path]
