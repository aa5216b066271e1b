# Runs in the rig's guest: a disk that fails, turns read-only, and is pulled out and plugged in again,
# while atvrec records on it. What mends it is what a system does by itself: the device answers again,
# or is mounted again.
set -eu

ip link add vcan0 type vcan
ip link set vcan0 up
sectors=$(cat /sys/block/vda/size)
dmsetup create disk --table "0 $sectors linear /dev/vda 0"
dmsetup mknodes
mkdir /tmp/disk
mount -t ext4 /dev/mapper/disk /tmp/disk
mkdir /tmp/disk/logs

cat >/tmp/atvrec.toml <<'CONFIG'
[storage]
directory = "/tmp/disk/logs"
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
send() { cangen vcan0 -g 2 -n "$1" -I i -L 8 -D r; }
# What the recorder says and records while the disk fails.
while_failing() {
    until_disk_is failing
    send 250
    /rig/atvrec status --socket /tmp/control >"/rig/status-$1" || true
    send 250
}
# The table that answers for the disk from now on.
disk_answers() {
    dmsetup suspend --noflush --nolockfs disk
    dmsetup load disk --table "$1"
    dmsetup resume disk
}

candump -L -D -r 8000000 vcan0 >/tmp/candump.log &
peer=$!
/rig/atvrec record --config /tmp/atvrec.toml --json >/rig/summary.json 2>/rig/record.log &
recorder=$!
until_disk_is writing
sleep 1
send 250

echo "each write is an error"
disk_answers "0 $sectors error"
while_failing error
disk_answers "0 $sectors linear /dev/vda 0"
until_disk_is writing
send 250

echo "read-only"
echo u >/proc/sysrq-trigger
while_failing read-only
mount -o remount,rw /tmp/disk
until_disk_is writing
send 250

echo "pulled out"
device=$(basename "$(readlink -f /sys/block/vda/device)")
echo "$device" >/sys/bus/virtio/drivers/virtio_blk/unbind
until_disk_is failing
# Soon nothing of the recorder holds the dead disk.
tries=0
until umount /tmp/disk; do
    tries=$((tries + 1))
    [ "$tries" -lt 20 ] || exit 1
    sleep 0.1
done
dmsetup remove disk
while_failing pulled
echo "$device" >/sys/bus/virtio/drivers/virtio_blk/bind
disk=/dev/$(ls "/sys/bus/virtio/devices/$device/block")
# What a person would answer: names whose inodes were not yet written go.
fsck.ext4 -y "$disk" || true
mount -t ext4 "$disk" /tmp/disk
until_disk_is writing
send 250
sleep 1

kill -TERM "$recorder"
status=0
wait "$recorder" || status=$?
kill "$peer"
mkdir /rig/logs
cp /tmp/disk/logs/*.mcap* /rig/logs
umount /tmp/disk
cp /tmp/candump.log /rig/candump.log
echo "recorder ended with status $status"
