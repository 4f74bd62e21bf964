"""Command line: options, choice of the lane, exit status."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from . import kernel, machine, native, packages
from .job import Job
from .outcome import OUTPUT_CLOSED, LaneError, NoLane, say


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = _parser()
    options = parser.parse_args(argv)
    try:
        if options.detect:
            return _detect(options.lane)
        if options.prepare:
            return _prepare(options.lane)
        return _run(_job(parser, options), _choose(options.lane))
    except LaneError as error:
        if error.log:
            say(f"the last it said:\n{error.log}")
        say(error)
        return error.status
    except BrokenPipeError:  # nobody reads our output any more
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return OUTPUT_CLOSED
    except KeyboardInterrupt:  # while nothing ran yet
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.lane",
        usage="python -m tests.lane [options] -- COMMAND [ARG...]",
        description="Run a command where SocketCAN exists.",
        epilog="Exit status: the command's; 124 time limit, 125 the lane failed, 77 no lane here.",
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("--lane", choices=("auto", "native", "tcg"), default="auto")
    add("--detect", action="store_true", help="say which lane this machine gets, and why")
    add("--prepare", action="store_true", help="only install and download what is missing")
    add("--rw", action="append", default=[], metavar="DIR", help="host directory to write to")
    add("--timeout", type=float, default=900, metavar="S", help="for the command; 0: none")
    add("--grace", type=float, default=10, metavar="S", help="from TERM or INT to ending it")
    add("--boot-timeout", type=float, default=120, metavar="S")
    add("--mem", type=int, default=1024, metavar="MIB", help="the machine's memory")
    add("--kvaser", type=int, default=2, metavar="N", help="controllers; each two share a bus")
    add("--append", action="append", default=[], metavar="ARG", help="kernel argument")
    add("--verbose", "-v", action="store_true", help="print the qemu command and the times")
    add("command", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    return parser


def _job(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Job:
    command = options.command[1:] if options.command[:1] == ["--"] else options.command
    if not command:
        parser.error("no command")
    writable = tuple(Path(folder).resolve() for folder in options.rw)
    for folder in writable:
        if not folder.is_dir() or "\n" in str(folder):
            parser.error(f"--rw {folder}: not a directory")
    return Job(
        command=tuple(command),
        cwd=Path.cwd(),
        writable=writable,
        timeout_s=options.timeout,
        grace_s=options.grace,
        boot_timeout_s=options.boot_timeout,
        memory_mib=options.mem,
        kvaser=options.kvaser,
        kernel_args=tuple(options.append),
        verbose=options.verbose,
    )


def _choose(lane: str) -> str:
    """Return the lane to take; raise NoLane with every reason if there is none."""
    reasons = []
    for name, module in (("native", native), ("tcg", machine)):
        if lane in ("auto", name):
            reason = module.obstacle()
            if reason is None:
                return name
            reasons.append(f"{name}: {reason}")
    raise NoLane("no lane on this machine. " + "; ".join(reasons))


def _run(job: Job, lane: str) -> int:
    if lane == "native":
        if job.kernel_args:
            raise LaneError("--append: the native lane boots no kernel")
        with packages.cache_lock():
            packages.install_test_tools()
        return native.run(job)
    return machine.run(job)


def _detect(lane: str) -> int:
    for name, module in (("native", native), ("tcg", machine)):
        reason = module.obstacle()
        print(f"{name}: {'no, ' + reason if reason else 'yes'}")
    image = kernel.cached()
    print(f"kernel for tcg: {image.version if image else 'none yet, would be downloaded'}")
    print(f"lane: {_choose(lane)}")
    return 0


def _prepare(lane: str) -> int:
    if _choose(lane) == "tcg":
        image, _ = machine.prepare()
        say("tcg is ready, kernel", image.version)
    else:
        with packages.cache_lock():
            packages.install_test_tools()
        say("native is ready")
    return 0
