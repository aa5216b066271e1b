# Runs in the rig's guest, under systemd: the service as a user would have it, from its package if
# /rig/atvrec.deb is there, else from the files that the package is made of.
set -eu
say() { echo "== $*"; }
now() { awk '{print $1}' /proc/uptime; }
since() { awk -v a="$1" '{printf "%.2f", $1 - a}' /proc/uptime; }
main_pid() { systemctl show -P MainPID atvrec; }
wait_for() { # what, command...
    what=$1
    shift
    for _ in $(seq 150); do
        if "$@" >/dev/null 2>&1; then return; fi
        sleep 0.2
    done
    echo "waited in vain for $what"
    journalctl -u 'atvrec*' --no-pager | tail -n 40
    exit 1
}

say install
. /rig/install.sh
id atvrec
useradd -G atvrec member
useradd stranger

say configure
cat >>/etc/atvrec/atvrec.toml <<'CONFIG'
[source.middle]
kind = "can"
interface = "vcan0"
[source.wire]
kind = "can"
interface = "can1"
link.bitrate = 1000000
[source.imu]
kind = "crossbow440"
device = "/dev/ttyS1"
baud = 57600
configure = false
CONFIG
ip link add vcan0 type vcan
ip link set vcan0 up
ip link set can0 type can bitrate 1000000 restart-ms 100
ip link set can0 up
atvrec check --no-devices /etc/atvrec/atvrec.toml

say start
begin=$(now)
systemctl start atvrec
echo "started in $(since "$begin") s"
udevadm trigger --action=add /sys/class/net/can1
wait_for "can1 brought up by its unit" sh -c 'ip link show can1 | grep -q "state UP"'
systemctl show -P Result atvrec-can@can1.service
[ "$(systemctl show -P Result atvrec-clock)" = success ]
cat /run/atvrec-clock/state
systemctl start atvrec-live
for unit in atvrec.service atvrec-clock.service atvrec-can@can1.service atvrec-live.service; do
    systemd-analyze security --no-pager "$unit" >"/rig/security.$unit"
    tail -n 1 "/rig/security.$unit"
done
grep -E '^(Uid|CapEff|CapBnd|NoNewPrivs)' "/proc/$(main_pid)/status"

say "who may ask"
ls -ld /run/atvrec /run/atvrec/control /var/lib/atvrec
runuser -u member -- atvrec mark "by a member" --socket /run/atvrec/control
if runuser -u stranger -- atvrec status --socket /run/atvrec/control; then
    echo "a stranger may ask"
    exit 1
fi

say "live page"
page() { # prints the first line of the answer
    bash -c 'exec 3<>/dev/tcp/127.0.0.1/8765
        printf "GET / HTTP/1.1\r\nHost: 127.0.0.1:8765\r\nConnection: close\r\n\r\n" >&3
        head -n 1 <&3'
}
page | tee /rig/page
live_pid=$(systemctl show -P MainPID atvrec-live)
grep -E '^(Uid|CapEff|NoNewPrivs)' "/proc/$live_pid/status"
# All frames below are recorded although the live process reads nothing.
kill -STOP "$live_pid"

say traffic
cangen can0 -g 10 -n 100 -I 123 -L 8 -D i &
cangen vcan0 -g 2 -n 3000 -I 100 -L 8 -D i &
sender=$!
sleep 1
cat >>/etc/atvrec/atvrec.toml <<'CONFIG'
[source.added]
kind = "can"
interface = "vcan1"
CONFIG
begin=$(now)
systemctl reload atvrec
echo "reloaded in $(since "$begin") s"
echo '[source.broken]' >/tmp/broken
cp /etc/atvrec/atvrec.toml /tmp/good
cat /tmp/broken >>/etc/atvrec/atvrec.toml
if systemctl reload atvrec; then
    echo "a wrong configuration was taken"
    exit 1
fi
cp /tmp/good /etc/atvrec/atvrec.toml
wait "$sender"
runuser -u member -- atvrec status --socket /run/atvrec/control
sleep 1

say "live page after a stop"
kill -CONT "$live_pid"
wait_for "the page" sh -c 'systemctl is-active atvrec-live'
page
systemctl stop atvrec-live
[ "$(systemctl show -P Result atvrec-live)" = success ]

say "orderly stop"
begin=$(now)
systemctl stop atvrec
# No more than TimeoutStopSec, else the result is another; how long is for the reader, as the
# processor is emulated.
echo "stopped in $(since "$begin") s"
[ "$(systemctl show -P Result atvrec)" = success ]
mkdir /rig/orderly
cp /var/lib/atvrec/*.mcap /rig/orderly/
ls -l /var/lib/atvrec
rm /var/lib/atvrec/*

say "kill"
systemctl start atvrec
sleep 3
kill -KILL "$(main_pid)"
begin=$(now)
wait_for "the restart after a kill" atvrec status --socket /run/atvrec/control
echo "back after $(since "$begin") s"
wait_for "the recovery" sh -c 'ls /var/lib/atvrec/*.mcap'

say "watchdog"
restarts=$(systemctl show -P NRestarts atvrec)
kill -STOP "$(main_pid)"
begin=$(now)
wait_for "the watchdog" sh -c '[ "$(systemctl show -P NRestarts atvrec)" -gt '"$restarts"' ]'
wait_for "the restart after the watchdog" atvrec status --socket /run/atvrec/control
echo "back after $(since "$begin") s"
# A stop abandons a recovery.
wait_for "the second recovery" sh -c '[ "$(ls /var/lib/atvrec/*.active | wc -l)" -le 1 ]'
systemctl stop atvrec
mkdir /rig/recovered
cp /var/lib/atvrec/*.mcap /rig/recovered/
if ls /var/lib/atvrec/*.active 2>/dev/null; then
    echo "a log was left unfinished"
    exit 1
fi
journalctl -u atvrec -o json --no-pager >/rig/journal
