"""The tables of a fleet's dataset, and how their files are written."""

from __future__ import annotations

import io
import os
import uuid
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

_KEY = [
    ("key", pa.string()),
    ("run", pa.string()),
    ("vehicle", pa.string()),
    ("start", pa.timestamp("ns", "UTC")),
]


def _schema(*fields: tuple[str, pa.DataType]) -> pa.Schema:
    return pa.schema([*_KEY, *fields])


_TEXT, _NUMBER, _COUNT = pa.string(), pa.float64(), pa.int64()

TABLES: dict[str, pa.Schema] = {
    "runs": _schema(
        ("status", _TEXT),
        ("reason", _TEXT),
        ("transient", pa.bool_()),
        ("files", pa.list_(_TEXT)),
        ("source", _TEXT),
        ("content", _TEXT),
        ("bytes", _COUNT),
        ("duration_s", _NUMBER),
        ("distance_m", _NUMBER),
        ("version", _TEXT),
        ("steps", _TEXT),
        ("seconds", _NUMBER),
    ),
    "steps": _schema(("step", _TEXT), ("status", _TEXT), ("reason", _TEXT), ("seconds", _NUMBER)),
    "summary": _schema(("quantity", _TEXT), ("value", _NUMBER), ("unit", _TEXT)),
    "verdict": _schema(("text", _TEXT)),
    "events": _schema(("number", _COUNT), ("at_s", _NUMBER), ("kind", _TEXT), ("text", _TEXT)),
    "parameters": _schema(
        ("step", _TEXT),
        ("parameter", _TEXT),
        ("value", _NUMBER),
        ("sigma", _NUMBER),
        ("low", _NUMBER),
        ("high", _NUMBER),
        ("unit", _TEXT),
    ),
    "forces": _schema(
        ("wheel", _TEXT),
        ("axis", _TEXT),
        ("min_n", _NUMBER),
        ("max_n", _NUMBER),
        ("rms_n", _NUMBER),
        ("percentile_95_n", _NUMBER),
        ("sigma_n", _NUMBER),
        ("utilisation", _NUMBER),
        ("lifts", _COUNT),
    ),
    "cycles": _schema(
        ("wheel", _TEXT),
        ("axis", _TEXT),
        ("range_low_n", _NUMBER),
        ("range_high_n", _NUMBER),
        ("cycles", _NUMBER),
        ("sigma", _NUMBER),
    ),
    "scores": _schema(
        ("signal", _TEXT),
        ("wheel", _TEXT),
        ("unit", _TEXT),
        ("count", _COUNT),
        ("mean", _NUMBER),
        ("rmse", _NUMBER),
        ("peak", _NUMBER),
        ("normalised_percent", _NUMBER),
        ("nees", _NUMBER),
        ("nees_inside", _NUMBER),
    ),
}
"""Columns of each table. Every table begins with the key of the result, the name of the run, the name of
the vehicle and the begin of the log. The table ``estimates`` has the columns of the log instead."""


def file_of(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> bytes:
    """A Parquet file with these rows; columns that a row lacks are null."""
    table = pa.Table.from_pylist([dict(row) for row in rows], schema=schema)
    return file_of_table(table)


def file_of_table(table: pa.Table) -> bytes:
    """A Parquet file."""
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def put(fs: Any, path: str, data: bytes) -> None:
    """Writes a file whole or not at all. Object stores do this themselves; in a directory, a file with
    another name is renamed."""
    if "file" not in protocols(fs):
        fs.pipe_file(path, data)
        return
    os.makedirs(os.path.dirname(path), exist_ok=True)
    unfinished = os.path.join(os.path.dirname(path), f".{uuid.uuid4().hex}.unfinished")
    try:
        with open(unfinished, "wb") as file:
            file.write(data)
        os.replace(unfinished, path)
    except BaseException:
        if os.path.exists(unfinished):
            os.remove(unfinished)
        raise


def protocols(fs: Any) -> Sequence[str]:
    """Names of a file system's protocols; ``file`` for directories of this machine."""
    return [fs.protocol] if isinstance(fs.protocol, str) else list(fs.protocol)


def read_runs(fs: Any, out: str) -> list[dict[str, Any]]:
    """The rows of the table ``runs``, without the columns that are long."""
    names = ["key", "run", "status", "reason", "transient", "source", "content", "duration_s", "seconds"]
    directory = f"{out}/runs"
    if not fs.exists(directory):
        return []
    files = [path for path in fs.ls(directory, detail=False) if str(path).endswith(".parquet")]
    rows: list[dict[str, Any]] = []
    for path in files:
        with fs.open(path, "rb") as file:
            rows += pq.read_table(file, columns=names).to_pylist()
    return rows
