#!/bin/busybox sh
# PID 1 in the initramfs: load the modules, lay a tmpfs over the host's root, go there.
B=/bin/busybox
$B mount -t proc proc /proc
$B mount -t sysfs sys /sys
$B mount -t devtmpfs dev /dev
. /lane/settings

die() {
	echo "lane: $* failed"
	$B sleep 0.2 # the console is a serial line: let it end its work
	$B reboot -f
}

share() { # tag, directory, options
	$B mount -t 9p -o "trans=virtio,version=9p2000.L,msize=262144,access=any,$3" "$1" "$2" ||
		die "mounting $2"
}

for module in /modules/*.ko; do $B insmod "$module" || die "insmod $module"; done
share root /lower ro,cache=loose
$B mount -t tmpfs -o mode=755,size=90% upper /upper
$B mkdir -p /upper/upper /upper/work
$B mount -t overlay -o lowerdir=/lower,upperdir=/upper/upper,workdir=/upper/work overlay /newroot ||
	die "mounting the overlay"
cd /newroot || die "cd /newroot"
$B mkdir -p proc sys dev run
$B mount -t tmpfs -o mode=755 run run
$B mkdir -p run/lane run/lock
$B cp -a /lane/. run/lane/
$B cp /bin/busybox run/lane/busybox
number=0
while read -r folder; do
	share "share$number" "/newroot$folder" rw,cache=mmap
	number=$((number + 1))
done </lane/shares
for folder in proc sys dev; do $B mount --move "/$folder" "/newroot/$folder"; done
exec $B switch_root /newroot /run/lane/busybox sh /run/lane/root.sh
