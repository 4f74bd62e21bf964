"""Host, Origin and token."""

import pytest

from canshaper.studio.access import Access

LOCAL = Access(8377)
OPEN = Access(8377, ("0.0.0.0", "crane-pc"), "secret")


@pytest.mark.parametrize("host", ["127.0.0.1:8377", "localhost:8377", "[::1]:8377"])
@pytest.mark.parametrize("access", [LOCAL, OPEN])
def test_loopback_is_always_ours(access: Access, host: str) -> None:
    assert access.host_fault(host) is None


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:8377",
        "localhost.evil.example:8377",
        "127.0.0.1:8378",
        "127.0.0.1",
        "192.168.1.5:8377",
        "",
        ":8377",
        "crane-pc:8377",
    ],
)
def test_other_hosts_are_refused(host: str) -> None:
    """Another name can be made to point to this machine; then it would be the page's own origin."""
    assert "got the host" in (LOCAL.host_fault(host) or "")


@pytest.mark.parametrize("host", ["192.168.1.5:8377", "[fe80::1]:8377", "crane-pc:8377"])
def test_with_a_token_addresses_and_our_name_are_ours(host: str) -> None:
    assert OPEN.host_fault(host) is None


@pytest.mark.parametrize("host", ["evil.example:8377", "crane-pc.evil.example:8377", "1.2.3:8377"])
def test_with_a_token_other_names_are_refused(host: str) -> None:
    assert OPEN.host_fault(host)


def test_port_80_need_not_be_named() -> None:
    assert Access(80).host_fault("localhost") is None
    assert Access(80).host_fault("[::1]") is None


@pytest.mark.parametrize(
    "origin",
    [
        None,
        "",
        "null",
        "http://evil.example",
        "https://127.0.0.1:8377",
        "http://127.0.0.1:8378",
        "http://127.0.0.1:8377.evil.example",
    ],
)
def test_other_origins_are_refused(origin: str | None) -> None:
    assert LOCAL.origin_fault("127.0.0.1:8377", origin)


def test_our_own_origin_is_accepted() -> None:
    assert LOCAL.origin_fault("127.0.0.1:8377", "http://127.0.0.1:8377") is None


def test_token_by_query_or_cookie() -> None:
    assert OPEN.token_fault({"token": "secret"}, {}) is None
    assert OPEN.token_fault({}, {OPEN.cookie: "secret"}) is None
    assert LOCAL.token_fault({}, {}) is None


@pytest.mark.parametrize("token", ["", "Secret", "secret ", "secre", "sécret"])
def test_a_wrong_token_is_refused(token: str) -> None:
    assert OPEN.token_fault({"token": token}, {OPEN.cookie: token})
    assert OPEN.token_fault({}, {})


def test_the_cookie_of_another_port_is_another() -> None:
    assert Access(1, token="a").cookie != Access(2, token="a").cookie
