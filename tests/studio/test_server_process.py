"""The studio as a process: daemons that end, a port in use, wrong options, a shadow."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from canshaper_sim.hand import Hand, Held
from tests.cli.invocation import invoke
from tests.studio.conftest import ROOT, Listener, Studio, command_of
from tests.studio.page import WAIT_S


@pytest.mark.slow
def test_a_daemon_that_ends_is_reported_and_starts_again(own: Callable[..., Studio]) -> None:
    studio = own()
    with studio.page() as page:
        page.drive()
        page.send(slide="length", to=2.0)
        page.until(lambda s: s["sliders"]["length"] == 2.0, "slider")
        first = next(pid for pid in studio.children("run") if studio.groups[0] in command_of(pid))
        os.kill(first, signal.SIGKILL)
        page.until(lambda s: not s["cranes"]["shaped"]["daemon"], "silent")
        page.until(lambda s: s["cranes"]["shaped"]["daemon"], "back")
        assert any("canshaper run ended with status -9" in text for text in page.texts())
        assert page.shown["cranes"]["raw"]["daemon"]
        assert page.shown["sliders"]["length"] == 1.0  # it has the numbers of its file
        page.until(lambda _: page.states() == {"ready"}, "ready again")


@pytest.mark.slow
def test_the_processes_end_with_a_studio_that_is_killed(own: Callable[..., Studio]) -> None:
    studio = own()
    with studio.page() as page:
        page.until(lambda s: all(c["daemon"] and c["crane"] for c in s["cranes"].values()))
    children = studio.children()
    assert len(children) == 4
    studio.process.kill()
    studio.process.communicate(timeout=WAIT_S)
    limit = time.monotonic() + WAIT_S
    while any("canshaper.__main__" in " ".join(command_of(pid)) for pid in children):
        assert time.monotonic() < limit


@pytest.mark.slow
def test_the_shadow_shows_a_machine_and_never_sends(
    own: Callable[..., Studio], listen: Callable[[str], Listener]
) -> None:
    """A hand on the bus of a machine is seen; whatever pages ask for, nothing comes from us."""
    studio = own("--shadow")
    assert studio.children() == []
    machine, hand = listen(studio.groups[0]), Hand(load_deployment(ROOT / "config/forwarder.yaml"))
    with studio.page() as page:
        assert page.hello["cranes"] == ["machine"] and not page.hello["drives"]
        page.send(do="take")
        page.send(do="enable")
        page.send(joysticks={"slew": 1.0})
        page.connection.send("nonsense")
        page.send(slide="length", to=1.0)
        for frame in hand.frames(0, Held({"slew": 0.25})):
            machine.port.send(frame)
        page.until(lambda s: s["cranes"]["machine"]["axes"]["slew"]["joystick"] == 0.25)
        assert page.shown["driver"] is None
        page.for_s(0.5)
    assert machine.frames() == []


@pytest.mark.slow
def test_a_channel_of_a_real_machine_is_refused() -> None:
    """Loopback is no CAN interface, and no virtual bus either."""
    command = [sys.executable, "-m", "canshaper", "studio", "--channel", "lo"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "would move a real machine" in done.stderr


@pytest.mark.parametrize("options", ["socketcan", "pcan --channel vcan0"])
def test_an_interface_that_no_simulated_crane_would_use_is_refused(options: str) -> None:
    refused = invoke("studio", "--interface", *options.split())
    text = "--interface: expected udp_multicast, or socketcan with --channel, got"
    assert (refused.exit_code, refused.output) == (2, f"{text} {options.split(maxsplit=1)[0]!r}\n")


@pytest.mark.slow
def test_a_port_in_use_is_reported(shared: Studio) -> None:
    command = [sys.executable, "-m", "canshaper", "studio", "--port", str(shared.port)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"cannot serve at 127.0.0.1 port {shared.port}" in done.stderr


@pytest.mark.slow
def test_nothing_is_left_in_the_temporary_directory(
    own: Callable[..., Studio], tmp_path: Path
) -> None:
    os.environ["TMPDIR"] = str(tmp_path)
    try:
        studio = own()
    finally:
        del os.environ["TMPDIR"]
    assert list(tmp_path.iterdir())
    studio.stop()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_of_two_cranes_the_named_one_is_driven(own: Callable[..., Studio]) -> None:
    with own("--crane", "rear", file="two-cranes.yaml", groups=()).page() as page:
        page.drive()
        assert page.hello["axes"] == ["slew", "near_far", "lift", "rotator"]
        names = {source for crane in page.shown["cranes"].values() for source in crane["sources"]}
        assert any("rear" in name for name in names) and not any("front" in n for n in names)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--crane", "middle"), "crane: expected one of front, rear, got 'middle'"),
        (("--interface", "udp_multicast"), "expected a deployment with one bus and crane"),
        (("--crane", "rear", "--shadow"), "--crane: expected without --shadow"),
        (("--seed", "5", "--shadow"), "--shadow, --adjust, --control: expected with a machine's"),
        (("--campaign", "out", "--shadow"), "--shadow, --adjust, --control: expected with a"),
        (("--seed", "5", "--control", "x"), "--shadow, --adjust, --control: expected with a"),
    ],
)
def test_a_wrong_request_for_two_cranes_is_reported(options: tuple[str, ...], says: str) -> None:
    command = [sys.executable, "-m", "canshaper", "studio", "two-cranes.yaml", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert says in " ".join(done.stderr.split())
