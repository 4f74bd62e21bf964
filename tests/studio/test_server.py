"""The real server with real daemons and cranes: drives, sliders, and who gets the page."""

import socket
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.faults.shipped import NAMES
from tests.studio.conftest import Studio
from tests.studio.page import WAIT_S
from tests.studio.shown import valves

# Their cranes are in the page's process: each crane has one multicast group.
SEVERAL_BUSES = ("gateway-forwarder", "two-cranes", "pvedcc-forwarder")


def where(crane: dict[str, Any]) -> list[float]:
    """Tip and rope of a crane; a tower's height stays."""
    numbers = [*(crane["trolley"] or crane["pose"])[:3]]
    return [*numbers[:2], crane["rope"]] if crane["rope"] else numbers


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


@pytest.mark.slow
def test_a_drive_swings_less_shaped_and_the_switch_acts_in_motion(
    own: Callable[..., Studio],
) -> None:
    """Half a second of slewing; then the same, with anti-sway switched off on the way."""
    with own().page() as page:
        swings = page.stroke(0.5, 0.7)
        assert page.joysticks is not None
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_slider_changes_the_daemon_in_motion(own: Callable[..., Studio]) -> None:
    with own().page() as page:
        page.drive()
        assert page.joysticks is not None
        page.joysticks["slew"] = 0.3
        page.until(lambda s: valves(s, "shaped")[0] > 0.1)
        page.send(slide="length", to=2.0)
        page.until(lambda s: s["sliders"]["length"] == 2.0, "slider")
        assert any("axes.slew.sway.period_s = 3.332" in text for text in page.texts())
        page.send(slide="length", to=3.0)
        page.until(lambda _: any("expected 0.5 to 2" in text for text in page.refused))
        assert page.look()["sliders"]["length"] == 2.0


def test_without_a_driver_no_one_moves_the_sliders(shared: Studio) -> None:
    with shared.page() as page:
        page.send(slide="length", to=2.0)
        page.until(lambda _: any("only the page that drives" in text for text in page.refused))
        assert page.shown["sliders"]["length"] == 1.0


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


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_machine_is_driven_with_all_its_axes(
    own: Callable[..., Studio], name: str
) -> None:
    """Both cranes move as their joysticks say, and every valve goes back to zero."""
    groups = () if name in SEVERAL_BUSES else None
    with own(file=f"{name}.yaml", groups=groups).page() as page:
        page.drive()
        before = {n: where(crane) for n, crane in page.shown["cranes"].items()}

        def moving(shown: dict[str, Any]) -> bool:
            cranes = shown["cranes"].items()
            first = {n: next(iter(crane["axes"].values()))["state"] for n, crane in cranes}
            moved = [
                sum(abs(a - b) > 0.02 for a, b in zip(where(crane), before[n], strict=True))
                for n, crane in cranes
            ]
            return (
                first == {"shaped": "moving, shaped", "raw": "moving, unshaped"}
                and all(min(valves(shown, n)) > 0.1 for n, _ in cranes)
                and min(moved) >= min(3, len(shown["cranes"]["raw"]["axes"]))
            )

        page.hold(0.3, moving, "all axes of both cranes in motion")
        page.joysticks = dict.fromkeys(page.hello["axes"], 0.0)
        page.until(lambda s: not any(valves(s, "shaped") + valves(s, "raw")), "at rest")
