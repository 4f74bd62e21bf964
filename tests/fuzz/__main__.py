"""Coverage-guided fuzzing with atheris: ``python -m tests.fuzz TARGET --seconds 60``.

    frames      any frames at any time against the controller, under the judge of tests/faults
    ports       any bytes and any errors out of the sockets of a bus
    deployment  changes of a deployment file
    dbc         changes of a DBC file
    yaml        any bytes as a deployment file

A crash is kept in out/fuzz/TARGET and printed; ``python -m tests.fuzz TARGET FILE`` runs it again.
The inputs that found something new are kept there too, and the next run starts with them.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import atheris

# What reads the inputs is watched for new ways through it.
with atheris.instrument_imports(include=["canshaper", "cantools"]):
    from tests.fuzz import frames, ports
    from tests.fuzz.files import SMALL, Files, texts
    from tests.fuzz.mutate import DBC_WORDS, YAML_WORDS, changed

OUT = Path(__file__).parents[2] / "out" / "fuzz"
YAML, DBC = texts(SMALL)
MOST_CHANGES = 12


def _changes(source: frames.Bytes, words: tuple[str, ...]) -> Iterator[tuple[int, int, str]]:
    for _ in range(1 + source.number() % MOST_CHANGES):
        yield source.number(2), source.number(2), words[source.number() % len(words)]


class Targets:
    """Every target: bytes in, an exception where something is wrong."""

    def __init__(self, directory: Path) -> None:
        self._files = Files(directory)

    def frames(self, data: bytes) -> None:
        frames.run(data)

    def ports(self, data: bytes) -> None:
        ports.run(data)

    def deployment(self, data: bytes) -> None:
        text = changed(YAML, list(_changes(frames.Bytes(data), YAML_WORDS)))
        self._files.load(text.encode("utf-8", errors="surrogatepass"), DBC.encode())

    def dbc(self, data: bytes) -> None:
        text = changed(DBC, list(_changes(frames.Bytes(data), DBC_WORDS)))
        self._files.load(YAML.encode(), text.encode("cp1252", errors="replace"))

    def yaml(self, data: bytes) -> None:
        self._files.load(data, DBC.encode())


def seeds(target: str) -> list[bytes]:
    """Inputs to begin with: what a healthy drive and a valid file look like."""
    if target == "frames":
        drive = bytes([110, 0] * 3 + [110, 90] * 8 + [0] * 8 + [111, 50] * 4)
        return [bytes([n]) + drive for n in range(len(frames.NAMES))]
    if target == "ports":
        return [bytes([1, 190, 0, 220, 0]), bytes([0, 171, 0, 220, 0, 80, 1])]
    if target == "yaml":
        return [YAML.encode()]
    return [bytes([0, n, 7, n, 3, n]) * (n % 5) for n in range(40)]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("target", choices=("frames", "ports", "deployment", "dbc", "yaml"))
    parser.add_argument("again", type=Path, nargs="?", help="run this input again, nothing else")
    parser.add_argument("--seconds", type=int, default=60, help="time limit")
    options = parser.parse_args()
    work = OUT / options.target / "work"
    work.mkdir(parents=True, exist_ok=True)
    act: Callable[[bytes], None] = getattr(Targets(work), options.target)
    if options.again:
        act(options.again.read_bytes())
        print(f"{options.again}: nothing wrong")
    else:
        _fuzz(options.target, act, options.seconds)


def _fuzz(target: str, act: Callable[[bytes], None], seconds: int) -> None:
    place = OUT / target
    corpus = place / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds(target)):
        (corpus / f"seed-{number}").write_bytes(seed)

    def guarded(data: bytes) -> None:
        try:
            act(data)
        except Exception:
            crash = place / "crash"
            crash.write_bytes(data)
            print(f"\n{target}: {data!r}\nagain: python -m tests.fuzz {target} {crash}\n")
            raise

    arguments = [sys.argv[0], f"-max_total_time={seconds}", "-max_len=2000", "-timeout=20"]
    arguments += [f"-artifact_prefix={place}/", "-print_final_stats=1", str(corpus)]
    atheris.Setup(arguments, guarded)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
