# Runs in the rig's guest, whose clock counts instructions (rig boot --count): what a CAN frame costs
# atvrec's raw recording, its decoded recording and candump -l, in user and kernel together. A nanosecond
# is an instruction.
set -eu

bus=vcan0
ip link add "$bus" type vcan
ip link set "$bus" up
cat >/tmp/raw.toml <<'CONFIG'
[storage]
directory = "/tmp/raw"
[source.bus]
kind = "can"
interface = "vcan0"
dbc = []
CONFIG
# Each frame has four signals, as the project's own frames have.
cat >/tmp/decoded.toml <<'CONFIG'
[storage]
directory = "/tmp/decoded"
[record]
decoded = "all"
[source.bus]
kind = "can"
interface = "vcan0"
dbc = ["bus.dbc"]
CONFIG
{
    printf 'VERSION ""\n\nBU_: Box\n\nBO_ 272 Frame: 8 Box\n'
    for n in 0 1 2 3; do
        printf ' SG_ signal_%d : %d|16@1- (0.1,0) [0|0] "mm" Box\n' "$n" $((16 * n))
    done
} >/tmp/bus.dbc

# Time that a process's threads have run so far, ns.
ran() { cat /proc/"$1"/task/*/schedstat | awk '{sum += $1} END {printf "%.0f", sum}'; }

# Name, gap between frames in ms, frames, identifier: sends them and prints the cost of each to the process.
measure() {
    before=$(ran "$pid")
    cangen "$bus" -g "$2" -n "$3" -I "$4" -L 8 -D i
    sleep 0.2
    after=$(ran "$pid")
    echo "$1 gap $2 ms: $(((after - before) / $3)) instructions a frame"
}

cd /tmp
candump -l "$bus" >/dev/null 2>&1 &
pid=$!
sleep 1
measure candump 1 3000 i
measure candump 0.12 6000 i
kill "$pid"

# Name of the configuration, identifier of the frames.
record() {
    /rig/atvrec --quiet record --config "/tmp/$1.toml" 2>>/rig/record.log &
    pid=$!
    until ls "/tmp/$1"/*.active >/dev/null 2>&1; do sleep 0.2; done
    sleep 2
    before=$(ran "$pid")
    sleep 2
    after=$(ran "$pid")
    echo "atvrec $1 without traffic: $(((after - before) / 2000)) instructions a millisecond"
    measure "atvrec $1" 1 3000 "$2"
    measure "atvrec $1" 0.12 6000 "$2"
    kill -TERM "$pid"
    wait "$pid" || true
    echo "atvrec $1: $(($(cat "/tmp/$1"/*.mcap | wc -c) / 9000)) bytes a frame, with the head and the end of the log"
}
record raw i
record decoded 110
cp /tmp/raw/*.mcap /rig/ 2>/dev/null || true
