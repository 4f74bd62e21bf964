# PID 1 on the host's root: what a booted system has, the CAN interfaces, then the command.
B=/run/lane/busybox
. /run/lane/settings
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root

$B mkdir -p /dev/pts /dev/shm
$B mount -t devpts -o mode=620,ptmxmode=666,gid=5 devpts /dev/pts
$B mount -t tmpfs -o mode=1777 shm /dev/shm
[ -e /dev/fd ] || $B ln -s /proc/self/fd /dev/fd
# modprobe, and what the kernel loads by itself, work for all modules
release=$($B uname -r)
$B mkdir -p "/lib/modules/$release"
$B mount --bind "$MODULES" "/lib/modules/$release"
$B hostname lane
if ! $IP -batch /run/lane/ip.batch; then
	echo "lane: setting up the CAN interfaces failed"
	$B sleep 0.2
	$B reboot -f
fi
. "/run/lane/$NEXT"
