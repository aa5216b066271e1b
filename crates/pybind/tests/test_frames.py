"""Tables of several topics, slices, columns and rows of an instant."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from conftest import START_NS

import atvrec

FORCES = "/estimate/tyre_forces"
MOTION = "/estimate/motion"


def offset_ns(log: atvrec.Log) -> int:
    """UTC minus log clock as the receiver sent it."""
    return int(log.info()["metadata"]["atvrec.utc_offset"]["offset_ns"])


def test_the_messages_of_an_instant_are_one_row(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    joined = log.read("/strain")
    apart = log.read("/strain", rows="messages")
    assert abs(joined["t_s"].size - log.duration_s * 100.0) <= 1.5
    assert apart["t_s"].size == 8 * joined["t_s"].size
    for name in ("fl.tie_rod.raw_counts", "rr.upper_rear.raw_counts", "fr.lower_front.raw_counts"):
        known = np.isfinite(apart[name])
        np.testing.assert_array_equal(joined[name], apart[name][known], name)
    assert joined["fl.tie_rod.valid"].all() and not np.ma.getmaskarray(joined["fl.tie_rod.valid"]).any()
    # The times are those of the last message of the instant.
    np.testing.assert_array_equal(joined["log_time_ns"], apart["log_time_ns"][7::8])


def test_strain_of_an_hour_needs_less_than_100_mb(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    columns = log.read("/strain")
    bytes_ = 0
    for values in columns.values():
        parts = [values.data, values.mask] if isinstance(values, np.ma.MaskedArray) else [values]
        # Broadcast arrays have strides of zero and no memory of their own.
        bytes_ += sum(part.nbytes for part in parts if part.strides != (0,))
    assert bytes_ / log.duration_s * 3600.0 < 100e6


def test_absent_columns_take_no_memory_and_read_as_nan(simulated_log: Path) -> None:
    absent = atvrec.open(simulated_log).read("/strain")["fl.tie_rod.strain"]
    assert absent.strides == (0,) and np.isnan(absent).all()
    with pytest.raises(ValueError, match="read-only"):
        absent[0] = 1.0


def test_columns_are_chosen_by_name_or_by_what_they_belong_to(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    whole = log.read(FORCES)
    part = log.read(FORCES, columns=["fl", "rr.z_n"])
    assert {name for name in part if name.startswith("fr.")} == set()
    assert {name for name in part if name.startswith("rr.")} == {"rr.z_n"}
    assert {name for name in part if name.startswith("fl.")} == {n for n in whole if n.startswith("fl.")}
    np.testing.assert_array_equal(part["rr.z_n"], whole["rr.z_n"])
    with pytest.raises(atvrec.ArgumentError, match=r"no field rr\.zz; it has .*rr\.z_n"):
        log.read(FORCES, columns=["rr.zz"])
    with pytest.raises(atvrec.ArgumentError, match="must be a list of names"):
        log.read(FORCES, columns="fl")
    with pytest.raises(atvrec.ArgumentError, match="rows = 'wheels'"):
        log.read(FORCES, rows="wheels")  # type: ignore[arg-type]


def test_batches_have_all_rows_once(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    whole = log.read(MOTION, 0.5, 3.0)
    pieces = list(log.batches(MOTION, 0.4, 0.5, 3.0))
    assert len(pieces) == 7
    joined = np.concatenate([piece["sideslip_rad"] for piece in pieces])
    np.testing.assert_array_equal(joined, whole["sideslip_rad"])
    with pytest.raises(atvrec.ArgumentError, match="seconds = 0"):
        next(log.batches(MOTION, 0.0))


def test_a_frame_has_common_times_in_utc_and_units(simulated_log: Path) -> None:
    pandas = pytest.importorskip("pandas")
    log = atvrec.open(simulated_log)
    frame = log.frame([MOTION, f"{FORCES}.fl.z_n"], rate_hz=50.0)
    assert isinstance(frame.index, pandas.DatetimeIndex) and str(frame.index.tz) == "UTC"
    steps = np.diff(frame.index.as_unit("ns").asi8)
    assert set(steps) == {20_000_000}
    assert frame.index[0].nanosecond == 0 and frame.index.as_unit("ns").asi8[0] % 20_000_000 == 0
    assert frame.attrs["units"][f"{FORCES}.fl.z_n"] == "N"
    assert frame.attrs["units"][f"{MOTION}.yaw_rate_rad_s"] == "rad/s"
    # Between the instants of the estimates, the values are on the line between them.
    columns = log.read(FORCES)
    utc_ns = columns["publish_time_ns"] + offset_ns(log)
    # From the first instant on: doubles do not tell nanoseconds since 1970 apart.
    at = frame.index.as_unit("ns").asi8 - utc_ns[0]
    expected = np.interp(at, utc_ns - utc_ns[0], columns["fl.z_n"])
    found = frame[f"{FORCES}.fl.z_n"].to_numpy()
    inside = np.isfinite(found)
    assert inside.mean() > 0.95
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-6)


def test_without_a_rate_the_first_topic_gives_the_instants(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    table = log.frame([f"{FORCES}.fl.z_n", MOTION], kind="arrow")
    columns = log.read(FORCES)
    utc_ns = columns["publish_time_ns"] + offset_ns(log)
    np.testing.assert_array_equal(table["time"].cast("int64").to_numpy(), utc_ns)
    np.testing.assert_array_equal(table[f"{FORCES}.fl.z_n"].to_numpy(), columns["fl.z_n"])


def test_gaps_have_no_values(reference_log: Path) -> None:
    log = atvrec.open(reference_log)
    # Messages at -2, 8 and 18 ms; the field is absent in the last two.
    frame = log.frame("/everything.f64", rate_hz=1000.0, method="previous", max_gap_s=0.004)
    values = frame["/everything.f64"].to_numpy()
    times = (frame.index.as_unit("ns").asi8 - START_NS) * 1e-6
    expected = [math.floor((time + 2.0) % 10.0 + 1e-6) <= 4 for time in times]
    assert np.isfinite(values).tolist() == expected


def test_other_kinds_of_tables_say_the_same(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    fields = [f"{FORCES}.fl", f"{MOTION}.yaw_rate_rad_s"]
    of_pandas = log.frame(fields, rate_hz=10.0)
    of_polars = log.frame(fields, rate_hz=10.0, kind="polars")
    of_xarray = log.frame(fields, rate_hz=10.0, kind="xarray")
    of_arrow = log.frame(fields, rate_hz=10.0, kind="arrow")
    name = f"{FORCES}.fl.z_n"
    for other in (of_polars[name].to_numpy(), of_xarray[name].to_numpy(), of_arrow[name].to_numpy()):
        np.testing.assert_array_equal(other, of_pandas[name].to_numpy())
    assert of_xarray[name].attrs["units"] == "N"
    assert of_arrow.schema.field(name).metadata[b"unit"] == b"N"
    assert str(of_arrow.schema.field("time").type) == "timestamp[ns, tz=UTC]"
    assert of_polars["time"].dtype.time_zone == "UTC"


def test_numbers_become_arrow_without_a_copy(simulated_log: Path) -> None:
    pytest.importorskip("pyarrow")
    from atvrec import frames

    columns = atvrec.open(simulated_log).read(FORCES)
    table = frames.arrow(columns, {})
    for name in ("fl.z_n", "log_time_ns"):
        (chunk,) = table[name].chunks
        assert chunk.buffers()[1].address == columns[name].ctypes.data, name


def test_wrong_arguments_are_named(reference_log: Path) -> None:
    log = atvrec.open(reference_log)
    for arguments, text in [
        ({"fields": "/everythin"}, "no topic /everythin; it has /everything"),
        ({"fields": []}, "name at least one topic"),
        ({"fields": "/everything.nothing"}, "no field nothing; it has f64"),
        ({"fields": "/everything", "rate_hz": 0.0}, "a rate of 0 Hz is not possible"),
        ({"fields": "/everything", "method": "spline"}, "use previous, linear or nearest"),
        ({"fields": "/everything", "kind": "excel"}, "kind = 'excel': must be one of 'pandas'"),
        ({"fields": "/everything", "max_gap_s": -1.0}, "max_gap_s = -1.0 s"),
    ]:
        with pytest.raises(atvrec.ArgumentError, match=text):
            log.frame(**arguments)  # type: ignore[call-overload]


def test_notebooks_show_a_table_with_escaped_names(simulated_log: Path) -> None:
    text = atvrec.open(simulated_log)._repr_html_()
    assert "<table>" in text and FORCES in text
    from atvrec import frames

    assert "<script" not in frames.html("a", {"b": "<script>"}, ("c",), [("<script>",)])
