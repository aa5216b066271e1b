"""Speaks as an inertial unit on a serial port, without a pause.

usage: speak.py PORT PACKETS SAYS
PACKETS holds packets of equal length; SAYS is a file that says what to send now: `packets`,
`garbage`, or `mismatch` (the packets as they are heard at two thirds of their bit rate).
"""

import os
import random
import sys
import time
import tty

PACKET_BYTES = 31
PERIOD_S = 0.01
# As much as the line takes in a period at 57,600 baud.
GARBAGE_BYTES = 57


def heard_too_slowly(data: bytes) -> bytes:
    """The bytes that a receiver makes of others sent at three halves of its bit rate, 8N1."""
    line = [1] * 4
    for byte in data:
        line += [0, *(byte >> bit & 1 for bit in range(8)), 1]
    line += [1] * 30
    heard = bytearray()
    at = 0.0
    while at < len(line) - 15:
        if line[int(at)]:
            at += 0.5
            continue
        middle = at + 0.75
        heard.append(sum(line[int(middle + 1.5 * (bit + 1))] << bit for bit in range(8)))
        at += 15
    return bytes(heard)


def main() -> None:
    port_path, packets_path, says_path = sys.argv[1:]
    packets = open(packets_path, "rb").read()
    packets = [packets[at : at + PACKET_BYTES] for at in range(0, len(packets), PACKET_BYTES)]
    mismatched = [heard_too_slowly(packet) for packet in packets]
    noise = random.Random(1)
    port = os.open(port_path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(port)
    attributes = tty.tcgetattr(port)
    attributes[4] = attributes[5] = tty.B57600
    tty.tcsetattr(port, tty.TCSANOW, attributes)
    count = 0
    while True:
        says = open(says_path).read().strip()
        data = {
            "garbage": lambda: noise.randbytes(GARBAGE_BYTES),
            "mismatch": lambda: mismatched[count % len(packets)],
        }.get(says, lambda: packets[count % len(packets)])()
        count += 1
        try:
            os.write(port, data)
        except BlockingIOError:
            pass  # nobody is plugged in at the other end
        time.sleep(PERIOD_S)


main()
