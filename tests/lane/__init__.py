"""Run a command where SocketCAN exists: ``python -m tests.lane [options] -- COMMAND [ARG...]``.

Two lanes lead there; ``--lane auto`` takes the first that this machine has:

native
    The kernel has vcan: the command runs in a private network namespace.
tcg
    A small virtual machine (qemu, pure emulation) boots a Debian kernel in seconds. The host's
    root is there read-only under a tmpfs overlay, so the command finds the same working
    directory, environment and virtual environment; what it writes is lost, except under the
    directories given with ``--rw``. Two emulated Kvaser controllers share one CAN bus.

Inside, vcan0, vcan1 and the pair vxcan0 <-> vxcan1 are up; in the tcg lane also can0 and can1
(250 kbit/s, can0 <-> can1), and modprobe works for the kernel's other modules (slcan, can-gw,
sch_tbf, ...). The environment says where one is: ``CANSHAPER_LANE`` (native or tcg),
``CANSHAPER_VCAN``, ``CANSHAPER_VXCAN`` and ``CANSHAPER_CAN`` (names of the interfaces, separated
by spaces; the last empty if native).

Three options ask for a special machine, always in the tcg lane:

--systemd
    The host's systemd is PID 1 on the overlay and has finished booting when the command runs as a
    service of its own; ``CANSHAPER_SYSTEMD`` is 1. Units, networkd, udev's device units and the
    journal work, and so does ``dpkg -i``. Host services are not started.
--bench
    Virtual time: 1 ns for each executed instruction, none while idle. A latency is the number of
    instructions on its path, kernel included: repeatable on any host, but no caches, no memory and
    no bus time. Compare medians after a warm-up; give processes different FIFO priorities. While
    the machine waits for a file of the host, its clock runs ahead: time limits may fire early.
--kernel rt
    Debian's PREEMPT_RT kernel.

The exit status is the command's (128 + N if signal N ended it), or 124 time limit, 125 the lane
failed, 77 no lane can be had on this machine. Ctrl-C and TERM go to the command; a second one
ends the lane at once. An emulated Python is some 16 times slower than the host's.

Where things are: cli (options, choice of the lane), job (what to run), watch (time limit and
signals), owned (child processes that cannot outlive us), native (that lane), machine (the tcg
lane's run), qemu (its command line), initramfs and scripts/ (the guest's side), systemd (what
--systemd adds), kernel and packages (what is downloaded or installed), hil and services (run
tests/hil in a lane and tests/systemd under systemd, both by suite).
"""
