"""The real server with real daemons and cranes, and pages that behave and that do not."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from canshaper.machine.binding import load_deployment
from canshaper.studio.client import MOST_BYTES, MOST_NONSENSE, MOST_PER_S
from canshaper.studio.server import MOST_PAGES
from canshaper_sim.hand import Hand, Held
from tests.faults.shipped import NAMES
from tests.studio.conftest import ROOT, WAIT_S, Listener, Page, Studio, command_of

# Their cranes are in the page's process: each crane has one multicast group.
SEVERAL_BUSES = ("gateway-forwarder", "two-cranes", "pvedcc-forwarder")
NONSENSE = [
    "",
    "x",
    "{",
    "[]",
    "null",
    "0.5",
    '"take"',
    "{}",
    '{"do": "go"}',
    '{"do": 1}',
    '{"do": ["take"]}',
    '{"joysticks": 1}',
    '{"joysticks": {"slew": 2}}',
    '{"joysticks": {"slew": NaN}}',
    '{"joysticks": {"slew": 1e999}}',
    '{"joysticks": {"slew": "1"}}',
    '{"joysticks": {"tower": 1}}',
    '{"antisway": 1}',
    '{"slide": "calm", "to": "fast"}',
    '{"slide": "speed", "to": 1}',
    '{"slide": "calm", "to": NaN}',
    '{"slide": "calm", "to": 1' + "0" * 400 + "}",
    '{"joysticks": {"slew": 1' + "0" * 400 + "}}",
    '{"joysticks": {"\\ud800": 1}}',
    '{"do": "\\ud800"}',
    "日本" * 200,
    "[" * 1000,
    "\u0000",
]


def pose(shown: dict[str, Any]) -> list[Any]:
    return [crane["pose"] for crane in shown["cranes"].values()]


def flat(poses: list[Any]) -> list[float]:
    return [number for one in poses for number in one]


def valves(shown: dict[str, Any], crane: str) -> list[float]:
    return [axis["valve"] for axis in shown["cranes"][crane]["axes"].values()]


def settled(page: Page) -> None:
    """Wait until no grapple swings: the tests share one machine."""
    page.until(lambda s: all((c["swing"] or 0.0) < 0.5 for c in s["cranes"].values()), "rest")


def test_it_shows_both_cranes(shared: Studio) -> None:
    with shared.page() as page:
        at_rest = ("waiting for neutral", "enable is off")
        shown = page.until(  # the daemons, the joysticks and the cranes do not begin at once
            lambda s: all(
                c["crane"] and {(a["state"], a["reason"]) for a in c["axes"].values()} == {at_rest}
                for c in s["cranes"].values()
            ),
            "both cranes at rest",
        )
        assert page.hello["cranes"] == ["shaped", "raw"] == list(shown["cranes"])
        assert page.hello["axes"] == ["slew", "near_far", "lift"]
        for crane in shown["cranes"].values():
            assert crane["measured"] and len(crane["pose"]) == 3


def test_a_drive_swings_less_shaped_and_the_switch_acts_in_motion(
    own: Callable[..., Studio],
) -> None:
    """Half a second of slewing; then the same, with anti-sway switched off on the way."""
    with own().page() as page:
        page.drive()
        assert page.joysticks is not None
        page.joysticks["slew"] = 0.5
        page.for_s(0.8)
        page.joysticks["slew"] = 0.0
        page.until(lambda _: page.states() == {"ready"}, "at rest")
        swings = {name: crane["swing"] for name, crane in page.for_s(3.0)[-1]["cranes"].items()}
        assert swings["raw"] > 10.0
        assert swings["shaped"] < swings["raw"] / 4
        page.joysticks["slew"] = 0.5
        page.until(lambda s: s["cranes"]["shaped"]["axes"]["slew"]["state"] == "moving, shaped")
        page.send(antisway=False)
        page.until(lambda s: s["cranes"]["shaped"]["axes"]["slew"]["state"] == "moving, unshaped")
        page.send(antisway=True)
        page.until(lambda s: s["cranes"]["shaped"]["axes"]["slew"]["state"] == "moving, shaped")
        assert page.shown["cranes"]["raw"]["axes"]["slew"]["state"] == "moving, unshaped"
        assert "anti-sway switched off" in page.texts()


def test_the_page_chooses_a_profile_through_the_joystick(own: Callable[..., Studio]) -> None:
    with own(file="j1939-profiles.yaml").page() as page:
        page.drive()
        assert page.hello["profiles"] is True

        def profile(shown: dict[str, Any], axis: str = "slew") -> str:
            return str(shown["cranes"]["shaped"]["axes"][axis]["profile"])

        page.until(lambda s: profile(s) == "normal")
        for name in ("quick", "fine", "normal"):
            page.send(do="profile")
            page.until(lambda s, name=name: profile(s) == profile(s, "near_far") == name)  # type: ignore[misc]
        assert page.joysticks is not None
        page.joysticks["slew"] = 0.4
        page.until(lambda s: valves(s, "shaped")[0] > 0.1)
        page.send(do="profile")
        page.until(lambda s: profile(s) == "quick")
        assert valves(page.shown, "shaped")[0] == pytest.approx(0.4, abs=0.03)
        assert page.shown["cranes"]["shaped"]["axes"]["lift"]["profile"] is None


def test_without_profiles_there_is_no_button(shared: Studio) -> None:
    with shared.page() as page:
        assert page.hello["profiles"] is False
        assert page.shown["cranes"]["shaped"]["axes"]["slew"]["profile"] is None


def test_a_slider_changes_the_daemon_in_motion(own: Callable[..., Studio]) -> None:
    with own().page() as page:
        page.drive()
        assert page.joysticks is not None
        page.joysticks["slew"] = 0.3
        page.until(lambda s: valves(s, "shaped")[0] > 0.1)
        page.send(slide="calm", to=2.0)
        page.until(lambda s: s["sliders"]["calm"] == 2.0, "slider")
        assert any("axes.slew.filter.a2 = 0.48" in text for text in page.texts())
        page.send(slide="calm", to=3.0)
        page.until(lambda _: any("expected 0.5 to 2" in text for text in page.refused))
        assert page.look()["sliders"]["calm"] == 2.0


def test_without_a_driver_no_one_moves_the_sliders(shared: Studio) -> None:
    with shared.page() as page:
        page.send(slide="calm", to=2.0)
        page.until(lambda _: any("only the page that drives" in text for text in page.refused))
        assert page.shown["sliders"]["calm"] == 1.0


@pytest.mark.parametrize("start", range(0, len(NONSENSE), MOST_NONSENSE - 5))
def test_nonsense_is_refused_with_a_word_and_nothing_moves(shared: Studio, start: int) -> None:
    with shared.page() as page:
        page.drive()
        settled(page)
        before = pose(page.shown)
        for text in NONSENSE[start : start + MOST_NONSENSE - 5]:
            page.refused.clear()
            page.connection.send(text)
            page.until(lambda _: bool(page.refused), "refusal")
            assert "expected " in page.refused[0], text
            assert valves(page.shown, "shaped") == valves(page.shown, "raw") == [0.0] * 3
        page.for_s(0.3)
        assert pose(page.shown) == before


def test_bytes_are_nonsense(shared: Studio) -> None:
    with shared.page() as page:
        page.connection.send(b"\x00\xff" * 40)
        page.until(lambda _: "expected JSON, got bytes" in page.refused)


def test_nonsense_of_the_driver_brings_its_joysticks_to_neutral(shared: Studio) -> None:
    with shared.page() as page:
        page.drive()
        assert page.joysticks is not None
        page.joysticks["lift"] = 0.5
        page.until(lambda s: valves(s, "shaped")[2] > 0.3)
        page.connection.send("nonsense")
        page.until(lambda s: s["cranes"]["shaped"]["axes"]["lift"]["joystick"] == 0.0)
        # The joystick is still held out, and counts for nothing; then enable goes.
        page.until(lambda s: not s["enable"], "enable released")
        assert valves(page.shown, "shaped")[2] == 0.0


def test_too_much_nonsense_closes_the_page_and_the_others_go_on(shared: Studio) -> None:
    with shared.page() as page, shared.page() as other:
        for _ in range(MOST_NONSENSE):
            page.connection.send("日" * 40)  # the reason of the end is as long as one may be
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda _: False)
        assert closed.value.rcvd and closed.value.rcvd.code == 1008
        assert "no messages" in closed.value.rcvd.reason
        other.until(lambda _: any("is closed" in text for text in other.texts()))


def test_a_page_that_sends_too_fast_is_closed_and_its_joysticks_go_to_neutral(
    shared: Studio,
) -> None:
    with shared.page() as page, shared.page() as other:
        page.drive()
        message = json.dumps({"joysticks": {"slew": 0.0, "near_far": 0.0, "lift": 0.5}})

        def flood() -> None:
            with suppress(ConnectionClosed, OSError):
                while True:
                    page.connection.send(message)

        flooding = threading.Thread(target=flood)
        flooding.start()
        page.joysticks = None
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda _: False)
        flooding.join(WAIT_S)
        assert not flooding.is_alive()
        assert closed.value.rcvd and closed.value.rcvd.code == 1008
        assert f"expected {MOST_PER_S} messages a second at most" in closed.value.rcvd.reason
        other.now()
        other.until(lambda s: s["cranes"]["shaped"]["axes"]["lift"]["joystick"] == 0.0)
        other.until(lambda s: not s["enable"])
        assert all(crane["daemon"] for crane in other.shown["cranes"].values())


def test_a_huge_message_closes_the_page(shared: Studio) -> None:
    with shared.page() as page:
        page.connection.send("x" * (MOST_BYTES + 1))
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda _: False)
        assert closed.value.rcvd and closed.value.rcvd.code == 1009


def test_a_silent_page_loses_the_joysticks_then_enable(shared: Studio) -> None:
    with shared.page() as page:
        page.drive()
        assert page.joysticks is not None
        page.joysticks["lift"] = -0.4
        page.until(lambda s: valves(s, "shaped")[2] < -0.2)
        page.joysticks = None
        page.until(lambda s: s["cranes"]["shaped"]["axes"]["lift"]["joystick"] == 0.0)
        assert page.shown["enable"]
        page.until(lambda s: not s["enable"])
        # At rest by then, so it is no trip.
        page.until(lambda _: page.states() == {"wait"}, "enable off")
        assert any("is silent; joysticks in neutral" in text for text in page.texts())


def test_a_second_driver_stops_the_first(shared: Studio) -> None:
    with shared.page() as page, shared.page() as other:
        page.drive()
        assert page.joysticks is not None
        page.joysticks["lift"] = 0.4
        page.until(lambda s: valves(s, "shaped")[2] > 0.2)
        other.send(do="take")
        page.until(lambda s: s["driver"] == other.hello["page"])
        page.until(lambda s: s["cranes"]["shaped"]["axes"]["lift"]["joystick"] == 0.0)
        page.until(lambda s: not s["enable"], "enable released")
        assert any("takes the joysticks from" in text for text in page.texts())


def test_a_page_that_is_closed_leaves_the_joysticks_in_neutral(shared: Studio) -> None:
    with shared.page() as other:
        with shared.page() as page:
            page.drive()
            assert page.joysticks is not None
            page.joysticks["lift"] = -0.4
            page.until(lambda s: valves(s, "shaped")[2] < -0.2)
        other.now()
        other.until(lambda s: s["driver"] is None, "no driver")
        other.until(lambda s: s["cranes"]["shaped"]["axes"]["lift"]["joystick"] == 0.0)
        other.until(lambda s: not s["enable"], "enable released")


def test_pages_beyond_the_most_are_refused_with_the_reason(shared: Studio) -> None:
    with ExitStack() as stack:
        for _ in range(MOST_PAGES):
            stack.enter_context(shared.page())
        late = stack.enter_context(
            connect(f"ws://{shared.host}/ws", origin=f"http://{shared.host}")
        )
        with pytest.raises(ConnectionClosed) as closed:
            late.recv(timeout=WAIT_S)
        assert closed.value.rcvd and "pages are open already" in closed.value.rcvd.reason
    with shared.page() as page:
        assert page.look()


@pytest.mark.parametrize("origin", ["http://evil.example", "null", None])
def test_a_connection_from_elsewhere_is_refused(shared: Studio, origin: Any) -> None:
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(f"ws://{shared.host}/ws", origin=origin),
    ):
        pass
    assert refused.value.response.status_code == 403
    assert b"expected the page of this studio, got" in refused.value.response.body


@pytest.mark.parametrize("path", ["/", "/static/main.js", "/static/../server.py"])
def test_another_host_gets_no_page(shared: Studio, path: str) -> None:
    with pytest.raises(urllib.error.HTTPError) as refused:
        fetch(shared, path, Host="evil.example")
    with refused.value as answer:
        assert answer.code == 403
        assert b"got the host 'evil.example'" in answer.read()


@pytest.mark.parametrize(
    "path", ["/static/../server.py", "/static/%2e%2e/server.py", "/etc/passwd"]
)
def test_nothing_but_the_page_is_served(shared: Studio, path: str) -> None:
    with pytest.raises(urllib.error.HTTPError) as refused:
        fetch(shared, path)
    with refused.value as answer:
        assert answer.code == 404


def test_a_request_that_is_none_does_no_harm(shared: Studio) -> None:
    for data in (
        b"\0\xff" * 100,
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /ws HTTP/1.1\r\nUpgrade: websocket",
    ):
        with socket.create_connection(("127.0.0.1", shared.port)) as one:
            one.sendall(data)
    with shared.page() as page:
        assert page.look()


def fetch(studio: Studio, path: str, **headers: str) -> bytes:
    request = urllib.request.Request(f"http://{studio.host}{path}", headers=headers)
    with urllib.request.urlopen(request, timeout=WAIT_S) as answer:
        return bytes(answer.read())


def test_the_page_may_load_from_here_only(shared: Studio) -> None:
    with urllib.request.urlopen(shared.url, timeout=WAIT_S) as answer:
        policy = answer.headers["Content-Security-Policy"]
        text = answer.read().decode()
    assert "default-src 'self'" in policy
    assert "//" not in text.replace("<!doctype", "")


def test_a_daemon_that_ends_is_reported_and_starts_again(own: Callable[..., Studio]) -> None:
    studio = own()
    with studio.page() as page:
        page.drive()
        page.send(slide="calm", to=2.0)
        page.until(lambda s: s["sliders"]["calm"] == 2.0, "slider")
        first = next(pid for pid in studio.children("run") if studio.groups[0] in command_of(pid))
        os.kill(first, signal.SIGKILL)
        page.until(lambda s: not s["cranes"]["shaped"]["daemon"], "silent")
        page.until(lambda s: s["cranes"]["shaped"]["daemon"], "back")
        assert any("canshaper run ended with status -9" in text for text in page.texts())
        assert page.shown["cranes"]["raw"]["daemon"]
        assert page.shown["sliders"]["calm"] == 1.0  # it has the numbers of its file
        page.until(lambda _: page.states() == {"ready"}, "ready again")


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


def test_from_other_machines_a_token_is_needed(own: Callable[..., Studio]) -> None:
    studio = own("--host", "0.0.0.0")
    token = studio.url.partition("token=")[2]
    assert len(token) > 20
    with pytest.raises(urllib.error.HTTPError) as refused:
        fetch(studio, "/")
    with refused.value as answer:
        assert answer.code == 403
        assert b"got no token" in answer.read()
    with (
        pytest.raises(InvalidStatus) as no,
        connect(f"ws://{studio.host}/ws", origin=f"http://{studio.host}"),
    ):
        pass
    assert no.value.response.status_code == 403
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    with opener.open(f"http://{studio.host}/?token={token}", timeout=WAIT_S) as answer:
        assert b"canshaper" in answer.read()
        assert "token" not in answer.url
    cookie = {"Cookie": f"canshaper-studio-{studio.port}={token}"}
    with studio.page(additional_headers=cookie) as page:
        assert page.look()


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
        page.send(slide="calm", to=1.0)
        for frame in hand.frames(0, Held({"slew": 0.25})):
            machine.port.send(frame)
        page.until(lambda s: s["cranes"]["machine"]["axes"]["slew"]["joystick"] == 0.25)
        assert page.shown["driver"] is None
        page.for_s(0.5)
    assert machine.frames() == []


def test_a_channel_of_a_real_machine_is_refused() -> None:
    """Loopback is no CAN interface, and no virtual bus either."""
    command = [sys.executable, "-m", "canshaper", "studio", "--channel", "lo"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "would move a real machine" in done.stderr


def test_a_port_in_use_is_reported(shared: Studio) -> None:
    command = [sys.executable, "-m", "canshaper", "studio", "--port", str(shared.port)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"cannot serve at 127.0.0.1 port {shared.port}" in done.stderr


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


def test_of_two_cranes_the_named_one_is_driven(own: Callable[..., Studio]) -> None:
    with own("--crane", "rear", file="two-cranes.yaml", groups=()).page() as page:
        page.drive()
        assert page.hello["axes"] == ["slew", "near_far", "lift", "rotator"]
        names = {source for crane in page.shown["cranes"].values() for source in crane["sources"]}
        assert any("rear" in name for name in names) and not any("front" in n for n in names)


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


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_machine_is_driven_with_all_its_axes(
    own: Callable[..., Studio], name: str
) -> None:
    """Both cranes move as their joysticks say, and every valve goes back to zero."""
    groups = () if name in SEVERAL_BUSES else None
    with own(file=f"{name}.yaml", groups=groups).page() as page:
        page.drive()
        before = pose(page.shown)

        def moving(shown: dict[str, Any]) -> bool:
            cranes = shown["cranes"].items()
            slew = {n: crane["axes"]["slew"]["state"] for n, crane in cranes}
            return (
                slew == {"shaped": "moving, shaped", "raw": "moving, unshaped"}
                and all(min(valves(shown, n)) > 0.1 for n, _ in cranes)
                and all(
                    abs(a - b) > 0.02 for a, b in zip(flat(pose(shown)), flat(before), strict=True)
                )
            )

        page.hold(0.3, moving, "all axes of both cranes in motion")
        page.joysticks = dict.fromkeys(page.hello["axes"], 0.0)
        page.until(lambda s: not any(valves(s, "shaped") + valves(s, "raw")), "at rest")
