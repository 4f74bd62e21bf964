"""Command line: options, choice of the lane, exit status."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from . import kernel, machine, native, packages, systemd
from .job import Job
from .outcome import OUTPUT_CLOSED, LaneError, NoLane, say

MEMORY_MIB = 1024


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = _parser()
    options = parser.parse_args(argv)
    needed_for = _machine_needed_for(options)
    if options.lane == "native" and needed_for:
        parser.error(f"{needed_for}: the native lane boots no kernel")
    try:
        if options.detect:
            return _detect(options)
        if options.prepare:
            return _prepare(options)
        return _run(_job(parser, options), _choose(options))
    except LaneError as error:
        if error.log:
            say(f"the last it said:\n{error.log}")
        say(error)
        return error.status
    except BrokenPipeError:  # no one reads our output any more
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return OUTPUT_CLOSED
    except KeyboardInterrupt:  # while nothing ran yet
        return 130


def _machine_needed_for(options: argparse.Namespace) -> str | None:
    """Return the option that only a machine of its own can fulfil, if there is one."""
    special = {
        "--systemd": options.systemd,
        "--bench": options.bench,
        "--steady": options.steady,
        "--kernel rt": options.kernel == "rt",
        "--append": options.append,
    }
    return next((option for option, value in special.items() if value), None)


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
    add("--boot-timeout", type=float, default=300, metavar="S")
    add("--systemd", action="store_true", help="systemd is PID 1, the command runs as a service")
    add("--bench", action="store_true", help="repeatable latencies: 1 ns for each instruction")
    add("--steady", action="store_true", help="a time of its own: a busy host makes nothing late")
    add("--kernel", choices=tuple(kernel.META_PACKAGES), default="std", help="rt: PREEMPT_RT")
    memory = f"the machine's memory (default {MEMORY_MIB}, with --systemd {systemd.MEMORY_MIB})"
    add("--mem", type=int, metavar="MIB", help=memory)
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
        memory_mib=options.mem or (systemd.MEMORY_MIB if options.systemd else MEMORY_MIB),
        kernel=options.kernel,
        systemd=options.systemd,
        bench=options.bench,
        steady=options.steady,
        kvaser=options.kvaser,
        kernel_args=tuple(options.append),
        verbose=options.verbose,
    )


def _obstacles(options: argparse.Namespace) -> dict[str, str | None]:
    """Return for every lane why it cannot be used, or None if it can."""
    needed_for = _machine_needed_for(options)
    native_obstacle = f"{needed_for} needs a machine" if needed_for else native.obstacle()
    return {"native": native_obstacle, "tcg": machine.obstacle(options.kernel, options.systemd)}


def _choose(options: argparse.Namespace) -> str:
    """Return the lane to take; raise NoLane with every reason if there is none."""
    expected = {
        name: reason
        for name, reason in _obstacles(options).items()
        if options.lane in ("auto", name)
    }
    for name, reason in expected.items():
        if reason is None:
            return name
    raise NoLane("no lane on this machine. " + "; ".join(f"{n}: {r}" for n, r in expected.items()))


def _run(job: Job, lane: str) -> int:
    if lane == "native":
        with packages.cache_lock():
            packages.install_test_tools()
        return native.run(job)
    return machine.run(job)


def _detect(options: argparse.Namespace) -> int:
    for name, reason in _obstacles(options).items():
        print(f"{name}: {'no, ' + reason if reason else 'yes'}")
    image = kernel.cached(options.kernel)
    print(f"kernel for tcg: {image.version if image else 'none yet, would be downloaded'}")
    print(f"lane: {_choose(options)}")
    return 0


def _prepare(options: argparse.Namespace) -> int:
    if _choose(options) == "tcg":
        image, _ = machine.prepare(options.kernel, options.systemd)
        say("tcg is ready, kernel", image.version)
    else:
        with packages.cache_lock():
            packages.install_test_tools()
        say("native is ready")
    return 0
