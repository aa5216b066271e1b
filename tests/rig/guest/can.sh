# Runs in the rig's guest: five CAN interfaces recorded by atvrec and, beside it, by candump.
set -eu

for bus in vcan0 vcan1 vcan2; do
    ip link add "$bus" type vcan
    ip link set "$bus" mtu 72
    ip link set "$bus" up
done
ip link set can0 type can bitrate 1000000 restart-ms 100
ip link set can0 up

cat >/tmp/atvrec.toml <<'CONFIG'
[storage]
directory = "/rig/logs"
[source.virtual0]
kind = "can"
interface = "vcan0"
[source.virtual1]
kind = "can"
interface = "vcan1"
[source.virtual2]
kind = "can"
interface = "vcan2"
[source.wire]
kind = "can"
interface = "can1"
dbc = []
[source.wire.link]
bitrate = 1000000
restart_ms = 100
CONFIG

# Waits until the recorder has brought can1 up.
until_up() {
    waited=0
    until ip link show can1 | grep -q "state UP"; do
        sleep 0.1
        waited=$((waited + 1))
        [ "$waited" -lt 300 ] || { echo "can1 stays down"; cat /rig/record.log; exit 1; }
    done
}

candump -L -D -r 8000000 vcan0 vcan1 vcan2 can1 >/tmp/candump.log &
peer=$!
/rig/atvrec record --config /tmp/atvrec.toml --json >/rig/summary.json 2>/rig/record.log &
recorder=$!
waited=0
until ls /rig/logs/* >/dev/null 2>&1; do
    sleep 0.2
    waited=$((waited + 1))
    [ "$waited" -lt 150 ] || { echo "the recorder did not begin a log"; cat /rig/record.log; exit 1; }
done
until_up
sleep 2

cangen vcan0 -g 0 -n 5000 -I i -L i -D i &
cangen vcan1 -g 0 -n 2000 -f -b -I r -L r -D r &
cangen vcan2 -g 0 -n 2000 -e -R -m &
wait %3 %4 %5
# Paced, because the SJA1000 holds no more than a few frames while the emulated processor is slow.
cangen can0 -g 10 -n 200 -I 7FF -L 8 -D i
cansend can0 12345678#R5
cansend can0 123#
sleep 0.5
# The interface goes down, as when somebody pulls the adapter out.
ip link set can1 down
until_up
sleep 1
cangen can0 -g 10 -n 50 -I 7FF -L 8 -D i
# What a driver tells of a controller that went off the bus: the emulated ones never do.
cansend vcan0 20000040#0000000000000000
cansend vcan0 20000100#0000000000000000
sleep 2

kill -TERM "$recorder"
status=0
wait "$recorder" || status=$?
kill "$peer"
cp /tmp/candump.log /rig/candump.log
echo "recorder ended with status $status"
exit "$status"
