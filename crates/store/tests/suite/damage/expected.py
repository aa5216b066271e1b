#!/usr/bin/env python3
"""Computes how many messages of an MCAP log are to be saved from each of many damages.

usage: expected.py LOG BITS SECTORS

Damages each bit of each record's header and of each chunk's header, BITS seeded bits anywhere, and
SECTORS seeded sectors of zeros (512 or 4096 bytes). A message is to be saved if its chunk is intact:
its record and its header are as they were, and the CRC-32 of its records is right. Reads MCAP with
struct, zlib and a zstd binding alone.

Each line of the output is one of
  log CRC                      CRC-32 of the log
  bits START END EXPECTED      each bit of these bytes, one at a time
  bit OFFSET BIT EXPECTED
  zeros OFFSET LENGTH EXPECTED
"""

import random
import struct
import sys
import zlib

import zstandard

CHUNK, MESSAGE = 6, 5


def records(data, start, end):
    while start + 9 <= end:
        opcode, length = struct.unpack_from("<BQ", data, start)
        yield opcode, start, start + 9 + length
        start += 9 + length


def messages_of_chunk(data, start, end):
    """Messages of the chunk record at `start`, or None if it is not intact."""
    try:
        opcode, length = struct.unpack_from("<BQ", data, start)
        if opcode != CHUNK or start + 9 + length != end:
            return None
        size, crc, name_length = struct.unpack_from("<16xQII", data, start + 9)
        name = bytes(data[start + 41 : start + 41 + name_length])
        (packed,) = struct.unpack_from("<Q", data, start + 41 + name_length)
        body = bytes(data[start + 49 + name_length : end])
        if len(body) != packed or name not in (b"", b"zstd"):
            return None
        inside = body if name == b"" else zstandard.ZstdDecompressor().decompressobj().decompress(body)
        if len(inside) != size or zlib.crc32(inside) != crc:
            return None
        return sum(1 for opcode, _, _ in records(inside, 0, len(inside)) if opcode == MESSAGE)
    except (struct.error, zstandard.ZstdError):
        return None


def main():
    log = open(sys.argv[1], "rb").read()
    bits, sectors = int(sys.argv[2]), int(sys.argv[3])
    parts = list(records(log, 8, len(log)))
    chunks = [(start, end) for opcode, start, end in parts if opcode == CHUNK]
    intact = [messages_of_chunk(log, start, end) for start, end in chunks]
    total = sum(intact)

    def expected(offset, length, damage):
        """Messages of the chunks that are intact after the damage."""
        lost = 0
        for (start, end), count in zip(chunks, intact):
            if offset < end and offset + length > start:
                damaged = bytearray(log[start:end])
                damage(damaged, start)
                lost += 0 if messages_of_chunk(damaged, 0, end - start) == count else count
        return total - lost

    def flip(offset, bit):
        def damage(data, start):
            data[offset - start] ^= 1 << bit

        return expected(offset, 1, damage)

    def zero(offset, length):
        def damage(data, start):
            for index in range(max(offset, start), min(offset + length, start + len(data))):
                data[index - start] = 0

        return expected(offset, length, damage)

    print("log", zlib.crc32(log))
    for opcode, start, end in parts:
        head = min(53, end - start) if opcode == CHUNK else 9
        # Runs of bytes with one answer for all of their bits.
        run = start
        answer = None
        for offset in range(start, start + head):
            here = min(flip(offset, bit) for bit in range(8))
            if answer is not None and here != answer:
                print("bits", run, offset, answer)
                run = offset
            answer = here
        print("bits", run, start + head, answer)
    seeded = random.Random(61)
    for _ in range(bits):
        offset, bit = seeded.randrange(len(log)), seeded.randrange(8)
        print("bit", offset, bit, flip(offset, bit))
    for _ in range(sectors):
        length = seeded.choice([512, 4096])
        offset = seeded.randrange(len(log) // length) * length
        print("zeros", offset, length, zero(offset, length))


main()
