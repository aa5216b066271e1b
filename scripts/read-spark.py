#!/usr/bin/env python3
"""Reads datasets of `atvrec export --all` and `atvrec fleet run` with Spark, and compares them with what
pyarrow reads.

    read-spark.py ATVREC WHEEL

ATVREC is the program, WHEEL the console script of the Python package, which has the command `fleet`.
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
# Long enough for load cycles.
DRIVE_S = 10
TOPICS = ["/estimate/tyre_forces", "/imu/imu", "/strain", "/can/can0/Steering"]
# Spark adds the rows in another order than the reference.
TOLERANCE = 1e-9


def run(*command: str | Path) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def simulated(atvrec: str, folder: Path) -> list[Path]:
    logs = []
    for drive, seed in DRIVES:
        logs.append(folder / f"{drive}.mcap")
        run(atvrec, "-q", "simulate", "-m", drive, "--seed", str(seed), "--for", str(DRIVE_S), "-o", logs[-1])
    return logs


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


def check_fleet(spark: SparkSession, dataset: Path) -> int:
    """Compares the query of docs/fleet.md, and the number of rows of each table."""
    rows = 0
    for table in sorted(path.name for path in dataset.iterdir() if path.is_dir()):
        expected = pyarrow.dataset.dataset(dataset / table).to_table().to_pandas()
        found = spark.read.parquet(str(dataset / table))
        assert found.count() == len(expected), (table, found.count(), len(expected))
        assert set(found.columns) == set(expected.columns), (table, found.columns)
        rows += len(expected)
    cycles = spark.read.parquet(str(dataset / "cycles")).where("axis = 'z'")
    found = cycles.groupBy("wheel", "range_low_n").sum("cycles").toPandas()
    expected = pyarrow.dataset.dataset(dataset / "cycles").to_table().to_pandas()
    expected = expected[expected["axis"] == "z"].groupby(["wheel", "range_low_n"])["cycles"].sum()
    found = found.set_index(["wheel", "range_low_n"])["sum(cycles)"].sort_index()
    assert len(found) == len(expected) > 0, (len(found), len(expected))
    assert (abs(found - expected) <= TOLERANCE * expected).all(), (found, expected)
    return rows


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    atvrec, wheel = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = simulated(atvrec, folder)
        run(atvrec, "-q", "export", *logs, "--all", "-o", folder / "dataset")
        run(wheel, "fleet", "run", *logs, "-o", folder / "fleet", "--steps", "replay,identify:cornering,summary")
        spark = session()
        rows = sum(check(spark, folder / "dataset", topic) for topic in TOPICS)
        print(f"Spark {spark.version} reads {rows} rows of {len(TOPICS)} topics as pyarrow does")
        rows = check_fleet(spark, folder / "fleet")
        print(f"Spark {spark.version} reads {rows} rows of a fleet's dataset as pyarrow does")
        spark.stop()


main()
