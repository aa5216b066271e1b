# Runs in the rig's guest: the recorder sends its estimates on the interface whose frames it records. The
# virtual vehicle drives, and the recorder goes on after the drive. candump sees the interface too.
set -eu

ip link add vcan0 type vcan
ip link set vcan0 up

drive() {
    /rig/atvrec -q virtual --manoeuvre step-steer --seed 5 --for "$1" --can vcan0 --directory /tmp/ports
}

# A first drive of a moment leaves the configuration; the recorder waits for the ports to come back.
drive 0.01
# Its last section is [storage]. The emulated processor estimates more slowly than real time, and the test
# compares the counts of the health, which are those of the arrivals that have results.
cat /tmp/ports/atvrec.toml - >/tmp/ports/controllers.toml <<'CONFIG'
stop_within_s = 120

[output.can]
interface = "vcan0"
share = true
CONFIG
candump -L -D -r 8000000 vcan0 >/tmp/candump.log &
peer=$!
sleep 1
/rig/atvrec record --config /tmp/ports/controllers.toml --directory /rig/logs --json \
    >/rig/summary.json 2>/rig/record.log &
recorder=$!
waited=0
until ls /rig/logs/* >/dev/null 2>&1; do
    sleep 0.2
    waited=$((waited + 1))
    [ "$waited" -lt 150 ] || { echo "the recorder did not begin a log"; cat /rig/record.log; exit 1; }
done
sleep 1
drive 6
sleep 4

kill -TERM "$recorder"
status=0
wait "$recorder" || status=$?
kill "$peer"
cp /tmp/candump.log /rig/candump.log
echo "recorder ended with status $status"
exit "$status"
