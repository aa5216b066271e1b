"""Logs read by this package against what was written and what the reference reader says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import START_NS, everything
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import atvrec


def test_every_type_comes_back_exactly(reference_log: Path) -> None:
    log = atvrec.open(reference_log)
    columns = log.read("/everything")
    dtypes = {
        "f64": "f8",
        "f32": "f8",
        "i32": "i4",
        "s32": "i4",
        "sf32": "i4",
        "u32": "u4",
        "x32": "u4",
        "i64": "i8",
        "sf64": "i8",
        "u64": "u8",
        "x64": "u8",
        "flag": "?",
        "text": "O",
        "data": "O",
    }
    for name, dtype in dtypes.items():
        assert columns[name].dtype == np.dtype(dtype), name
        written = [getattr(message, name) for message in everything()]
        assert columns[name].tolist() == written, name
    assert math.copysign(1.0, columns["f64"][2]) == -1.0


def test_absent_is_not_zero(reference_log: Path) -> None:
    columns = atvrec.open(reference_log).read("/everything")
    assert columns["inner.x"][0] == 0.0
    assert np.isnan(columns["inner.x"][1:]).all()
    np.testing.assert_array_equal(columns["maybe_u32"], [0.0, np.nan, 12.0])
    np.testing.assert_array_equal(columns["maybe_f64"], [0.0, np.nan, np.nan])
    maybe = columns["maybe_i64"]
    assert isinstance(maybe, np.ma.MaskedArray)
    assert maybe.tolist() == [2**53 + 1, None, None]


def test_repeated_fields_are_arrays_of_arrays(reference_log: Path) -> None:
    columns = atvrec.open(reference_log).read("/everything")
    assert [row.tolist() for row in columns["list"]] == [[1.0, 2.0, 3.0], [], []]
    assert [row.tolist() for row in columns["parts.x"]] == [[4.0, 0.0], [], [6.0]]
    assert [row.tolist() for row in columns["parts.count"]] == [[0, 5], [], [0]]


def test_time_is_on_the_log_clock(reference_log: Path) -> None:
    log = atvrec.open([reference_log])
    columns = log.read("/everything")
    assert columns["log_time_ns"].dtype == np.int64
    assert columns["log_time_ns"].tolist() == [START_NS + 10_000_000 * i for i in range(3)]
    np.testing.assert_allclose(columns["t_s"], [-0.002, 0.008, 0.018], atol=1e-9)
    assert log.duration_s == pytest.approx(0.02)
    assert log.read("/everything", 0.01, 0.01)["i32"].tolist() == [0]
    assert log.read("/everything", start_s=0.005)["t_s"].size == 2
    assert log.read("/everything", end_s=-1.0)["inner.x"].size == 0


def test_errors_say_what_is_wrong(reference_log: Path, tmp_path: Path) -> None:
    log = atvrec.open(reference_log)
    with pytest.raises(atvrec.LogError, match="no topic /nothing; it has /everything"):
        log.read("/nothing")
    with pytest.raises(atvrec.ArgumentError, match="start_s = nan s"):
        log.read("/everything", math.nan)
    with pytest.raises(FileNotFoundError, match="absent.mcap"):
        atvrec.open(tmp_path / "absent.mcap")
    other = tmp_path / "other.txt"
    other.write_text("no log")
    with pytest.raises(atvrec.LogError, match="not an MCAP file"):
        atvrec.open(other)
    with pytest.raises(atvrec.AtvrecError, match="no log"):
        atvrec.open([])


def test_a_cut_log_is_read_as_far_as_it_goes(reference_log: Path) -> None:
    whole = reference_log.read_bytes()
    reference_log.write_bytes(whole[: len(whole) // 2])
    log = atvrec.open(reference_log)
    assert log.info()["missing"]


def test_frames(reference_log: Path) -> None:
    log = atvrec.open(reference_log)
    pandas = pytest.importorskip("pandas")
    frame = log.to_pandas("/everything")
    assert frame.index.name == "t_s"
    assert frame["maybe_i64"].iloc[0] == 2**53 + 1
    assert frame["maybe_i64"].iloc[1] is pandas.NA
    polars = pytest.importorskip("polars")
    table = log.to_polars("/everything")
    assert table["parts.x"].to_list() == [[4.0, 0.0], [], [6.0]]
    assert table["maybe_i64"].to_list() == [2**53 + 1, None, None]
    assert table["u64"].dtype == polars.UInt64


KEYS = ("axle", "side", "name")
WHEELS = {(1, "left"): "fl", (1, "right"): "fr", (2, "left"): "rl", (2, "right"): "rr"}


def _key(entry: Any) -> str | None:
    """The name of a wheel, of an axle or of a suspension member; ``None`` for other entries."""
    fields = entry.DESCRIPTOR.fields_by_name
    if "side" in fields:
        return WHEELS[entry.axle, entry.side]
    if "axle" in fields:
        return {1: "front", 2: "rear"}[entry.axle]
    return entry.name if entry.DESCRIPTOR.name == "StrainMember" else None


def _flatten(message: Any, prefix: str = "", leave_out: tuple[str, ...] = ()) -> dict[str, Any]:
    """Present fields by dotted name; lists of entries without a name left out."""
    found: dict[str, Any] = {}
    for field, value in message.ListFields():
        name = f"{prefix}{field.name}"
        if field.name in leave_out:
            continue
        if isinstance(value, (int, float, str, bytes, bool)):
            found[name] = value
        elif hasattr(value, "ListFields"):
            found |= _flatten(value, f"{name}.")
        elif field.message_type is not None:
            for entry in value:
                if key := _key(entry):
                    found |= _flatten(entry, f"{prefix}{key}.", KEYS)
    return found


def test_the_reference_reader_says_the_same(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    ours = {topic: log.read(topic, rows="messages") for topic in log.topics}
    row = dict.fromkeys(log.topics, 0)
    compared = 0
    with simulated_log.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages(log_time_order=False):
            columns, index = ours[channel.topic], row[channel.topic]
            row[channel.topic] += 1
            assert columns["log_time_ns"][index] == record.log_time
            assert columns["publish_time_ns"][index] == record.publish_time
            for name, value in _flatten(message).items():
                got = columns[name][index]
                assert got == value or (value != value and got != got), (channel.topic, name)
                compared += 1
    assert all(ours[topic]["t_s"].size == count for topic, count in row.items())
    assert compared > 10_000
    assert {"fl.tie_rod.raw_counts", "rr.lower_rear.valid"} <= set(ours["/strain"])
    assert "front.friction_min" in ours["/estimate/parameters"]
    assert log.missing == []


def test_a_log_of_an_earlier_layout_has_the_columns_of_the_present_one(simulated_log: Path) -> None:
    earlier = atvrec.open(Path(__file__).parents[3] / "testdata" / "compat" / "slow-sine-0.mcap")
    present = atvrec.open(simulated_log)
    assert "contract" not in earlier.info()["metadata"]["atvrec.run"]
    assert present.info()["metadata"]["atvrec.run"]["contract"] == "0"
    assert "/raw/can0" in earlier.topics
    assert "/can/can0/raw" not in earlier.topics
    for topic in earlier.topics:
        # The columns of /control/... have the names that a configuration gives them.
        if topic in present.topics and not topic.startswith("/control/"):
            # Earlier logs count neither late messages nor those that no decoder reads, and have no data
            # length codes above 8 of classic frames.
            later = ("sources.undecoded.", "sources.late", "sources.too_late", "kind_len8_dlc")
            names = [n for n in present.read(topic) if not n.startswith(later)]
            assert list(earlier.read(topic)) == names, topic
    load = earlier.read("/estimate/contact_forces")["fl.z_n"]
    assert load.size == 400
    assert np.nanmin(load) > 100.0
    assert earlier.missing == []


def test_a_simulated_log_explains_itself(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    info = log.info()
    assert info["missing"] == []
    assert {"/estimate/motion", "/estimate/tyre_forces", "/truth/motion"} <= set(log.topics)
    texts = [text.decode() for text in log.attachments.values()]
    vehicle = next(text for text in texts if "mass_kg" in text and "[front" in text)
    assert atvrec.Vehicle.from_toml(vehicle).mass_kg > 0
    motion = log.read("/estimate/motion")
    assert {"velocity_x_m_s", "acceleration_m_s2.x", "rr.slip_angle_rad"} <= set(motion)
    assert np.all(np.diff(motion["log_time_ns"]) >= 0)
    can = next(topic for topic in log.topics if topic.startswith("/can/"))
    assert log.read(can)["t_s"].size > 0


def test_messages_that_the_log_leaves_out_are_decoded(tmp_path: Path) -> None:
    logs: list[atvrec.Log] = []
    for decoded in ("all", "none"):
        drive = tmp_path / "drive.mcap"
        atvrec.simulate("step-steer", drive, duration_s=2.0, force=True)
        for name, data in atvrec.open(drive).attachments.items():
            (tmp_path / name).write_bytes(data)
        config = tmp_path / "atvrec.toml"
        config.write_text(config.read_text() + f'\n[record]\ndecoded = "{decoded}"\n')
        path = tmp_path / f"{decoded}.mcap"
        atvrec.simulate("step-steer", path, duration_s=2.0, config=config)
        logs.append(atvrec.open(path))
    written, left_out = logs
    topic = "/can/can0/WheelSpeed"
    assert topic in written.info()["channels"]
    assert topic not in left_out.info()["channels"]
    # Messages of the DBC that the bus never carried are among the topics, too.
    assert set(left_out.topics) >= set(written.topics)
    topics = ["/steer", topic, "/can/can0/Steering"]
    for span in ((None, None), (0.5, 1.0)):
        expected = written.read_many(topics, *span)
        found = left_out.read_many(topics, *span)
        assert list(found) == topics
        for name in topics:
            assert expected[name]["t_s"].size > 20
            assert list(found[name]) == list(expected[name])
            for column, values in expected[name].items():
                np.testing.assert_array_equal(found[name][column], values, err_msg=column)
    assert left_out.units(topic) == written.units(topic)
    assert left_out.enums(topic) == written.enums(topic)
