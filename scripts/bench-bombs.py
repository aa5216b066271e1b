#!/usr/bin/env python3
"""Peak memory of `atvrec info` and `atvrec recover` on small MCAP files that declare large sizes.

usage: bench-bombs.py ATVREC
"""

import os
import pathlib
import struct
import subprocess
import sys
import tempfile

MAGIC = b"\x89MCAP0\r\n"


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


START = MAGIC + record(1, struct.pack("<II", 0, 0))


def zeros(size: int) -> bytes:
    """A zstd frame of run-length blocks."""
    frame = struct.pack("<IBQ", 0xFD2FB528, 0b11100000, size)
    while size:
        block = min(size, 1 << 17)
        size -= block
        frame += struct.pack("<I", block << 3 | 1 << 1 | (size == 0))[:3] + b"\0"
    return frame


def chunk(size: int) -> bytes:
    frame = zeros(size)
    return record(6, struct.pack("<QQQII", 0, 0, size, 1, 4) + b"zstd" + struct.pack("<Q", len(frame)) + frame)


def footer() -> bytes:
    return record(2, struct.pack("<QQI", len(START), 0, 0)) + MAGIC


# Name, first bytes, last bytes, length of the (sparse) file if it is longer.
BOMBS = [
    ("a chunk that inflates to 64 MB", START + chunk(64 << 20), b"", 0),
    ("a chunk that inflates to 1 GB", START + chunk(1 << 30), b"", 0),
    ("a name of 4 GB", START + record(12, struct.pack("<I", 0xFFFFFFFF) + b"name"), b"", 0),
    ("a chunk of 1 TB in a sparse file", START + struct.pack("<BQ", 6, (1 << 40) - 34), b"", 1 << 40),
    ("a summary of 1 TB in a sparse file", START, footer(), 1 << 40),
]


def peak_mb(*command: object) -> float:
    # The peak of the forked interpreter itself would count: a shell's is smaller than any of these.
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, _, usage = os.wait4(process.pid, 0)
    return usage.ru_maxrss / 1024


def main() -> None:
    atvrec = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, head, tail, length) in enumerate(BOMBS):
            path = pathlib.Path(folder, f"{number}.mcap")
            with path.open("wb") as stream:
                stream.write(head)
                if length:
                    stream.truncate(length)
                    stream.seek(length - len(tail))
                    stream.write(tail)
            info = peak_mb(atvrec, "info", path)
            recover = peak_mb(atvrec, "recover", path)
            print(f"{name}: info {info:.0f} MB, recover {recover:.0f} MB at most")


main()
