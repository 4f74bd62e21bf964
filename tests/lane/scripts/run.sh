# Run the command. The control port says READY and EXIT <status>, each with the machine's uptime,
# and hears SIG <name>, to be sent to the command's process group.
B=/run/lane/busybox
. /run/lane/settings
# the command finds a system that has finished booting
[ "$NEXT" = run.sh ] || systemctl is-system-running --wait >/dev/null
exec 3<>"$CTL"
read -r up _ </proc/uptime
echo "READY $up" >&3
while read -r verb name <&3; do
	[ "$verb" = SIG ] && read -r pid </run/lane/pid && $B kill "-$name" -- "-$pid"
done &
listener=$!
# with clocks that count instructions: what has nothing else to do counts on
[ -z "$NEVER_IDLE" ] || chrt --idle 0 /bin/sh -c "while :; do :; done" 3>&- &
# in the foreground: a shell's background jobs begin with SIGINT ignored
$B setsid /bin/sh /run/lane/command </dev/null >"$OUT" 2>"$ERR" 3>&-
status=$?
kill "$listener"
[ -s /run/lane/shares ] && $B sync
read -r up _ </proc/uptime
echo "EXIT $status $up" >&3
$B reboot -f
