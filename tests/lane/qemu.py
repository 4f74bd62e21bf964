"""The command line of the virtual machine."""

from collections.abc import Mapping
from pathlib import Path

from . import systemd
from .job import Job
from .kernel import Kernel
from .packages import which

KERNEL_ARGS = (
    *("console=ttyS0", "quiet", "loglevel=3", "panic=-1", "net.ifnames=0", "audit=0"),
    # without these the boot takes longer: checks and mitigations that mean nothing here
    *("mitigations=off", "nowatchdog", "tsc=reliable", "no_timer_check", "cryptomgr.notests"),
    "rcupdate.rcu_expedited=1",
)
# q35 without USB and SATA boots 0.6 s sooner than pc, Nehalem 0.3 s sooner than max. SSE4.2 is what
# NumPy is built for; without rdrand the first getrandom() costs a second.
MACHINE = "q35,usb=off,vmport=off,sata=off"
PROCESSOR = "Nehalem-v1,+rdrand"
# One CPU: two emulated ones on a busy two-core host wait for each other's time slices.
ACCELERATOR = "tcg,thread=single,tb-size=512"
# One instruction takes 1 ns and idle time none, whatever else the host does; no random addresses.
BENCH = ("-icount", "shift=0,sleep=off", "-rtc", "base=2026-01-01T00:00:00,clock=vm")
# An instruction takes 2 ns, and the processor is never idle (scripts/run.sh): no host is too slow
# for what runs there, and what waits for the host's files sees no jumps.
STEADY = ("-icount", "shift=1,sleep=off", "-rtc", "base=utc,clock=vm")
BENCH_KERNEL_ARGS = ("norandmaps", "nokaslr", "clocksource=tsc")
SHARE = "local,security_model=none,multidevs=remap"


def command_line(
    job: Job, kernel: Kernel, initramfs: Path, console: Path, ports: Mapping[str, int]
) -> list[str]:
    """Return the command; ``ports`` maps each port's name to our file descriptor for it.

    The ports become /dev/vport0p1, 2, ... in their order.
    """
    words = [which("qemu-system-x86_64") or "qemu-system-x86_64"]
    words += ["-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"]
    words += ["-M", MACHINE, "-cpu", PROCESSOR, "-accel", ACCELERATOR]
    words += ["-m", str(job.memory_mib), *_clock(job)]
    words += ["-kernel", str(kernel.image), "-initrd", str(initramfs)]
    words += ["-append", " ".join(_kernel_args(job))]
    words += ["-chardev", f"file,id=console,path={_escaped(console)}"]
    words += ["-serial", "chardev:console"]
    # before other virtio devices, so that its ports are numbered vport0
    words += ["-device", "virtio-serial-pci,id=ports,max_ports=8"]
    for number, (name, fd) in enumerate(ports.items(), 1):
        words += ["-chardev", f"socket,id={name},fd={fd}"]
        words += ["-device", f"virtserialport,bus=ports.0,nr={number},chardev={name},name={name}"]
    words += _share("root", Path("/"), ",readonly=on")
    for number, folder in enumerate(job.writable):
        words += _share(f"share{number}", folder, "")
    for bus in range((job.kvaser + 1) // 2):
        words += ["-object", f"can-bus,id=bus{bus}"]
    for number in range(job.kvaser):
        words += ["-device", f"kvaser_pci,canbus=bus{number // 2}"]
    return words


def _clock(job: Job) -> tuple[str, ...]:
    if job.bench:
        return BENCH
    return STEADY if job.steady else ("-rtc", "base=utc")


def _kernel_args(job: Job) -> list[str]:
    args = list(KERNEL_ARGS)
    if job.systemd:
        args += systemd.KERNEL_ARGS
    if job.bench:
        args += BENCH_KERNEL_ARGS
    return [*args, *job.kernel_args]


def _share(tag: str, folder: Path, more: str) -> list[str]:
    return [
        *("-fsdev", f"{SHARE},id={tag},path={_escaped(folder)}{more}"),
        *("-device", f"virtio-9p-pci,fsdev={tag},mount_tag={tag}"),
    ]


def _escaped(path: Path) -> str:
    return str(path).replace(",", ",,")
