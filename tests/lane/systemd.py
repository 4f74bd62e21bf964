"""The machine with a real systemd as PID 1: what ``--systemd`` adds to the tcg lane.

The host's own systemd boots on the overlay over the host's root; no image is built. Units that
serve hardware, caches or the network of a real host are masked: with them an emulated processor
boots several times as long, and some change what the command finds.
"""

from pathlib import Path

UNITS = Path(__file__).parent / "scripts" / "units"  # copied to /run/systemd
MEMORY_MIB = 2048  # what is installed inside, and the journal, lies in it
# What the host must have: program and Debian package. Without dbus, systemd-run cannot wait.
TOOLS = {"systemctl": "systemd", "udevadm": "udev", "dbus-daemon": "dbus"}
# The host's disks and swap are not there; waiting for them would take 90 s.
KERNEL_ARGS = (
    *("fstab=no", "luks=no", "systemd.gpt_auto=no", "systemd.swap=no"),
    *("systemd.firstboot=no", "systemd.hostname=lane", "systemd.show_status=error"),
)
MASKED = (
    # would empty /tmp (the working directory may be there) or walk through the host's files
    *("systemd-tmpfiles-setup.service", "systemd-tmpfiles-setup-dev.service"),
    *("systemd-tmpfiles-setup-dev-early.service", "systemd-tmpfiles-clean.timer", "tmp.mount"),
    # caches and files of the host: as they are
    *("ldconfig.service", "systemd-hwdb-update.service", "systemd-journal-catalog-update.service"),
    *("systemd-update-done.service", "systemd-sysusers.service", "systemd-firstboot.service"),
    *("systemd-machine-id-commit.service", "systemd-journal-flush.service"),
    *("systemd-update-utmp.service", "systemd-random-seed.service"),
    # hardware, firmware and file systems that the machine does not have
    *("systemd-pstore.service", "systemd-boot-system-token.service", "systemd-repart.service"),
    *("systemd-pcrphase-sysinit.service", "systemd-remount-fs.service"),
    *("keyboard-setup.service", "console-setup.service", "getty.target"),
    *("dev-hugepages.mount", "dev-mqueue.mount", "sys-kernel-debug.mount"),
    *("sys-kernel-tracing.mount", "sys-kernel-config.mount", "sys-fs-fuse-connections.mount"),
    # the host's policy, and drivers or settings that tests set themselves
    *("apparmor.service", "systemd-binfmt.service", "proc-sys-fs-binfmt_misc.automount"),
    *("systemd-modules-load.service", "systemd-sysctl.service", "kmod-static-nodes.service"),
    "systemd-timesyncd.service",
)


def files() -> dict[str, bytes]:
    """Return the files of this mode by their name below /run/lane."""
    units = {
        f"units/{path.relative_to(UNITS)}": path.read_bytes()
        for path in sorted(UNITS.rglob("*"))
        if path.is_file()
    }
    return {"masked": "".join(f"{unit}\n" for unit in MASKED).encode(), **units}
