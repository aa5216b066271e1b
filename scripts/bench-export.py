#!/usr/bin/env python3
"""Exports of a log beside their peers in Python.

usage: bench-export.py ATVREC LOG

Parquet: `atvrec export --all`, and the packages mcap and protobuf with pyarrow, which write the same topics.
MF4: `atvrec export -o FILE.mf4`, and asammdf, which writes the same signals from memory.
Prints wall-clock time and size; the log should be long enough for seconds.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from asammdf import MDF, Signal
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

LEFT_OUT = ("/raw/", "/tf", "/scene")
ROWS = 50_000


def numbers(message, prefix="", found=None):
    """All values of a message by their names."""
    found = {} if found is None else found
    for field, value in message.ListFields():
        repeated = field.is_repeated if hasattr(field, "is_repeated") else field.label == 3
        if field.message_type is None:
            found[prefix + field.name] = list(value) if repeated else value
        elif repeated:
            for index, entry in enumerate(value):
                numbers(entry, f"{prefix}{index}.", found)
        else:
            numbers(value, f"{prefix}{field.name}.", found)
    return found


def parquet_by_python(log, folder):
    begin = time.monotonic()
    rows, writers = {}, {}

    def flush(topic):
        table = pa.Table.from_pylist(rows.pop(topic))
        if topic not in writers:
            writers[topic] = pq.ParquetWriter(folder / f"{len(writers)}.parquet", table.schema, compression="zstd")
        try:
            writers[topic].write_table(table.cast(writers[topic].schema))
        except (ValueError, pa.ArrowInvalid):
            # Columns that came later; a file of their own, as a user would do.
            writers[topic, time.monotonic()] = writer = pq.ParquetWriter(
                folder / f"{len(writers)}.parquet", table.schema, compression="zstd"
            )
            writer.write_table(table)

    with open(log, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            if channel.topic.startswith(LEFT_OUT):
                continue
            row = numbers(decoded)
            row["log_time"] = message.log_time
            row["publish_time"] = message.publish_time
            rows.setdefault(channel.topic, []).append(row)
            if len(rows[channel.topic]) == ROWS:
                flush(channel.topic)
    for topic in list(rows):
        flush(topic)
    for writer in writers.values():
        writer.close()
    return time.monotonic() - begin


def timed(*command):
    begin = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - begin


def size_mb(path):
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file()) / 1e6


def main():
    atvrec, log = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ours = timed(atvrec, "--quiet", "export", log, "--all", "-o", folder / "dataset")
        (folder / "python").mkdir()
        theirs = parquet_by_python(log, folder / "python")
        print(
            f"Parquet: atvrec {ours:.2f} s, {size_mb(folder / 'dataset'):.1f} MB; mcap, protobuf and pyarrow "
            f"{theirs:.2f} s, {size_mb(folder / 'python'):.1f} MB; ratio {theirs / ours:.1f}"
        )
        mf4 = folder / "drive.mf4"
        ours = timed(atvrec, "--quiet", "export", log, "-o", mf4)
        with MDF(mf4) as read:
            groups = [
                [s for s in read.select([(c.name, g, i) for i, c in enumerate(group.channels)]) if len(s.samples)]
                for g, group in enumerate(read.groups)
            ]
        begin = time.monotonic()
        with MDF(version="4.10") as written:
            for group in groups:
                numbers = [s for s in group if s.samples.dtype.kind in "biuf"]
                same = [s for s in numbers if len(s.timestamps) == len(numbers[0].timestamps)]
                if not same:
                    continue
                written.append([Signal(s.samples, s.timestamps, name=s.name, unit=s.unit) for s in same])
            written.save(folder / "asammdf.mf4", overwrite=True)
            theirs = time.monotonic() - begin
            begin = time.monotonic()
            # Transposed and deflated blocks.
            written.save(folder / "asammdf-dz.mf4", overwrite=True, compression=2)
            theirs_small = time.monotonic() - begin
        print(
            f"MF4: atvrec {ours:.2f} s with reading and decoding of the log, {size_mb(mf4):.1f} MB; asammdf from "
            f"memory {theirs:.2f} s, {size_mb(folder / 'asammdf.mf4'):.1f} MB"
        )
        small = folder / "small.mf4"
        ours = timed(atvrec, "--quiet", "export", log, "--compress", "-o", small)
        print(
            f"Compressed MF4: atvrec {ours:.2f} s, {size_mb(small):.1f} MB; asammdf, saving only, "
            f"{theirs_small:.2f} s, {size_mb(folder / 'asammdf-dz.mf4'):.1f} MB"
        )


main()
