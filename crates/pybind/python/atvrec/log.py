"""Logs as arrays and frames."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
import numpy.typing as npt

from atvrec._atvrec import ArgumentError, LogReader

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

Path = str | os.PathLike[str]

_LAST_NS = 2**63 - 1


class Info(TypedDict):
    """What a log holds, in numbers."""

    files: list[tuple[os.PathLike[str], int]]
    """Files and their sizes in bytes, in order."""
    start_ns: int | None
    """Log clock of the first message, ns since 1970."""
    end_ns: int | None
    """Log clock of the last message, ns since 1970."""
    channels: dict[str, tuple[str, int]]
    """Name of the schema and number of messages by topic."""
    chunks: int
    """Number of chunks."""
    counters: dict[str, int]
    """The recorder's counters at the close."""
    metadata: dict[str, dict[str, str]]
    """Version, host, sources and the like."""
    missing: list[str]
    """What is known to be missing or damaged."""


class Log:
    """A log of one run, in one file or several. Opened by :func:`atvrec.open`."""

    def __init__(self, paths: Iterable[Path]) -> None:
        self._reader = LogReader([os.fspath(path) for path in paths])
        self._missing: list[str] = []

    def __repr__(self) -> str:
        info = self.info()
        messages = sum(count for _, count in info["channels"].values())
        return (
            f"<atvrec.Log of {len(info['files'])} file(s), {len(info['channels'])} topics, "
            f"{messages} messages, {self.duration_s:.3f} s>"
        )

    @property
    def topics(self) -> list[str]:
        """All topics, sorted, with the decoded CAN messages that ``record.decoded`` leaves out of the
        log. :meth:`read` decodes these from the raw frames."""
        return self._reader.topics()

    @property
    def start_ns(self) -> int:
        """Log clock of the first message, ns since 1970; the zero of ``t_s``."""
        span = self._reader.span_ns()
        return span[0] if span else 0

    @property
    def duration_s(self) -> float:
        """From the first message to the last, s."""
        span = self._reader.span_ns()
        return (span[1] - span[0]) / 1e9 if span else 0.0

    @property
    def attachments(self) -> dict[str, bytes]:
        """Configuration, vehicle, calibration and DBC files by name, as they were recorded with."""
        return self._reader.attachments()

    @property
    def missing(self) -> list[str]:
        """What was damaged or malformed in the topics read so far, and so left out."""
        return self._missing.copy()

    def info(self) -> Info:
        """What the log holds, in numbers."""
        return self._reader.info()

    def read(
        self, topic: str, start_s: float | None = None, end_s: float | None = None
    ) -> dict[str, npt.NDArray[Any]]:
        """All fields of a topic as arrays of one entry a message, by the field's name.

        The stretch of time is given on the log clock in seconds after the first message of the
        log, both ends included. Besides the fields there are

        - ``log_time_ns``: log clock when the message was recorded or computed, int64, ns since 1970
        - ``publish_time_ns``: log clock when it was true, int64, ns since 1970
        - ``t_s``: ``publish_time_ns`` after the first message of the log, s

        Fields of messages inside of messages are flattened: ``acceleration_m_s2.x``. Entries of
        wheels, axles and suspension members have columns of their own: ``fl.z_n``,
        ``front.friction``, ``rr.tie_rod.raw_counts``. Fields below any other repeated field give an
        array of arrays. Where a value may be absent, numbers with a fraction
        and numbers of 32 bits are NaN, numbers of 64 bits and truth values are masked arrays, texts
        are ``None``. Enumerations are numbers; :meth:`enums` has their names.

        Raises :class:`atvrec.LogError` where the log has no such topic.
        """
        return self.read_many([topic], start_s, end_s)[topic]

    def read_many(
        self, topics: Sequence[str], start_s: float | None = None, end_s: float | None = None
    ) -> dict[str, dict[str, npt.NDArray[Any]]]:
        """Several topics as by :meth:`read`, by their names. The log is read in one pass, which is
        faster than one call of :meth:`read` for each topic.
        """
        first = self.start_ns
        topics = list(dict.fromkeys(topics))
        found = self._reader.read(
            topics,
            _time_ns("start_s", start_s, first, 0),
            _time_ns("end_s", end_s, first, _LAST_NS),
        )
        results: dict[str, dict[str, npt.NDArray[Any]]] = {}
        for topic, (columns, _, missing) in zip(topics, found, strict=True):
            self._missing += [text for text in missing if text not in self._missing]
            t_s = (columns["publish_time_ns"] - np.int64(first)) * 1e-9
            results[topic] = {"t_s": t_s, **columns}
        return results

    def units(self, topic: str) -> dict[str, str]:
        """Units of a topic's fields where the log tells them beside the names (DBC messages)."""
        return self._reader.read([topic], 1, 0)[0][1]

    def enums(self, topic: str) -> dict[str, dict[int, str]]:
        """Names of the values of those fields of a topic that are enumerations."""
        return self._reader.enums(topic)

    def to_pandas(
        self, topic: str, start_s: float | None = None, end_s: float | None = None
    ) -> pd.DataFrame:
        """The same as a pandas frame, indexed by ``t_s``. Needs pandas."""
        import pandas as pd

        columns = self.read(topic, start_s, end_s)
        series = {name: pd.array(_plain(v)) if _is_masked(v) else v for name, v in columns.items()}
        return pd.DataFrame(series).set_index("t_s")

    def to_polars(
        self, topic: str, start_s: float | None = None, end_s: float | None = None
    ) -> pl.DataFrame:
        """The same as a polars frame. Needs polars."""
        import polars as pl

        columns = self.read(topic, start_s, end_s)
        series = {
            name: _plain(v) if _is_masked(v) or v.dtype == object else v
            for name, v in columns.items()
        }
        return pl.DataFrame(series, strict=False)


def open(paths: Path | Iterable[Path]) -> Log:
    """Opens a log: one file, or all files of one run in any order.

    A file that was cut short or damaged opens as well; ``info()["missing"]`` tells.

    Raises :class:`FileNotFoundError` and its like where a file cannot be read,
    :class:`atvrec.LogError` where one is no log or belongs to another run.
    """
    if isinstance(paths, (str, os.PathLike)):
        paths = [paths]
    return Log(paths)


def opened(log: Log | Path | Iterable[Path]) -> Log:
    """The log, opened if it is not yet."""
    return log if isinstance(log, Log) else open(log)


def _time_ns(name: str, time_s: float | None, first_ns: int, otherwise_ns: int) -> int:
    if time_s is None:
        return otherwise_ns
    if not np.isfinite(time_s):
        raise ArgumentError(f"{name} = {time_s} s: must be a finite number, or None")
    return min(max(first_ns + round(time_s * 1e9), 0), _LAST_NS)


def _is_masked(values: npt.NDArray[Any]) -> bool:
    return isinstance(values, np.ma.MaskedArray)


def _plain(values: npt.NDArray[Any]) -> list[Any]:
    """Python values, ``None`` where masked, lists where nested."""
    return [v.tolist() if isinstance(v, np.ndarray) else v for v in values.tolist()]
