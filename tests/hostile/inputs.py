"""Files that are meant to harm, each with the command that reads it."""

import gzip
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]
SHIPPED = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
DBC = (ROOT / "dbc" / "forwarder.dbc").read_text(encoding="cp1252")
SIGNAL = ' SG_ S : 0|8@1+ (1,0) [0|0] "" A\n'
HEAD = 'VERSION ""\n\nBU_: A\n\n'
# What must never be shown: it stands in a file outside of a bundle.
SECRET = "a-secret-of-this-machine"

Make = Callable[[Path], list[str]]


def deployment(text: str | bytes) -> Make:
    """``canshaper check`` of a deployment file."""

    def make(folder: Path) -> list[str]:
        file = folder / "machine.yaml"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return ["check", str(file)]

    return make


def with_dbc(name: str, text: str = "") -> Make:
    """``canshaper check`` of the shipped deployment with another DBC file."""

    def make(folder: Path) -> list[str]:
        if text:
            (folder / name).write_text(text, encoding="cp1252")
        (folder / "machine.yaml").write_text(SHIPPED.replace("../dbc/forwarder.dbc", name))
        return ["check", str(folder / "machine.yaml")]

    return make


def filled(head: str, row: str) -> Make:
    """``canshaper check`` with a DBC file of 16 MB: a head, and one row as often as it goes."""

    def make(folder: Path) -> list[str]:
        return with_dbc("a.dbc", head + row * (16_000_000 // len(row)))(folder)

    return make


def pipe(folder: Path) -> list[str]:
    """A pipe that no one writes to."""
    os.mkfifo(folder / "machine.yaml")
    return ["check", str(folder / "machine.yaml")]


def many_files(folder: Path) -> list[str]:
    """Many DBC files, each of them allowed."""
    names = [f"{i}.dbc" for i in range(60)]
    for name in names:
        (folder / name).write_text(DBC, encoding="cp1252")
    text = SHIPPED.replace("../dbc/forwarder.dbc", ", ".join(names))
    (folder / "machine.yaml").write_text(text)
    return ["check", str(folder / "machine.yaml")]


def messages(length: int, size: int, same: bool = False) -> str:
    """A DBC file full of messages."""
    rows = [HEAD]
    for i in range(size // 60):
        number = 5 if same else 0x80000000 + i
        rows.append(f'BO_ {number} M{i}: {length} A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n\n')
    return "".join(rows)


def aliases() -> str:
    """Anchors within anchors: a few lines that are 4 ** 30 nodes."""
    rows = ["a0: &a0 [x, x, x, x]"]
    rows += [f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}, *a{i - 1}, *a{i - 1}]" for i in range(1, 30)]
    return "\n".join(rows)


def bundle(members: dict[str, str | bytes], link: str = "") -> Make:
    """``canshaper replay`` of a bundle with these members; one of them a link."""

    def make(folder: Path) -> list[str]:
        (folder / "secret").write_text(SECRET)
        path = folder / "bundle.zip"
        about = {"log": "recording.log", "deployment": "deployment/machine.yaml"}
        given = {
            "about.json": json.dumps(about),
            "recording.log": "(1.0) can0 110#00\n",
            "deployment/forwarder.dbc": DBC,
            "deployment/machine.yaml": SHIPPED.replace("../dbc/forwarder.dbc", "forwarder.dbc"),
        } | members
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            for name, content in given.items():
                info = zipfile.ZipInfo(name)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr = (0o120777 if name == link else 0o100644) << 16
                file.writestr(info, content)
        return ["replay", str(path), "--out", str(folder / "out")]

    return make


def machine(dbc: str) -> dict[str, str | bytes]:
    """The deployment of a bundle, with another DBC file."""
    return {"deployment/machine.yaml": SHIPPED.replace("../dbc/forwarder.dbc", dbc)}


def packed_log(folder: Path) -> list[str]:
    """``canshaper replay`` of a log of a gigabyte of empty lines, packed a thousand times."""
    path = folder / "drive.log.gz"
    with gzip.open(path, "wb") as packed:
        for _ in range(100):
            packed.write(b"\n" * 10_000_000)
    return ["replay", str(path), "--config", "forwarder.yaml", "--out", str(folder / "out")]


LOGS: dict[str, Make] = {
    "bundle: dbc is /etc/passwd": bundle(machine("/etc/passwd")),
    "bundle: dbc is outside of it": bundle(machine("../../secret")),
    "bundle: dbc is a link": bundle(
        {**machine("x.dbc"), "deployment/x.dbc": "/etc/passwd"}, "deployment/x.dbc"
    ),
    "bundle: deployment is a link": bundle(
        {"deployment/machine.yaml": "/etc/passwd"}, "deployment/machine.yaml"
    ),
    "bundle: a name leads out": bundle({"../../evil": "x"}),
    "bundle: a name from the root": bundle({"/tmp/evil": "x"}),
    "bundle: a name of another system": bundle({"..\\evil": "x"}),
    "bundle: many members": bundle({f"deployment/{i}": "" for i in range(200)}),
    "bundle: log packed a thousand times": bundle({"recording.log": b"\n" * 200_000_000}),
    "bundle: large file": bundle({"deployment/x": os.urandom(11_000_000)}),
    "bundle: about.json nested": bundle({"about.json": "[" * 500_000}),
    "bundle: about.json points out": bundle(
        {"about.json": json.dumps({"log": "../secret", "deployment": "deployment/machine.yaml"})}
    ),
    "log packed a thousand times": packed_log,
}
"""By name; each is refused by ``canshaper replay``."""


FILES: dict[str, Make] = {
    "YAML with aliases of aliases": deployment(aliases()),
    "YAML of 100 MB": deployment(b"# x\n" * 25_000_000),
    "YAML with 60 000 entries": deployment("- a\n" * 60_000),
    "YAML with 60 000 unknown keys": deployment("".join(f"k{i}: 1\n" for i in range(25_000))),
    "YAML nested by brackets": deployment("[" * 250_000),
    "YAML nested by dashes": deployment("- " * 120_000),
    "YAML nested by question marks": deployment("? " * 120_000),
    "YAML with a long word": deployment('"' + "a" * 250_000 + '"'),
    "YAML with a long tag": deployment("!" + "a" * 250_000 + " x"),
    "YAML with wrong keys and no end": deployment("".join(f"k{i}: 1\n" for i in range(4500))),
    "YAML that is a pipe": pipe,
    "DBC that is a device": with_dbc("/dev/zero"),
    "DBC that is a directory": with_dbc("/"),
    "DBC of 50 MB": with_dbc("a.dbc", HEAD + "BO_TX_BU_ 5 : A;\n" * 3_000_000),
    "DBC with messages of 9999 bytes": with_dbc("a.dbc", messages(9999, 300_000)),
    "DBC with a message of a million bytes": with_dbc("a.dbc", messages(1_000_000, 60)),
    "DBC with one id 5000 times": with_dbc("a.dbc", messages(8, 300_000, same=True)),
    "DBC with a string without end": with_dbc("a.dbc", HEAD + 'CM_ "' + "a" * 390_000),
    "DBC full of words": with_dbc("a.dbc", HEAD + "a " * 85_000 + "BO_"),
    "DBC full of marks": with_dbc("a.dbc", HEAD + "BO_ 5 M: 8 A\n SG_ S " + "|" * 390_000),
    "DBC with more words": with_dbc("a.dbc", HEAD + "a " * 190_000),
    "DBC with a number of many digits": with_dbc("a.dbc", HEAD + f"BO_ {'9' * 390_000} M: 8 A\n"),
    "DBC with 25 000 messages": with_dbc("a.dbc", messages(8, 1_500_000)),
    "DBC of 16 MB, tables": filled(HEAD, 'VAL_ 1 A 0 "";\n'),
    "DBC of 16 MB, one table": filled(HEAD + "VAL_ 1 A ", '0 "" '),
    "DBC of 16 MB, tables without end": filled(HEAD, "VAL_ 1 A "),
    "DBC of 16 MB, signals of one message": filled(HEAD + "BO_ 5 M: 4095 A\n", SIGNAL),
    "DBC of 16 MB, signals of a used message": filled(HEAD + "BO_ 272 JoystickLeft: 8 A\n", SIGNAL),
    "DBC of 16 MB, quotes": filled(HEAD, '"'),
    "DBC of 16 MB, quotes in a string": filled(HEAD + '"', '\\"'),
    "DBC of 16 MB, empty lines": filled(HEAD, "\n"),
    "DBC of 16 MB, words": filled(HEAD, "a "),
    "DBC files, many": many_files,
}
"""By name; each is refused by ``canshaper check``."""
