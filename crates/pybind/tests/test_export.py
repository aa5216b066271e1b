"""Exports of the program, read back by independent readers and compared with the reference reader of MCAP."""

from __future__ import annotations

import json
import math
import os
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

FORCES = "/estimate/tyre_forces"
RUNS = ("simulate-slow-sine-1", "simulate-step-steer-2")
# The longest interval without a gap of a column with a value every 10 ms.
GAP_OF_100_HZ_NS = 30_000_000


@pytest.fixture(scope="module")
def program() -> str:
    path = os.environ.get("ATVREC_BIN")
    if not path:
        pytest.skip("ATVREC_BIN names no program; scripts/test-python sets it")
    return path


def run(program: str, *arguments: object) -> str:
    done = subprocess.run(
        [program, "--quiet", *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def logs(program: str, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Logs of two drives of the virtual vehicle."""
    folder = tmp_path_factory.mktemp("logs")
    made = []
    for drive, seed in (("slow-sine", 1), ("step-steer", 2)):
        log = folder / f"{drive}.mcap"
        run(program, "simulate", "--manoeuvre", drive, "--seed", seed, "--for", 3, "-o", log)
        made.append(log)
    return made


def messages(log: Path, topic: str) -> Iterator[tuple[int, int, Any]]:
    """Times and messages of a topic, by the reference reader."""
    with log.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, _, message, decoded in reader.iter_decoded_messages(topics=[topic]):
            yield message.log_time, message.publish_time, decoded


def columns(log: Path, topic: str, **paths: Any) -> dict[str, np.ndarray]:
    """Times and values of a topic, by the reference reader; `paths` takes each value out of a message."""
    rows = list(messages(log, topic))
    assert rows, f"{topic} is not in the log"
    found = {name: np.array([path(row[2]) for row in rows]) for name, path in paths.items()}
    return {
        "log_time": np.array([row[0] for row in rows]),
        "publish_time": np.array([row[1] for row in rows]),
        **found,
    }


def wheel(message: Any, axle: int, side: str) -> Any:
    return next(w for w in message.wheels if (w.axle, w.side) == (axle, side))


def load(message: Any) -> float:
    return float(wheel(message, 1, "left").z_n)


def nanoseconds(times: Any) -> list[int]:
    return [int(value) for value in pd.DatetimeIndex(times).as_unit("ns").asi8]


def same(found: Any, expected: np.ndarray) -> None:
    """Both lists have the same bits, where null is NaN."""
    found = np.array([math.nan if value is None else value for value in found])
    np.testing.assert_array_equal(found, expected)


@pytest.fixture(scope="module")
def dataset(program: str, logs: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("datasets") / "dataset"
    run(program, "export", *logs, "--all", "-o", folder)
    return folder


def partition(dataset: Path, run_name: str, topic: str) -> Path:
    name = "topic=" + topic.replace("/", "%2F")
    (found,) = dataset.glob(f"vehicle=*/date=*/run={run_name}/{name}/*.parquet")
    return found


def expected_loads(logs: list[Path]) -> list[dict[str, np.ndarray]]:
    return [columns(log, FORCES, load=load) for log in logs]


def test_pyarrow_reads_the_dataset(dataset: Path, logs: list[Path]) -> None:
    import pyarrow as pa
    import pyarrow.dataset as ds

    for run_name, expected in zip(RUNS, expected_loads(logs), strict=True):
        table = ds.dataset(partition(dataset, run_name, FORCES)).to_table()
        same(table["fl.z_n"].to_pylist(), expected["load"])
        for name in ("log_time", "publish_time"):
            assert table.schema.field(name).type == pa.timestamp("ns", tz="UTC")
            np.testing.assert_array_equal(table[name].cast(pa.int64()), expected[name])
        assert table["fl.z_n"].null_count == np.isnan(expected["load"]).sum()
        field = table.schema.field("fl.z_n")
        assert field.metadata[b"unit"] == b"N"
        assert field.metadata[b"source"] == b"estimator"
        assert field.metadata[b"frame"].startswith(b"wheel carrier: y along the spindle")
        assert table.schema.metadata[b"atvrec.run"].decode() == run_name
        kinds = table.schema.field("fl.source").type
        assert kinds == pa.dictionary(pa.int32(), pa.string())
        assert "FORCE_SOURCE_FUSION" in table["fl.source"].to_pylist()
    # The inertial unit sends no time of day.
    rows = ds.dataset(partition(dataset, RUNS[0], "/imu/imu")).to_table()
    assert rows["device_time.utc_time_of_day_s"].null_count == rows.num_rows > 100
    assert rows["device_time.gps.week"].null_count == rows.num_rows
    assert rows["angular_rate_rad_s.x"].null_count == 0
    imu = rows.schema
    assert imu.field("angular_rate_rad_s.x").metadata[b"unit"] == b"rad/s"
    assert imu.field("angular_rate_rad_s.x").metadata[b"source"] == b"imu"
    assert b"frame" not in imu.field("interval_s").metadata
    steering = ds.dataset(partition(dataset, RUNS[0], "/can/can0/Steering")).schema
    assert steering.field("hand_wheel_angle").metadata[b"unit"] == b"deg"
    assert steering.field("hand_wheel_angle").metadata[b"source"] == b"can0"
    whole = ds.dataset(dataset, partitioning="hive")
    chosen = whole.to_table(filter=ds.field("topic") == "/imu/imu", columns=["run", "topic"])
    assert set(chosen["run"].to_pylist()) == set(RUNS)


def test_duckdb_reads_the_dataset(dataset: Path, logs: list[Path]) -> None:
    import duckdb

    files = f"{dataset}/*/*/*/*/*.parquet"
    query = (
        'select run, vehicle, date, epoch_ns(log_time), "fl.z_n", "fl.source" '
        f"from read_parquet('{files}', hive_partitioning = true, union_by_name = true) "
        f"where topic = '{FORCES}' order by run, log_time"
    )
    rows = duckdb.connect().execute(query).fetchall()
    for run_name, expected in zip(RUNS, expected_loads(logs), strict=True):
        of_run = [row for row in rows if row[0] == run_name]
        assert {row[1] for row in of_run} == {"Prowler, road tyres"}
        assert {str(row[2]) for row in of_run} == {"2009-04-15"}
        np.testing.assert_array_equal([row[3] for row in of_run], expected["log_time"])
        same([row[4] for row in of_run], expected["load"])
        assert "FORCE_SOURCE_FUSION" in {row[5] for row in of_run}


def test_polars_reads_the_dataset(dataset: Path, logs: list[Path]) -> None:
    import polars as pl

    every = pl.scan_parquet(
        f"{dataset}/", hive_partitioning=True, missing_columns="insert", extra_columns="ignore"
    )
    topics = every.select("run", "topic").unique().collect()
    assert (RUNS[1], "/gnss/novatel/position") in topics.rows()
    for run_name, expected in zip(RUNS, expected_loads(logs), strict=True):
        frame = pl.read_parquet(partition(dataset, run_name, FORCES))
        assert frame["log_time"].dtype == pl.Datetime("ns", "UTC")
        np.testing.assert_array_equal(frame["log_time"].to_physical(), expected["log_time"])
        same(frame["fl.z_n"].to_list(), expected["load"])


def test_pandas_reads_the_dataset(dataset: Path, logs: list[Path]) -> None:
    for run_name, expected in zip(RUNS, expected_loads(logs), strict=True):
        frame = pd.read_parquet(partition(dataset, run_name, FORCES))
        assert nanoseconds(frame["publish_time"]) == expected["publish_time"].tolist()
        same(frame["fl.z_n"], expected["load"])
        assert isinstance(frame["fl.source"].dtype, pd.CategoricalDtype)


def test_a_wide_table_has_the_values_of_its_method(
    program: str, logs: list[Path], tmp_path: Path
) -> None:
    import pyarrow.parquet as pq

    log = logs[0]
    rate = columns(log, "/imu/imu", x=lambda m: m.angular_rate_rad_s.x)
    # GNSS velocity has a value every 50 ms or more.
    east = columns(log, "/gnss/novatel/velocity", x=lambda m: m.velocity_m_s.east)
    tables = {}
    for method in ("previous", "linear", "nearest"):
        out = tmp_path / f"{method}.parquet"
        run(
            program, "export", log, "--wide", "--rate", 200, "--method", method,
            "-t", "/imu/imu", "-t", "/gnss/novatel/velocity", "-t", FORCES, "-o", out,
        )  # fmt: skip
        tables[method] = pq.read_table(out)
    for method, table in tables.items():
        times = np.array(nanoseconds(table["time"].to_pandas()))
        assert set(np.diff(times)) == {5_000_000}
        assert times[0] % 5_000_000 == 0
        field = table.schema.field("/imu/imu.angular_rate_rad_s.x")
        assert field.metadata[b"method"].decode() == method
        assert field.metadata[b"unit"] == b"rad/s"
        assert float(field.metadata[b"max_gap_s"]) == pytest.approx(0.03, rel=0.05)
        assert table.schema.metadata[b"atvrec.rate_hz"] == b"200"
        for name, known in (
            ("/imu/imu.angular_rate_rad_s.x", rate),
            ("/gnss/novatel/velocity.velocity_m_s.east", east),
        ):
            gap_ns = float(table.schema.field(name).metadata[b"max_gap_s"]) * 1e9
            expected = aligned(known["publish_time"], known["x"], times, method, gap_ns)
            found = np.array(table[name].to_pandas())
            assert np.isfinite(expected).mean() > 0.8
            np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    kind = tables["linear"].schema.field(f"{FORCES}.fl.source")
    assert kind.metadata[b"method"] == b"previous"


def aligned(
    times: np.ndarray, values: np.ndarray, targets: np.ndarray, method: str, gap_ns: float
) -> np.ndarray:
    """The rule of `export --wide`, by numpy. Times are rounded to whole ns, so that 1 ns is allowed."""
    known = ~np.isnan(values)
    times, values = times[known], values[known]
    last = np.searchsorted(times, targets, side="right") - 1
    before = np.clip(last, 0, len(times) - 1)
    after = np.clip(last + 1, 0, len(times) - 1)
    since, until = targets - times[before], times[after] - targets
    if method == "previous":
        return np.where((last >= 0) & (since <= gap_ns), values[before], np.nan)
    if method == "nearest":
        since = np.where(last >= 0, since, np.iinfo(np.int64).max)
        until = np.where(last + 1 < len(times), until, np.iinfo(np.int64).max)
        nearest = np.where(since <= until, values[before], values[after])
        return np.where(np.minimum(since, until) <= gap_ns / 2, nearest, np.nan)
    between = np.interp(targets - times[0], times - times[0], values)
    inside = (last >= 0) & (last + 1 < len(times)) & (times[after] - times[before] <= gap_ns)
    return np.where(inside | ((last >= 0) & (since == 0)), between, np.nan)


def test_a_gap_of_a_wide_table_is_null(program: str, logs: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "gap.csv"
    run(program, "export", logs[0], "--wide", "-t", FORCES, "--from", 1, "--max-gap", 0.004,
        "--rate", 200, "-o", out)  # fmt: skip
    loads = pd.read_csv(out)[f"{FORCES}.fl.z_n"]
    # The estimates are 10 ms apart, so that every second row is in a gap.
    assert loads.isna().mean() == pytest.approx(0.5, abs=0.01)


def test_gpxpy_reads_the_track(program: str, logs: list[Path], tmp_path: Path) -> None:
    import gpxpy

    out = tmp_path / "track.gpx"
    run(program, "export", logs[0], "-o", out)
    tracks = {track.name: track for track in gpxpy.parse(out.read_text()).tracks}
    assert set(tracks) == {"novatel", "septentrio"}
    known = columns(
        logs[0],
        "/gnss/novatel/position",
        latitude=lambda m: math.degrees(m.latitude_rad),
        longitude=lambda m: math.degrees(m.longitude_rad),
        height=lambda m: m.height_m,
    )
    points = [point for segment in tracks["novatel"].segments for point in segment.points]
    offset_ns = next(m.offset_ns for _, _, m in messages(logs[0], "/utc_offset"))
    assert len(points) == len(known["latitude"]) > 10
    np.testing.assert_allclose([p.latitude for p in points], known["latitude"], atol=1e-9)
    np.testing.assert_allclose([p.longitude for p in points], known["longitude"], atol=1e-9)
    np.testing.assert_allclose([p.elevation for p in points], known["height"], atol=1e-4)
    times = [p.time.timestamp() for p in points]
    # The last offset of the log is used; it differs from the first one by less than 1 ms.
    np.testing.assert_allclose(times, (known["publish_time"] + offset_ns) / 1e9, atol=1e-3)
    assert {point.type_of_gpx_fix for point in points} <= {"3d", "dgps", None}


def test_a_reference_track_comes_out_as_it_was(program: str, tmp_path: Path) -> None:
    import gpxpy

    shared = Path(__file__).parents[4] / "shared" / "data" / "can-logs" / "gpx" / "car-drive"
    required = os.environ.get("ATVREC_REQUIRE_DATA")
    if required == "0" or not shared.is_dir():
        assert required in (None, "0"), f"{shared} is missing, and ATVREC_REQUIRE_DATA is set"
        pytest.skip(f"{shared} is not read")
    lines = (shared / "reference.jsonl").read_text().splitlines()
    known = [json.loads(line) for line in lines]
    known = [point for point in known if point["kind"] == "track" and point["time"]]
    assert len(known) > 100
    rows = ["t,lat,lon,ele"]
    rows += [f"{p['time']},{p['lat']!r},{p['lon']!r},{p['ele']!r}" for p in known]
    (tmp_path / "track.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "map.toml").write_text(
        '[time]\ncolumn = "t"\nunit = "ISO 8601"\n'
        '[column.lat]\nquantity = "gnss.latitude"\nunit = "deg"\n'
        '[column.lon]\nquantity = "gnss.longitude"\nunit = "deg"\n'
        '[column.ele]\nquantity = "gnss.height"\nunit = "m"\n'
    )
    log, out = tmp_path / "track.mcap", tmp_path / "track.gpx"
    run(
        program, "import", "csv", tmp_path / "track.csv", "--columns", tmp_path / "map.toml",
        "-o", log,
    )  # fmt: skip
    run(program, "export", log, "-o", out)
    (track,) = gpxpy.parse(out.read_text()).tracks
    points = [point for segment in track.segments for point in segment.points]
    assert len(points) == len(known)
    for point, reference in zip(points, known, strict=True):
        assert point.latitude == pytest.approx(reference["lat"], abs=1e-9)
        assert point.longitude == pytest.approx(reference["lon"], abs=1e-9)
        assert point.elevation == pytest.approx(reference["ele"], abs=1e-4)
        expected = pd.Timestamp(reference["time"])
        expected = expected.tz_localize("UTC") if expected.tz is None else expected
        assert abs((pd.Timestamp(point.time) - expected).total_seconds()) < 1e-6


def test_scipy_reads_the_mat_file(program: str, logs: list[Path], tmp_path: Path) -> None:
    from scipy.io import loadmat

    out = tmp_path / "forces.mat"
    run(program, "export", logs[0], "-t", FORCES, "-o", out)
    known = columns(logs[0], FORCES, load=load)
    found = loadmat(out)
    same(found["fl_z_n"][:, 0], known["load"])
    np.testing.assert_array_equal(found["log_time_ns"][:, 0], known["log_time"])


def test_ros_2_readers_read_the_bag(program: str, logs: list[Path], tmp_path: Path) -> None:
    from mcap_ros2.decoder import DecoderFactory as Ros2
    from rosbags.highlevel import AnyReader

    file, folder = tmp_path / "drive.mcap", tmp_path / "bag"
    run(program, "export", logs[0], "--ros2", "-o", file)
    run(program, "export", logs[0], "--ros2", "-o", folder)
    found: dict[str, list[tuple[int, Any]]] = {}
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[Ros2()])
        assert reader.get_header().profile == "ros2"
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.publish_time, decoded))
    check_bag(logs[0], found)
    again: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([folder]) as bag:
        for connection, _, data in bag.messages():
            decoded = bag.deserialize(data, connection.msgtype)
            stamp = decoded.header.stamp
            stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            again.setdefault(connection.topic, []).append((stamp_ns, decoded))
        assert bag.message_count == sum(map(len, found.values()))
    check_bag(logs[0], again)


def check_bag(log: Path, found: dict[str, list[tuple[int, Any]]]) -> None:
    imu = columns(
        log,
        "/imu/imu",
        x=lambda m: m.angular_rate_rad_s.x,
        z=lambda m: m.specific_force_m_s2.z,
    )
    ours = found["/imu/imu"]
    assert [ns for ns, _ in ours] == imu["publish_time"].tolist()
    same([m.angular_velocity.x for _, m in ours], imu["x"])
    same([m.linear_acceleration.z for _, m in ours], imu["z"])
    first = ours[0][1]
    assert first.header.frame_id == "imu"
    assert first.orientation_covariance[0] == -1
    stamp = first.header.stamp
    seconds = getattr(stamp, "sec", None)
    assert seconds * 1_000_000_000 + stamp.nanosec == imu["publish_time"][0]
    fix = columns(
        log,
        "/gnss/novatel/position",
        latitude=lambda m: math.degrees(m.latitude_rad),
        height=lambda m: m.height_m,
        north=lambda m: m.sigma_m.north,
        quality=lambda m: m.quality,
    )
    ours = found["/gnss/novatel/position"]
    np.testing.assert_allclose([m.latitude for _, m in ours], fix["latitude"], rtol=1e-15)
    same([m.altitude for _, m in ours], fix["height"])
    same([m.position_covariance[4] for _, m in ours], fix["north"] ** 2)
    assert {m.position_covariance_type for _, m in ours} == {2}
    status = {0: -1, 1: 0, 2: 1, 3: 2, 4: 2, 5: 0}
    assert [m.status.status for _, m in ours] == [status[q] for q in fix["quality"]]
    assert {m.status.service for _, m in ours} == {1}
    east = columns(log, "/gnss/novatel/velocity", x=lambda m: m.velocity_m_s.east)
    ours = found["/gnss/novatel/velocity"]
    same([m.twist.linear.x for _, m in ours], east["x"])
    yaw = columns(log, "/estimate/motion", x=lambda m: m.yaw_rate_rad_s)
    yaw_of = dict(zip(yaw["publish_time"].tolist(), yaw["x"], strict=True))
    for ns, message in found["/estimate/motion"]:
        same([message.twist.angular.z], np.array([yaw_of[ns]]))
    for name, axle, side in (("fl", 1, "left"), ("rr", 2, "right")):
        known = columns(
            log,
            FORCES,
            z=lambda m, a=axle, s=side: wheel(m, a, s).z_n,
            y=lambda m, a=axle, s=side: wheel(m, a, s).y_n,
        )
        at = {ns: row for row, ns in enumerate(known["publish_time"].tolist())}
        ours = found[f"{FORCES}/{name}"]
        assert len(ours) == np.isfinite(known["z"]).sum()
        rows = [at[ns] for ns, _ in ours]
        same([m.wrench.force.z for _, m in ours], known["z"][rows])
        same([m.wrench.force.y for _, m in ours], known["y"][rows])
        assert {m.header.frame_id for _, m in ours} == {f"wheel_{name}"}


@pytest.mark.parametrize("options", [(), ("--compress",)])
def test_asammdf_reads_the_mf4_file(
    program: str, logs: list[Path], tmp_path: Path, options: tuple[str, ...]
) -> None:
    from asammdf import MDF

    out = tmp_path / "drive.mf4"
    run(program, "export", logs[0], "-o", out, *options)
    with MDF(out) as mdf:
        assert mdf.version == "4.10"
        groups = {group.channel_group.acq_name: at for at, group in enumerate(mdf.groups)}
        known = columns(
            logs[0],
            "/imu/imu",
            x=lambda m: m.angular_rate_rad_s.x,
            status=lambda m: m.status,
            valid=lambda m: m.valid,
        )
        start_ns = min(row[0] for row in messages(logs[0], "/estimate/motion"))
        imu = groups["/imu/imu"]
        rate = mdf.get("angular_rate_rad_s.x", group=imu)
        same(rate.samples, known["x"])
        assert rate.unit == "rad/s"
        assert "axes of the sensor" in rate.comment
        expected_s = (known["log_time"] - known["log_time"][0]) / 1e9
        np.testing.assert_allclose(
            rate.timestamps - rate.timestamps[0], expected_s, rtol=0, atol=1e-9
        )
        assert abs(rate.timestamps[0] - (known["log_time"][0] - start_ns) / 1e9) < 1.0
        published = mdf.get("publish_time", group=imu).samples
        lag_s = (known["log_time"] - known["publish_time"]) / 1e9
        np.testing.assert_allclose(rate.timestamps - published, lag_s, rtol=0, atol=1e-9)
        same(mdf.get("status", group=imu).samples, known["status"])
        same(mdf.get("valid", group=imu).samples, known["valid"].astype(int))
        loads = columns(logs[0], FORCES, load=load)
        forces = groups[FORCES]
        found = mdf.get("fl.z_n", group=forces)
        same(found.samples, loads["load"])
        assert found.unit == "N"
        kinds = mdf.get("fl.source", group=forces).samples.tolist()
        assert b"FORCE_SOURCE_FUSION" in kinds
        # Each topic has its own rate.
        velocity = mdf.get("velocity_m_s.east", group=groups["/gnss/novatel/velocity"])
        assert len(velocity.samples) < len(rate.samples)
        steering = mdf.get("hand_wheel_angle", group=groups["/can/can0/Steering"])
        assert steering.unit == "deg"
        # A counter that a device does not send is marked as invalid.
        counter = mdf.get("satellites", group=groups["/gnss/novatel/position"])
        present = [
            m.HasField("satellites") for _, _, m in messages(logs[0], "/gnss/novatel/position")
        ]
        assert len(counter.samples) == sum(present)
        assert "device_time.gps.week" not in {c.name for c in mdf.groups[imu].channels}
        # A message has the strain of one wheel; the counts of the others are marked as invalid.
        tie_rod = mdf.get("fl.tie_rod.raw_counts", group=groups["/strain"])
        strain = [m for _, _, m in messages(logs[0], "/strain")]
        left = [w for m in strain for w in m.wheels if (w.axle, w.side) == (1, "left")]
        counts = [s.raw_counts for w in left for s in w.members if s.name == "tie_rod"]
        same(tie_rod.samples, np.array(counts))
        assert 0 < len(counts) < len(strain)


@pytest.mark.parametrize("options", [(), ("--compress",)])
def test_asammdf_reads_a_group_of_several_blocks(
    program: str, tmp_path: Path, options: tuple[str, ...]
) -> None:
    from asammdf import MDF
    from google.protobuf.wrappers_pb2 import DoubleValue
    from mcap_protobuf.writer import Writer

    count = 70_000
    log, out = tmp_path / "values.mcap", tmp_path / "values.mf4"
    with log.open("wb") as stream, Writer(stream) as writer:
        for row in range(count):
            time_ns = 1_700_000_000_000_000_000 + row * 1_000_000
            writer.write_message("/values", DoubleValue(value=row / 3), time_ns, time_ns)
    run(program, "export", log, "-o", out, *options)
    with MDF(out) as mdf:
        values = mdf.get("value", group=0)
        same(values.samples, np.arange(count) / 3)
        np.testing.assert_allclose(values.timestamps, np.arange(count) / 1000, rtol=0, atol=1e-12)
        assert mdf.start_time.timestamp() == 1_700_000_000
    # asammdf does not use the positions of the blocks in the data, other readers do.
    data = out.read_bytes()
    at = data.index(b"##DL")
    length, links = struct.unpack_from("<QQ", data, at + 8)
    blocks = struct.unpack_from(f"<{links}Q", data, at + 24)[1:]
    _, number, *positions = struct.unpack_from(f"<II{len(blocks)}Q", data, at + 24 + 8 * links)
    assert number == len(blocks) > 1
    assert at + length <= len(data)
    if options:
        kinds = [data[block + 2 : block + 4] for block in blocks]
        assert kinds == [b"DZ"] * len(blocks)
        # Length of the data before compression.
        sizes = [struct.unpack_from("<Q", data, block + 32)[0] for block in blocks]
        assert max(sizes) <= 4 << 20
        assert len(data) < count * 3 * 8 / 2
    else:
        sizes = [struct.unpack_from("<Q", data, block + 8)[0] - 24 for block in blocks]
    assert positions == [sum(sizes[:n]) for n in range(len(sizes))]
    assert sum(sizes) == count * 3 * 8
