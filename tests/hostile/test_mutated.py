"""500 log, DBC and EDS files with a few bytes changed: read, or refused in words with the file."""

import random
from pathlib import Path

import pytest

from canshaper.commissioning.nodes.eds import Eds
from canshaper.commissioning.nodes.node import Node
from canshaper.errors import ConfigError, LogError
from canshaper.machine.database import load_dbc
from canshaper.recording.log import LogFile
from tests.commissioning.nodes.eds_files import JOYSTICK, eds
from tests.recording.test_of_loggers import LOGS
from tests.recording.test_of_strangers import TEXTS

COUNT = 500
FILES = LOGS | {name: text.encode() for name, text in TEXTS.items()}
FILES["a.eds"] = eds(JOYSTICK, 16).encode()
FILES["a.dbc"] = Path(__file__).parents[1].joinpath("fuzz", "small.dbc").read_bytes()
WORDS = [b"", b"-1", b"1e99", b"\xff", b"\0", b";", b",", b'"', b"\n", b"FFFFFFFF", b"nan", b"0x"]


def mutated(content: bytes, random_: random.Random) -> bytes:
    """With up to five places replaced, lost or doubled."""
    for _ in range(random_.randint(1, 5)):
        at, length = random_.randrange(len(content) + 1), random_.randrange(12)
        lost = content[at : at + length]
        new = random_.choice([*WORDS, lost * 2, random_.randbytes(length)])
        content = content[:at] + new + content[at + length :]
    return content


def read(path: Path) -> None:
    """By its suffix.

    Raises:
        ConfigError, LogError: it is refused.
    """
    if path.suffix == ".eds":
        Node(Eds(path), 16)
    elif path.suffix == ".dbc":
        if problems := load_dbc(path)[1]:
            raise ConfigError(problems)
    else:
        list(LogFile(path))


@pytest.mark.slow
def test_no_mutated_file_ends_in_another_exception(tmp_path: Path) -> None:
    refused = 0
    for seed in range(COUNT):
        name = list(FILES)[seed % len(FILES)]
        path = tmp_path / name
        path.write_bytes(mutated(FILES[name], random.Random(seed)))
        try:
            read(path)
        except (ConfigError, LogError) as error:
            refused += 1
            assert str(path) in str(error), (seed, error)
        except Exception as error:
            raise AssertionError(f"seed {seed}, {name}") from error
    assert COUNT // 5 < refused < COUNT  # changes that matter, and others
