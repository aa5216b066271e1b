# Runs in the rig's guest, whose clock counts instructions (rig boot --count), so that "within a
# second" does not hang on the host: buses and a USB adapter that go down, vanish, babble and fail, a
# line full of garbage, and a wall clock that jumps, while a peer sends on each without a pause.
set -eu
until [ -e /dev/ttyUSB0 ]; do sleep 0.1; done
ip link add vcan0 type vcan
ip link set vcan0 up
peer_up() {
    ip link set can0 type can bitrate 1000000 restart-ms 100
    ip link set can0 up
}
peer_up
cat >/tmp/atvrec.toml <<'CONFIG'
[storage]
directory = "/rig/logs"
[source.wire]
kind = "can"
interface = "can1"
dbc = []
link.bitrate = 1000000
[source.bus]
kind = "can"
interface = "vcan0"
[source.imu]
kind = "crossbow440"
device = "/dev/ttyUSB0"
baud = 57600
configure = false
CONFIG
/rig/atvrec record --config /tmp/atvrec.toml --json >/rig/summary.json 2>/rig/record.log &
recorder=$!
until /rig/atvrec status --config /tmp/atvrec.toml >/dev/null 2>&1; do sleep 0.1; done
mark() { /rig/atvrec mark "$1" --config /tmp/atvrec.toml; }

send() { while cangen can0 -g 20 -n 1000000 -I 123 -L 8 -D i 2>/dev/null || true; do sleep 0.05; done; }
send &
sender=$!
# What the inertial unit says: its packets, garbage, or packets at another bit rate.
say() { echo "$1" >/tmp/says; }
say packets
python3 /rig/speak.py /dev/ttyS1 /rig/packets /tmp/says &
unit=$!
sleep 3

mark down
ip link set can1 down
sleep 3

mark unplugged
for device in /sys/bus/pci/drivers/kvaser_pci/0000:*; do basename "$device"; done >/tmp/devices
while read -r device; do echo "$device" >/sys/bus/pci/drivers/kvaser_pci/unbind; done </tmp/devices
adapter=$(basename "$(readlink -f /sys/class/tty/ttyUSB0/device/../..)")
echo "$adapter" >/sys/bus/usb/drivers/usb/unbind
sleep 2
while read -r device; do echo "$device" >/sys/bus/pci/drivers/kvaser_pci/bind; done </tmp/devices
echo "$adapter" >/sys/bus/usb/drivers/usb/bind
peer_up
mark plugged
sleep 3

mark babbling
cangen vcan0 -g 0 -n 30000 -i -I i -L 8 -D i
mark bus-off
# Error frames as a controller sends them: bus-off, then restarted.
cansend vcan0 20000040#0000000000000000
cansend vcan0 20000100#0000000000000000
sleep 1

mark garbage
say garbage
sleep 150
say packets
mark "packets after garbage"
sleep 2
mark "another bit rate"
say mismatch
sleep 10
say packets
mark "packets at the right bit rate"
sleep 2

mark "clock to 2002"
now=$(date +%s)
date -s @1009843200 >/dev/null
sleep 1.5
mark "clock right again"
date -s "@$((now + 2))" >/dev/null
sleep 1
mark "small step"
date -s "@$(($(date +%s) - 1))" >/dev/null
sleep 1
mark "GPS week rollover"
date -s '2038-11-20 23:59:40' >/dev/null
sleep 4
mark "leap second"
date -s '2026-12-31 23:59:58' >/dev/null
python3 - <<'PYTHON'
import ctypes, struct

STATUS, INSERT = 0x0010, 0x0010  # ADJ_STATUS, STA_INS
timex = bytearray(208)
struct.pack_into("I", timex, 0, STATUS)
struct.pack_into("i", timex, 40, INSERT)
buffer = (ctypes.c_char * len(timex)).from_buffer(timex)
print("leap second asked for, state", ctypes.CDLL(None, use_errno=True).adjtimex(buffer))
PYTHON
sleep 4
mark end

kill "$sender" "$unit"
kill -TERM "$recorder"
status=0
wait "$recorder" || status=$?
echo "recorder ended with status $status"
exit "$status"
