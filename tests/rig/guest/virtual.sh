# Runs in the rig's guest: the virtual vehicle on SocketCAN and pseudo-terminals, recorded by atvrec
# and, its CAN frames, by candump too. The recorder sends its estimates on another interface.
set -eu

for bus in vcan0 vcan1; do
    ip link add "$bus" type vcan
    ip link set "$bus" up
done

drive() {
    /rig/atvrec -q virtual --manoeuvre step-steer --seed 5 --for "$1" --can vcan0 --directory /tmp/ports
}

# A first drive of a moment leaves the configuration; the recorder waits for the ports to come back.
drive 0.01
# Its last section is [storage]. The emulated processor estimates more slowly than real time, and the test
# compares all results.
cat /tmp/ports/atvrec.toml - >/tmp/ports/controllers.toml <<'CONFIG'
stop_within_s = 120

[output.can]
interface = "vcan1"
CONFIG
/rig/atvrec record --config /tmp/ports/controllers.toml --directory /rig/logs --json \
    >/rig/summary.json 2>/rig/record.log &
recorder=$!
waited=0
until ls /rig/logs/* >/dev/null 2>&1; do
    sleep 0.2
    waited=$((waited + 1))
    [ "$waited" -lt 150 ] || { echo "the recorder did not begin a log"; cat /rig/record.log; exit 1; }
done
candump -L -D -r 8000000 vcan0 vcan1 >/tmp/candump.log &
peer=$!
sleep 1
drive 6
sleep 1

kill -TERM "$recorder"
status=0
wait "$recorder" || status=$?
kill "$peer"
cp /tmp/candump.log /rig/candump.log
echo "recorder ended with status $status"
exit "$status"
