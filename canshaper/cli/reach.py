"""Where other machines find the page: the address of this one, and as a QR code."""

import io
import socket

ANY = {"0.0.0.0": "192.0.2.1", "::": "2001:db8::1"}
"""What means all addresses of this machine, and one of no machine (RFC 5737, RFC 3849)."""


def reachable(host: str) -> str:
    """The host to open from elsewhere: where all addresses are served, that of the default route.

    Nothing is sent. Without a route it is the name of this machine.
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
    """An address as a QR code for a terminal; None where the package segno is not installed."""
    try:
        import segno
    except ImportError:
        return None
    text = io.StringIO()
    segno.make(url, error="l").terminal(text, border=2, compact=True)
    return text.getvalue()
