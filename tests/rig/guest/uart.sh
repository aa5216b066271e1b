# Runs in the rig's guest: three real UARTs, at whose other ends the host's virtual vehicle speaks.
set -eu

cat >/tmp/atvrec.toml <<'CONFIG'
[storage]
directory = "/rig/logs"
[source.imu]
kind = "crossbow440"
device = "/dev/ttyS1"
baud = 57600
configure = false
[source.novatel]
kind = "gnss"
device = "/dev/ttyS2"
baud = 115200
[source.septentrio]
kind = "gnss"
device = "/dev/ttyS3"
baud = 115200
CONFIG

/rig/atvrec record --config /tmp/atvrec.toml --for 15 --json >/rig/summary.json 2>/rig/record.log
