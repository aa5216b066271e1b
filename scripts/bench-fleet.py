#!/usr/bin/env python3
"""How a fleet's time grows with its workers.

    bench-fleet.py [DRIVES [SECONDS]]

Simulates drives (200 of 60 s), keeps their raw bytes alone, and processes them with one and with two workers,
three times each. Prints the efficiency (time with one worker over twice the time with two, median of three), the
memory of the workers, and runs per core-hour. Then it tests the parameters of all drives for changes that are not
there. Needs the wheel with the extra `fleet`, and the package mcap.
"""

from __future__ import annotations

import os
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

import atvrec
from atvrec import fleet
from atvrec.trend import trend

STEPS = [fleet.replay(), fleet.identify("cornering"), fleet.summary()]


def raw_only(source: Path, target: Path) -> None:
    """Copies the messages of the raw topics, with all attachments and metadata."""
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer

    with source.open("rb") as read, target.open("wb") as written:
        reader = make_reader(read)
        header = reader.get_header()
        writer = Writer(written, compression=CompressionType.ZSTD)
        writer.start(header.profile, header.library)
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages():
            if not channel.topic.startswith(("/raw/", "/clock", "/notice")) or "clock_fit" in channel.topic:
                continue
            if channel.id not in channels:
                if schema.id not in schemas:
                    schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        for one in reader.iter_attachments():
            writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, one.data)
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, dict(record.metadata))
        writer.finish()


def simulated(job: tuple[int, float, str]) -> int:
    seed, seconds, folder = job
    whole = Path(folder) / f".whole-{seed}.mcap"
    atvrec.simulate("mixed-driving", whole, seed=seed, duration_s=seconds)
    target = Path(folder) / f"drive-{seed:05}.mcap"
    raw_only(whole, target)
    whole.unlink()
    return target.stat().st_size


def resident_mb() -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return float(line.split()[1]) / 1024.0
    return 0.0


def main() -> None:
    from distributed import Client

    drives = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    folder = Path(tempfile.mkdtemp(prefix="bench-fleet-", dir=os.environ.get("BENCH_DIR")))
    try:
        logs = folder / "logs"
        logs.mkdir()
        with fleet.local_cluster(2) as cluster, Client(cluster) as client:
            jobs = [(1001 + drive, seconds, str(logs)) for drive in range(drives)]
            total = sum(client.gather(client.map(simulated, jobs)))
        print(f"fleet: {drives} drives of {seconds:g} s, {total / 1e6:.0f} MB of raw logs")
        taken: dict[int, list[float]] = {1: [], 2: []}
        memory: dict[int, float] = {}
        for repeat in range(3):
            for workers in (1, 2):
                out = folder / f"out-{workers}-{repeat}"
                with fleet.local_cluster(workers) as cluster, Client(cluster) as client:
                    client.run(lambda: len(STEPS))
                    begin = time.monotonic()
                    found = fleet.run(logs, STEPS, out, cluster=client, progress=False)
                    taken[workers].append(time.monotonic() - begin)
                    memory[workers] = max(client.run(resident_mb).values())
                assert found.done == drives, found
                print(f"fleet: {workers} workers: {taken[workers][-1]:.1f} s, {memory[workers]:.0f} MB each at most")
        one, two = statistics.median(taken[1]), statistics.median(taken[2])
        ratios = [a / (2.0 * b) for a, b in zip(taken[1], taken[2], strict=True)]
        per_hour = drives / one * 3600.0
        print(f"fleet: efficiency with two workers {statistics.median(ratios):.2f} (median of three)")
        print(f"fleet: {per_hour:.0f} runs, {per_hour * seconds / 3600.0:.0f} vehicle-hours per core-hour")
        begin = time.monotonic()
        again = fleet.run(logs, STEPS, folder / "out-2-0", progress=False)
        print(f"fleet: second call {time.monotonic() - begin:.1f} s, {again.known} of {drives} known")
        import pandas as pd
        import pyarrow.dataset as ds

        table = ds.dataset(folder / "out-2-0" / "parameters", format="parquet").to_table().to_pandas()
        # Virtual drives all begin at the same time.
        day = table["run"].str.extract(r"(\d+)$")[0].astype(int)
        table["start"] = pd.Timestamp("2026-01-01", tz="UTC") + pd.to_timedelta(day, unit="D")
        result = trend(table)
        print(f"trend: {len(result.series)} parameters of {drives} drives without a change, {len(result.changed)} alarms")
        alarms = 0
        for shuffle in range(100):
            order = pd.Series(range(drives)).sample(frac=1.0, random_state=shuffle).to_numpy()
            other = table.copy()
            other["start"] = pd.Timestamp("2026-01-01", tz="UTC") + pd.to_timedelta(order[day - day.min()], unit="D")
            alarms += bool(trend(other, seed=shuffle).changed)
        print(f"trend: {alarms} of 100 random orders of these drives have an alarm; 1 is expected")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
