"""Run parts of the test suite, each whether or not another fails, and print a table of them.

    tools/suite.py                  what `make test` runs
    tools/suite.py --all            what `make test-all` runs
    tools/suite.py types coverage   parts by name
    tools/suite.py --list           the parts

A part whose kernel, browser or program is not here and cannot be installed stands in the table with
the reason. The output of each part is kept in out/suite. JOBS=4 runs four processes side by side;
without it there are as many as processors. Exit status: 0 where all that ran is green, 1 otherwise,
2 for an unknown part, 130 after Ctrl-C.
"""

import argparse
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

from suite_parts import ROOT, Command, Part, rows_of_more, rows_of_test

from tests.lane.outcome import NO_LANE

OUT = ROOT / "out" / "suite"
STILL_S = 60.0  # between two lines of what still runs
GRACE_S = 20.0  # for processes that are interrupted


class Runner:
    """Runs rows of parts; `end` ends their processes."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen[str]] = []
        self._show = threading.Lock()

    def run(self, row: Sequence[Part]) -> None:
        """Run the parts of a row side by side; show the first as it runs, others when they end."""
        threads = [threading.Thread(target=self._part, args=(p, p is row[0])) for p in row]
        for thread in threads:
            thread.start()
        begin = last = time.monotonic()
        while any(thread.is_alive() for thread in threads):
            for thread in threads:
                thread.join(0.2)
            names = " ".join(p.name for p in row[1:] if p.status is None and not p.not_run)
            if names and row[0].status is not None and time.monotonic() - last > STILL_S:
                last = time.monotonic()
                print(f"-- still running after {last - begin:.0f} s: {names}", flush=True)

    def _part(self, part: Part, live: bool) -> None:
        begin, status = time.monotonic(), 0
        with (OUT / f"{part.name}.log").open("w") as log:
            for command in part.commands:
                ended = self._command(part, command, log.write, live)
                status = status or ended
        part.seconds, part.status = time.monotonic() - begin, status
        if status == NO_LANE:
            part.not_run = "no lane, see above"
        if not live:
            text = (OUT / f"{part.name}.log").read_text()
            with self._show:
                print(f"== {part.name}: {part.shows}\n{text}", end="", flush=True)

    def _command(
        self, part: Part, command: Command, keep: Callable[[str], object], live: bool
    ) -> int:
        with subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, **part.environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            bufsize=1,
            start_new_session=True,
        ) as process:
            self._running.append(process)
            assert process.stdout is not None
            line = ""
            while text := process.stdout.read(1):
                keep(text)
                if live:
                    print(text, end="", flush=text in ".\n")
                if text == "\n":
                    part.note(line)
                    line = ""
                else:
                    line += text
            return process.wait()

    def end(self) -> None:
        """Interrupt what still runs, as Ctrl-C does; kill it after 20 s."""
        still = [process for process in self._running if process.poll() is None]
        for process in still:
            _signal(process, signal.SIGINT)
        for process in still:
            with suppress(subprocess.TimeoutExpired):
                process.wait(GRACE_S)
            _signal(process, signal.SIGKILL)


def _signal(process: subprocess.Popen[str], number: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, number)


@contextmanager
def interruptible() -> Iterator[None]:
    """Let SIGTERM raise KeyboardInterrupt meanwhile, as Ctrl-C does."""

    def on_signal(number: int, _: object) -> None:
        raise KeyboardInterrupt(number)

    before = signal.signal(signal.SIGTERM, on_signal)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def run(rows: Sequence[Sequence[Part]]) -> None:
    """Prepare what the parts need; run, row by row, those that have it."""
    OUT.mkdir(parents=True, exist_ok=True)
    parts = [part for row in rows for part in row]
    answers: dict[Callable[[], str | None], str | None] = {}
    for part in parts:
        if part.absent not in answers:
            answers[part.absent] = part.absent()
        part.not_run = answers[part.absent]
    runner = Runner()
    try:
        for number, row in enumerate(rows, 1):
            there = [part for part in row if part.not_run is None]
            names = ", ".join(f"{part.name} ({part.shows})" for part in there)
            if there:
                print(f"== {number} of {len(rows)}: {names}", flush=True)
                runner.run(there)
    except KeyboardInterrupt:
        runner.end()
        raise


def table(parts: Sequence[Part]) -> str:
    """Return the table, then lines of what was not run, skipped or failed, and the sums."""
    form = "{:14} {:>7} {:>7} {:>8} {:>8}  {}"
    lines = [form.format("part", "passed", "failed", "skipped", "seconds", "result")]
    for part in parts:
        failed = part.counts["failed"] + part.counts["error"]
        numbers = (part.counts["passed"], failed, part.counts["skipped"])
        shown = [str(number) if sum(numbers) else "-" for number in numbers]
        lines.append(form.format(part.name, *shown, f"{part.seconds:.0f}", part.result))
    lines += [f"{part.name}: not run: {part.not_run}" for part in parts if part.not_run]
    for part in parts:
        lines += [f"{part.name}: skipped {n}: {why}" for why, n in part.skipped.most_common()]
        lines += [f"{part.name}: {line}" for line in part.failed]
        if part.status:
            lines.append(f"{part.name}: ended with {part.status}, see out/suite/{part.name}.log")
    total = sum((part.counts for part in parts), Counter[str]())
    failed = total["failed"] + total["error"]
    broken = any(part.status and not part.not_run for part in parts)
    failed += int(broken and not failed)  # lint or a gate: no test of it is counted
    lines.append(f"{total['passed']} passed, {failed} failed, {total['skipped']} skipped")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    """Run or list the parts that the arguments ask for; return the exit status."""
    text = (__doc__ or "").partition("\n\n")
    parser = argparse.ArgumentParser(
        description=text[0], epilog=text[2], formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART")
    parser.add_argument("--all", action="store_true", help="what `make test-all` runs")
    parser.add_argument("--list", action="store_true", help="print the parts")
    options = parser.parse_args(arguments)
    rows = rows_of_test()
    every = rows + rows_of_more()
    known = {part.name: part for row in every for part in row}
    if options.list:
        for part in known.values():
            print(f"{part.name:14} {part.shows}")
        return 0
    if options.parts:
        unknown = [name for name in options.parts if name not in known]
        if unknown:
            parser.error(f"{unknown[0]} is none of: {' '.join(known)}")
        rows = [[known[name]] for name in options.parts]
    elif options.all:
        # socketcan-all and browser-all have the others
        rows = [[known["lint"]], [known["fast"]], *rows_of_more()]
    # Tests start thousands of processes: each would compile all of canshaper.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    status = 0
    with interruptible():
        try:
            run(rows)
        except KeyboardInterrupt:
            status = 130
    parts = [part for row in rows for part in row]
    print(f"\n{table(parts)}", flush=True)
    if any(part.status and part.not_run is None for part in parts):
        status = status or 1
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
