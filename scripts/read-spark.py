#!/usr/bin/env python3
"""Reads a dataset of `atvrec export --all` with Spark, and compares it with what pyarrow reads.

    read-spark.py ATVREC

Needs pyspark, pyarrow and Java 17 (`scripts/setup spark`).
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

import pyarrow.dataset
import pyarrow.parquet
from pyspark.sql import SparkSession, functions

DRIVES = [("slow-sine", 1), ("step-steer", 2)]
TOPICS = ["/estimate/tyre_forces", "/imu/imu", "/strain", "/can/can0/Steering"]
# Spark adds the rows in another order than the reference.
TOLERANCE = 1e-9


def export(atvrec: str, folder: Path) -> Path:
    """A dataset of two simulated drives."""
    logs = []
    for drive, seed in DRIVES:
        log = folder / f"{drive}.mcap"
        drive_of = ["simulate", "-m", drive, "--seed", str(seed), "--for", "3", "-o", log]
        subprocess.run([atvrec, "-q", *drive_of], check=True, stdout=subprocess.DEVNULL)
        logs.append(log)
    dataset = folder / "dataset"
    command = [atvrec, "-q", "export", *logs, "--all", "-o", dataset]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return dataset


def session() -> SparkSession:
    builder = SparkSession.builder.master("local[1]").config("spark.ui.enabled", "false")
    # Without it, Spark refuses time stamps in nanoseconds.
    builder = builder.config("spark.sql.legacy.parquet.nanosAsLong", "true")
    spark = builder.getOrCreate()
    spark.sparkContext.setLogLevel("ERROR")
    return spark


def check(spark: SparkSession, dataset: Path, topic: str) -> int:
    """Compares number, sum and nulls of all columns with numbers; the number of rows."""
    name = topic.replace("/", "%2F")
    files = sorted(dataset.glob(f"*/*/*/topic={name}/*.parquet"))
    assert len(files) == len(DRIVES), files
    expected = pyarrow.dataset.dataset(files).to_table().to_pandas()
    read = spark.read.option("basePath", str(dataset)).option("mergeSchema", "true")
    found = read.parquet(str(dataset / f"*/*/*/topic={name}"))
    numbers = [c for c in expected if expected[c].dtype.kind == "f"]
    totals = []
    for column in numbers:
        value = functions.nanvl(functions.col(f"`{column}`"), functions.lit(None))
        totals += [functions.count(value), functions.sum(value)]
    row = found.agg(functions.count(functions.lit(1)), *totals).first()
    assert row[0] == len(expected), (topic, row[0])
    for at, column in enumerate(numbers):
        count, total = row[1 + 2 * at], row[2 + 2 * at]
        assert count == expected[column].count(), (topic, column)
        scale = expected[column].abs().sum()
        same = math.isclose(total or 0.0, expected[column].sum(), abs_tol=TOLERANCE * scale)
        assert same, (topic, column, total, expected[column].sum())
    # Times are numbers of nanoseconds; the partitions are columns.
    first = found.agg(functions.min("log_time")).first()[0]
    assert first == expected["log_time"].min().value, (topic, first)
    partitions = found.select("vehicle", "date", "run", "topic").distinct().collect()
    assert {row.topic for row in partitions} == {topic}, partitions
    assert {row.run for row in partitions} == {f"simulate-{d}-{s}" for d, s in DRIVES}, partitions
    return len(expected)


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as name:
        dataset = export(sys.argv[1], Path(name))
        spark = session()
        rows = sum(check(spark, dataset, topic) for topic in TOPICS)
        print(f"Spark {spark.version} reads {rows} rows of {len(TOPICS)} topics as pyarrow does")
        spark.stop()


main()
