# Runs in the rig's guest: records to /dev/vda until the power is cut, or, with /rig/last, makes the
# last log whole and hands all logs over.
set -eu
mkdir -p /data
mount -t ext4 /dev/vda /data
ip link add vcan0 type vcan
ip link set vcan0 up
cat >/tmp/atvrec.toml <<'CONFIG'
[storage]
directory = "/data/logs"
rotate_after_s = 3
[source.bus]
kind = "can"
interface = "vcan0"
dbc = []
CONFIG

if [ -e /rig/last ]; then
    begin=$(date +%s%N)
    # Nothing is sent: the recorder says so by status 3.
    /rig/atvrec record --config /tmp/atvrec.toml --for 0.5 2>/rig/record.log || [ $? -eq 3 ]
    echo "half a second of recording took $((($(date +%s%N) - begin) / 1000000)) ms"
    # The stop has abandoned a recovery that was not finished.
    /rig/atvrec recover /data/logs 2>>/rig/record.log
    mkdir /rig/logs
    ls -l /data/logs
    cp /data/logs/*.mcap* /rig/logs/
    umount /data
    exit 0
fi

/rig/atvrec record --config /tmp/atvrec.toml 2>/rig/record.log &
until /rig/atvrec status --config /tmp/atvrec.toml >/dev/null 2>&1; do sleep 0.1; done
cangen vcan0 -g 2 -I 100 -L 8 -D i &
sleep 1
# Written through to the host at once: how far the guest had come when its power was cut.
while :; do date +%s%N >>/rig/alive; done
