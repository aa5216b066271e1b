# Runs in the rig's guest: a disk of a few megabytes that somebody else fills up while atvrec records
# on it, and then makes room on again.
set -eu

ip link add vcan0 type vcan
ip link set vcan0 up
mkdir /tmp/disk
mount -t ext4 /dev/vda /tmp/disk

cat >/tmp/atvrec.toml <<'CONFIG'
[storage]
directory = "/tmp/disk"
[source.bus]
kind = "can"
interface = "vcan0"
[vehicle]
file = "prowler"
[control]
socket = "/tmp/control"
CONFIG

# Waits for the disk to be in state $1, as the recorder tells it.
until_disk_is() {
    waited=0
    until /rig/atvrec status --socket /tmp/control --json 2>/dev/null | grep -q "\"state\": \"$1\""; do
        sleep 0.3
        waited=$((waited + 1))
        [ "$waited" -lt 60 ] || { echo "the disk is not $1"; cat /rig/record.log; exit 1; }
    done
}

candump -L -D -r 8000000 vcan0 >/tmp/candump.log &
peer=$!
/rig/atvrec record --config /tmp/atvrec.toml --json >/rig/summary.json 2>/rig/record.log &
recorder=$!
until_disk_is writing
sleep 1
cangen vcan0 -g 2 -n 500 -I i -L 8 -D r

dd if=/dev/zero of=/tmp/disk/ballast bs=64k conv=fsync 2>/dev/null || true
dd if=/dev/zero of=/tmp/disk/ballast2 bs=512 conv=fsync 2>/dev/null || true
cangen vcan0 -g 2 -n 500 -I i -L 8 -D r
until_disk_is failing
/rig/atvrec status --socket /tmp/control >/rig/status-full || true
cangen vcan0 -g 2 -n 500 -I i -L 8 -D r

rm /tmp/disk/ballast /tmp/disk/ballast2
until_disk_is writing
cangen vcan0 -g 2 -n 500 -I i -L 8 -D r
sleep 1

kill -TERM "$recorder"
status=0
wait "$recorder" || status=$?
kill "$peer"
mkdir /rig/logs
cp /tmp/disk/*.mcap* /rig/logs
umount /tmp/disk
cp /tmp/candump.log /rig/candump.log
echo "$status" >/rig/recorder-status
