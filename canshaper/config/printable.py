"""Text from outside for people: no control character reaches a terminal, a log or its reader."""

import re

# C0 but tab and line end, DEL, C1; other line ends; what turns the direction of text; surrogates.
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    """The text with control characters as Python would write them, such as ``\\x1b``."""
    return _CONTROL.sub(lambda match: ascii(match[0])[1:-1], text)
