# PID 1 on the host's root becomes systemd, whose lane.service runs the command.
$B rm -f /.dockerenv /run/.containerenv # or systemd takes this for a container
[ -s /etc/machine-id ] || $B tr -d - </proc/sys/kernel/random/uuid >/etc/machine-id
while read -r unit; do $B ln -sf /dev/null "/etc/systemd/system/$unit"; done </run/lane/masked
$B mkdir -p /run/systemd
$B cp -r /run/lane/units/. /run/systemd/
exec /lib/systemd/systemd --unit=lane.target </dev/console >/dev/console 2>&1
