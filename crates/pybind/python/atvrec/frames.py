"""Columns of logs as tables of pandas, polars, pyarrow and xarray."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from atvrec._atvrec import ArgumentError

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    import xarray as xr

Columns = Mapping[str, npt.NDArray[Any]]
Times = npt.NDArray[np.int64]


def selection(fields: str | Sequence[str], topics: Iterable[str]) -> dict[str, list[str]]:
    """Fields by topic of ``topic`` and ``topic.field``; no field for all fields of a topic."""
    wanted: dict[str, list[str]] = {}
    whole: set[str] = set()
    known = set(topics)
    names = [fields] if isinstance(fields, str) else list(fields)
    if not names:
        raise ArgumentError("fields = []: name at least one topic, such as '/estimate/motion'")
    for text in names:
        # Names of topics may have dots, too.
        parts = text.split(".")
        lengths = range(len(parts), 0, -1)
        topic = next((t for t in (".".join(parts[:n]) for n in lengths) if t in known), None)
        if topic is None:
            near = get_close_matches(parts[0], known, 3) or sorted(known)
            raise ArgumentError(f"fields: the log has no topic {parts[0]}; it has {', '.join(near)}")
        wanted.setdefault(topic, [])
        if field := text[len(topic) + 1 :]:
            wanted[topic].append(field)
        else:
            whole.add(topic)
    return {topic: [] if topic in whole else found for topic, found in wanted.items()}


def arrow(columns: Columns, units: Mapping[str, str]) -> pa.Table:
    """A pyarrow table. Arrays of numbers become columns without a copy."""
    import pyarrow as pa

    arrays, fields = [], []
    for name, values in columns.items():
        array = _arrow_array(values)
        unit = units.get(name)
        arrays.append(array)
        fields.append(pa.field(name, array.type, metadata={"unit": unit} if unit else None))
    return pa.table(arrays, schema=pa.schema(fields))


def _arrow_array(values: npt.NDArray[Any]) -> pa.Array:
    import pyarrow as pa

    if isinstance(values, np.ma.MaskedArray):
        return pa.array(np.asarray(values.data), mask=np.ma.getmaskarray(values))
    if values.dtype == object:
        return pa.array([row.tolist() if isinstance(row, np.ndarray) else row for row in values])
    return pa.array(values)


def _to_arrow(times_ns: Times, columns: Columns, units: Mapping[str, str]) -> pa.Table:
    import pyarrow as pa

    table = arrow(columns, units)
    time = pa.array(times_ns).cast(pa.timestamp("ns", "UTC"))
    return table.add_column(0, pa.field("time", time.type, nullable=False), time)


def _to_pandas(times_ns: Times, columns: Columns, units: Mapping[str, str]) -> pd.DataFrame:
    import pandas as pd

    index = pd.DatetimeIndex(times_ns.view("M8[ns]"), tz="UTC", name="time")
    frame = pd.DataFrame({name: pandas_column(v) for name, v in columns.items()}, copy=False)
    frame.index = index
    frame.attrs["units"] = {name: unit for name, unit in units.items() if unit}
    return frame


def _to_polars(times_ns: Times, columns: Columns, units: Mapping[str, str]) -> pl.DataFrame:
    import polars as pl

    frame = pl.from_arrow(_to_arrow(times_ns, columns, units))
    assert isinstance(frame, pl.DataFrame)
    return frame


def _to_xarray(times_ns: Times, columns: Columns, units: Mapping[str, str]) -> xr.Dataset:
    import xarray as xr

    variables = {}
    for name, values in columns.items():
        unit = units.get(name)
        attributes = {"units": unit} if unit else {}
        plain = np.array(plain_values(values), object) if is_masked(values) else values
        variables[name] = ("time", plain, attributes)
    return xr.Dataset(variables, {"time": times_ns.view("M8[ns]")})


MAKERS: dict[str, Callable[[Times, Columns, Mapping[str, str]], Any]] = {
    "pandas": _to_pandas,
    "polars": _to_polars,
    "arrow": _to_arrow,
    "xarray": _to_xarray,
}


def pandas_column(values: npt.NDArray[Any]) -> Any:
    """The values, or an array of pandas with ``NA`` where they are masked."""
    import pandas as pd

    return pd.array(plain_values(values)) if is_masked(values) else values


def is_masked(values: npt.NDArray[Any]) -> bool:
    return isinstance(values, np.ma.MaskedArray)


def plain_values(values: npt.NDArray[Any]) -> list[Any]:
    """Python values, ``None`` where masked, lists where nested."""
    return [v.tolist() if isinstance(v, np.ndarray) else v for v in values.tolist()]


def html(title: str, facts: Mapping[str, str], heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A short table for notebooks; all texts are escaped."""
    from html import escape

    lines = [f"<b>{escape(title)}</b><br>"]
    lines += [f"{escape(name)}: {escape(text)}<br>" for name, text in facts.items()]
    cells = "".join(f"<th>{escape(head)}</th>" for head in heads)
    lines.append(f"<table><thead><tr>{cells}</tr></thead><tbody>")
    for row in rows:
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in row)
        lines.append(f"<tr>{cells}</tr>")
    lines.append("</tbody></table>")
    return "".join(lines)
