"""500 log, DBC and EDS files with a few bytes changed: read, or refused in words with the file."""

import random
from collections.abc import Callable, Iterator
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
DBC = Path(__file__).parents[1] / "fuzz" / "small.dbc"
WORDS = [b"", b"-1", b"1e99", b"\xff", b"\0", b";", b",", b'"', b"\n", b"FFFFFFFF", b"nan", b"0x"]


def mutated(content: bytes, random_: random.Random) -> bytes:
    """With up to five places replaced, lost or doubled."""
    for _ in range(random_.randint(1, 5)):
        at, length = random_.randrange(len(content) + 1), random_.randrange(12)
        lost = content[at : at + length]
        new = random_.choice([*WORDS, lost * 2, random_.randbytes(length)])
        content = content[:at] + new + content[at + length :]
    return content


def read_dbc(path: Path) -> None:
    _, problems = load_dbc(path)
    for problem in problems:
        raise ConfigError([problem])


def read_eds(path: Path) -> None:
    Node(Eds(path), 16)


def read_log(path: Path) -> None:
    for _ in LogFile(path):
        pass


def files() -> Iterator[tuple[str, bytes, Callable[[Path], None]]]:
    """Names, contents and readers."""
    yield "a.eds", eds(JOYSTICK, 16).encode("latin-1"), read_eds
    yield "a.dbc", DBC.read_bytes(), read_dbc
    for name, content in {**LOGS, **{n: t.encode() for n, t in TEXTS.items()}}.items():
        yield name, content, read_log


@pytest.mark.slow
def test_no_mutated_file_ends_in_another_exception(tmp_path: Path) -> None:
    sources, refused = list(files()), 0
    for seed in range(COUNT):
        random_ = random.Random(seed)
        name, content, read = sources[seed % len(sources)]
        path = tmp_path / name
        path.write_bytes(mutated(content, random_))
        try:
            read(path)
        except (ConfigError, LogError) as error:
            refused += 1
            assert str(path) in str(error), (seed, error)
        except Exception as error:
            raise AssertionError(f"seed {seed}, {name}") from error
    assert COUNT // 5 < refused < COUNT  # changes that matter, and others
