#!/usr/bin/env python3
"""Prints the time from the start of the recorder to its first file and to its readiness, beside an
unfinished log in the same directory.

    time-to-recording.py ATVREC LOG MEGABYTES

LOG is a closed log whose chunks are repeated to make the unfinished one.
"""

import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

CHUNK, DATA_END = 0x06, 0x0F
ROUNDS = 5


def write_unfinished(log: pathlib.Path, target: pathlib.Path, size: int) -> None:
    """Writes the head of `log` and its chunks again and again until `size` bytes are reached."""
    data = log.read_bytes()
    at, first, chunks = 8, None, []
    while data[at] != DATA_END:
        end = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        if data[at] == CHUNK:
            first = at if first is None else first
            chunks.append(data[at:end])
        at = end
    repeated = b"".join(chunks)
    with target.open("wb") as file:
        file.write(data[:first])
        while file.tell() < size:
            file.write(repeated)


def start_once(atvrec: str, directory: pathlib.Path) -> tuple[float, float, float]:
    """Times of the first file, of readiness and of the stop, s."""
    ready = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    address = str(directory / "notify")
    ready.bind(address)
    ready.settimeout(60)
    logs = directory / "logs"
    before = set(logs.iterdir())
    begin = time.monotonic()
    recorder = subprocess.Popen(
        [atvrec, "--quiet", "record"],
        cwd=directory,
        env={**os.environ, "NOTIFY_SOCKET": address},
        stdout=subprocess.DEVNULL,
    )
    while not any(path.name.endswith(".mcap.active") for path in set(logs.iterdir()) - before):
        time.sleep(0.001)
    made = time.monotonic() - begin
    while b"READY=1" not in ready.recv(4096):
        pass
    told = time.monotonic() - begin
    time.sleep(0.5)
    begin = time.monotonic()
    recorder.send_signal(signal.SIGTERM)
    recorder.wait()
    stopped = time.monotonic() - begin
    ready.close()
    os.unlink(address)
    return made, told, stopped


def main() -> None:
    atvrec, log, megabytes = sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3])
    with tempfile.TemporaryDirectory(dir=log.parent) as scratch:
        directory = pathlib.Path(scratch)
        (directory / "logs").mkdir()
        (directory / "atvrec.toml").write_text("")
        unfinished = directory / "logs" / "old.mcap.active"
        write_unfinished(log, unfinished, megabytes * 1_000_000)
        for number in range(ROUNDS):
            beside = unfinished.stat().st_size / 1e6 if unfinished.exists() else 0.0
            made, told, stopped = start_once(os.path.abspath(atvrec), directory)
            print(
                f"start {number + 1}: first file after {made:.3f} s, ready after {told:.3f} s, "
                f"stopped within {stopped:.3f} s, beside {beside:.0f} MB unfinished"
            )


main()
