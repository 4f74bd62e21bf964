"""Changes of texts that leave most of them as they are: words, numbers, lines."""

import re
from collections.abc import Sequence

from canshaper.shaping.registry import KINDS

# A word, a number, a sign or a blank: what a change may replace.
TOKEN = re.compile(r"[A-Za-z_]+|-?[0-9.]+|\s+|.")


def _words(text: str) -> list[str]:
    return text.split()


YAML_WORDS = (
    *_words("~ true off 0 -1 1 1e999 .nan .inf 1e-9 99999999999999 '' \" [ ] { } : , | > / -"),
    *("", "- ", "? ", "&a ", "*a ", "!!str ", "!x ", "\n", "\t", "\r\n"),
    *("\0", "\x85", "é", "\ud7ff"),
    *("# ", "---\n", "...\n", "%YAML 1.1\n", "qualify: 3", "stuck_s: 1", "alive_max_step: 200"),
    *_words(
        "crane left right slew near_far lift Slew NearFar Enable Reset AliveCounter JoystickLeft"
    ),
    *_words(
        "JoystickRight SlewCommand ShaperStatus SlewStatus X Y Joystick Stop Tip Radius Count Sum"
    ),
    *_words("kind taps machine.dbc"),
    *(name for kind in KINDS.values() for name in (kind.name, *(p.name for p in kind.parameters))),
    "checksum: { signal: Reset, kind: xor }",
    "flags: { neutral: Enable, negative: Reset, positive: AntiSwayOff }",
    "emergency_stop: { bus: crane, message: TipVelocity, signal: SlewRate, timeout_ms: 100 }\n",
)
# No number of many digits: cantools makes an entry for every bit of a message.
DBC_WORDS = (
    *_words("0 1 2 -1 7 8 9 15 16 17 32 63 64 65 255 65536 0.5 1e400 -0 nan inf 1e-400"),
    *_words("@0 @1 + - | : ; , ( ) [ ]"),
    *("", '"', "\n", "\r", "\t", " ", "\0", "é", "\xff", "SIG_VALTYPE_ 272 Slew : 1;\n"),
    *_words(
        "m0 M m1M JoystickLeft Slew Enable Velocity State NearFar Joystick X Y Flow Radius Stop"
    ),
    *_words("BO_ SG_ VAL_ BA_ BA_DEF_ CM_ VAL_TABLE_ SG_MUL_VAL_ SIG_GROUP_ EV_ BO_TX_BU_"),
    *_words("GenMsgCycleTime GenSigStartValue INT FLOAT STRING ENUM VFrameFormat"),
    *_words("Error NotAvailable Vector__XXX"),
)


def changed(text: str, changes: Sequence[tuple[int, int, str]]) -> str:
    """The text with tokens replaced, most of them by such as can stand there.

    Args:
        text: the text.
        changes: for each (where, how, with what); where and how as any numbers.
    """
    tokens = TOKEN.findall(text)
    for where, how, word in changes:
        at, action, size = where % len(tokens), how % 10, how // 10
        if action < 6:
            at = _alike(tokens, at, word)
            tokens[at] = word
        elif action == 6:
            tokens.insert(at, word)
        elif action == 7:
            del tokens[at : at + 1 + size % 4]
        elif action == 8:
            tokens[at] = tokens[_alike(tokens, size % len(tokens), tokens[at])]
        else:
            lines = "".join(tokens).split("\n")
            line = where % len(lines)
            lines[line : line + 1] = [lines[line]] * (size % 3)
            tokens = TOKEN.findall("\n".join(lines))
        if not tokens:
            return ""
    return "".join(tokens)


def _alike(tokens: list[str], at: int, word: str) -> int:
    """The next place from here whose token is of the kind of the word: word, number or sign."""
    kind = _kind(word)
    places = (n % len(tokens) for n in range(at, at + len(tokens)))
    return next((n for n in places if _kind(tokens[n]) == kind), at)


def _kind(token: str) -> str:
    first = token[:1]
    if first.isdecimal() or (first in "-." and token[1:2].isdecimal()):
        return "number"
    return "word" if first.isalpha() else "sign"
