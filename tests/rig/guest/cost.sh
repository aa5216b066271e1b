# Runs in the rig's guest, whose clock counts instructions (rig boot --count): what a CAN frame costs
# atvrec's raw recording and candump -l, in user and kernel together. A nanosecond is an instruction.
set -eu

bus=vcan0
ip link add "$bus" type vcan
ip link set "$bus" up
cat >/tmp/atvrec.toml <<'CONFIG'
[storage]
directory = "/tmp/logs"
[source.bus]
kind = "can"
interface = "vcan0"
dbc = []
CONFIG

# Time that a process's threads have run so far, ns.
ran() { cat /proc/"$1"/task/*/schedstat | awk '{sum += $1} END {printf "%.0f", sum}'; }

# Name, gap between frames in ms, frames: sends them and prints the cost of each to the process.
measure() {
    before=$(ran "$pid")
    cangen "$bus" -g "$2" -n "$3" -I i -L 8 -D i
    sleep 0.2
    after=$(ran "$pid")
    echo "$1 gap $2 ms: $(((after - before) / $3)) instructions a frame"
}

cd /tmp
candump -l "$bus" >/dev/null 2>&1 &
pid=$!
sleep 1
measure candump 1 3000
measure candump 0.12 6000
kill "$pid"

/rig/atvrec --quiet record --config /tmp/atvrec.toml 2>/rig/record.log &
pid=$!
until ls /tmp/logs/*.active >/dev/null 2>&1; do sleep 0.2; done
sleep 2
before=$(ran "$pid")
sleep 2
after=$(ran "$pid")
echo "atvrec without traffic: $(((after - before) / 2000)) instructions a millisecond"
measure atvrec 1 3000
measure atvrec 0.12 6000
kill -TERM "$pid"
wait "$pid" || true
cp /tmp/logs/*.mcap /rig/ 2>/dev/null || true
