# Runs in the rig's guest, under systemd: from the installed program to the report of a first drive, with
# nothing but the commands of the documentation.
set -eu
say() { echo "== $*"; }

say install
. /rig/install.sh
[ ! -e /rig/atvrec.deb ] || {
    for name in man/man5/atvrec.toml.5 man/man5/atvrec-vehicle.5 man/man1/atvrec-init.1; do
        grep -q "/usr/share/$name" /rig/package.list
    done
    grep -q "^zstd-sys .*(texts " /usr/share/doc/atvrec/THIRD-PARTY
    ls /usr/share/doc/atvrec/examples/vehicles/prowler.toml* /usr/share/doc/atvrec/examples/prowler.dbc*
}

say "the vehicle"
ip link add vcan0 type vcan
ip link set vcan0 up
ip link set can0 up type can bitrate 500000
atvrec -q virtual --manoeuvre slow-sine --repeat --can vcan0 --directory /tmp/ports &
vehicle=$!
for _ in $(seq 150); do [ -e /tmp/ports/atvrec.toml ] && break; sleep 0.2; done

say "init: all that the computer has"
atvrec init --yes -d /tmp/all | tee /rig/all.log
atvrec check --no-devices /tmp/all/atvrec.toml
cp /tmp/all/atvrec.toml /rig/all.toml

say "init: the devices of the vehicle"
mkdir /tmp/drive
cd /tmp/drive
atvrec init --yes --can vcan0 --port /tmp/ports/imu --port /tmp/ports/septentrio --storage logs
cp atvrec.toml vehicle.toml sensors.toml /rig/
say check
atvrec check
say record
atvrec record --for 10
say report
atvrec report logs/*.mcap -o drive.html
cp drive.html /rig/
cp -r logs /rig/logs
kill "$vehicle"
