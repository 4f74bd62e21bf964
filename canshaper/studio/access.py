"""Rules for who may see the page, and who may open its connection. Pure: headers in, a fault out.

A browser lets any web page send requests to this machine, so being on loopback is not enough. The
requested name (Host) must be one of ours, or else another name could be made to point here. A
connection must come from our own page (Origin). Other machines also need a token.
"""

import io
import ipaddress
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


@dataclass(frozen=True)
class Access:
    """The rules of access to one server.

    Args:
        port: port of the server.
        names: allowed host names besides loopback; with a token any IP address is allowed too.
        token: the secret that a page must send; None on loopback.
    """

    port: int
    names: tuple[str, ...] = ()
    token: str | None = None

    @property
    def cookie(self) -> str:
        """Name of the cookie that keeps the token; browsers share them between ports."""
        return f"canshaper-studio-{self.port}"

    def host_fault(self, host: str) -> str | None:
        """Return why a request with this Host header is refused, or None."""
        name, colon, port = host.rpartition(":")
        if not colon or port.endswith("]"):
            name, port = host, "80"
        known = name in LOOPBACK or name in self.names or (self.token and _is_address(name))
        if not known or port != str(self.port):
            return f"expected the address that canshaper studio printed, got the host {host[:60]!r}"
        return None

    def origin_fault(self, host: str, origin: str | None) -> str | None:
        """Return why a connection is refused whose Origin is not this host, or None."""
        if origin != f"http://{host}":
            got = f"the origin {origin[:60]!r}" if origin else "no origin"
            return f"expected the page of this studio, got {got}"
        return None

    def token_fault(self, query: Mapping[str, str], cookies: Mapping[str, str]) -> str | None:
        """Return why a request is refused that lacks the token in query and cookie, or None."""
        if self.token is None:
            return None
        for shown in (query.get("token"), cookies.get(self.cookie)):
            if shown and secrets.compare_digest(shown.encode(), self.token.encode()):
                return None
        return (
            "expected the whole address that canshaper studio printed, got no token or a wrong one"
        )


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


ANY = {"0.0.0.0": "192.0.2.1", "::": "2001:db8::1"}
"""Hosts that mean all addresses of this machine, each with one of no machine (RFC 5737, 3849)."""


def reachable(host: str) -> str:
    """Return the host name or address with which another machine opens the page.

    It is ``host``, unless that means all addresses: then our address on the default route, or
    without a route the name of this machine. The function sends nothing.
    """
    if host not in ANY:
        return host
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as one:
        try:
            one.connect((ANY[host], 9))
        except OSError:
            return socket.gethostname()
        return str(one.getsockname()[0])


def qr_code(url: str) -> str | None:
    """Return an address as a QR code for a terminal; None if the package segno is not installed."""
    try:
        import segno  # noqa: PLC0415  (an extra)
    except ImportError:
        return None
    text = io.StringIO()
    segno.make(url, error="l").terminal(text, border=2, compact=True)
    return text.getvalue()
