"""Logs as arrays and frames."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict, overload

import numpy as np
import numpy.typing as npt

from atvrec import frames
from atvrec._atvrec import ArgumentError, LogReader

if TYPE_CHECKING:
    from atvrec.identify import Findings

    import pandas as pd
    import polars as pl
    import pyarrow as pa

Path = str | os.PathLike[str]
Rows: TypeAlias = Literal["instants", "messages"]
Interpolation: TypeAlias = Literal["linear", "previous", "nearest"]

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

    def _note(self, missing: list[str]) -> None:
        self._missing += [text for text in missing if text not in self._missing]

    def info(self) -> Info:
        """What the log holds, in numbers."""
        return self._reader.info()

    def read(
        self,
        topic: str,
        start_s: float | None = None,
        end_s: float | None = None,
        *,
        columns: Sequence[str] | None = None,
        rows: Rows = "instants",
    ) -> dict[str, npt.NDArray[Any]]:
        """The fields of a topic as arrays of one entry a row, by the field's name.

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
        are ``None``. An array in which every value is absent cannot be written to and takes no
        memory. Enumerations are numbers; :meth:`enums` has their names.

        - ``columns`` names the fields to read, or what they belong to: ``"fl"`` stands for all fields
          of the front left wheel. Other fields take no memory.
        - ``rows="instants"`` joins the messages that bring different wheels of the same instant to
          one row, with the times of the last one of them. A message belongs to the instant if it is at
          most half a sampling interval later than the first. ``rows="messages"`` has one row for each
          message.

        Raises :class:`atvrec.LogError` where the log has no such topic, :class:`atvrec.ArgumentError`
        where the topic has no such field.
        """
        wanted = None if columns is None else {topic: columns}
        return self.read_many([topic], start_s, end_s, columns=wanted, rows=rows)[topic]

    def read_many(
        self,
        topics: Sequence[str],
        start_s: float | None = None,
        end_s: float | None = None,
        *,
        columns: Mapping[str, Sequence[str]] | None = None,
        rows: Rows = "instants",
    ) -> dict[str, dict[str, npt.NDArray[Any]]]:
        """Several topics as by :meth:`read`, by their names. The log is read in one pass, which is
        faster than one call of :meth:`read` for each topic. ``columns`` has the fields to read by the
        topic's name; of topics that it does not name, all fields are read.
        """
        first = self.start_ns
        if isinstance(topics, str):
            raise ArgumentError(f"topics = {topics!r}: must be a list of names; use [{topics!r}]")
        if rows not in ("instants", "messages"):
            raise ArgumentError(f"rows = {rows!r}: must be 'instants' or 'messages'")
        topics = list(dict.fromkeys(topics))
        found = self._reader.read(
            topics,
            [_names("columns", (columns or {}).get(topic)) for topic in topics],
            _time_ns("start_s", start_s, first, 0),
            _time_ns("end_s", end_s, first, _LAST_NS),
            rows == "instants",
        )
        results: dict[str, dict[str, npt.NDArray[Any]]] = {}
        for topic, (values, _, missing) in zip(topics, found, strict=True):
            self._note(missing)
            t_s = (values["publish_time_ns"] - np.int64(first)) * 1e-9
            results[topic] = {"t_s": t_s, **values}
        return results

    def batches(
        self,
        topic: str,
        seconds: float = 60.0,
        start_s: float | None = None,
        end_s: float | None = None,
        *,
        columns: Sequence[str] | None = None,
        rows: Rows = "instants",
    ) -> Iterator[dict[str, npt.NDArray[Any]]]:
        """A topic as by :meth:`read`, piece by piece, for logs that are larger than the memory.

        A piece has the messages that were recorded within ``seconds``; pieces without a message are
        left out. Topics that ``record.decoded`` leaves out of the log are decoded from its start on for
        each piece; use :meth:`read` for these.
        """
        if not (np.isfinite(seconds) and seconds > 0.0):
            raise ArgumentError(f"seconds = {seconds}: must be finite and greater than 0")
        first = self.start_ns
        begin = _time_ns("start_s", start_s, first, first)
        end = min(_time_ns("end_s", end_s, first, _LAST_NS), first + round(self.duration_s * 1e9))
        step = max(round(seconds * 1e9), 1)
        names = _names("columns", columns)
        while begin <= end:
            last = min(begin + step - 1, end)
            ((values, _, missing),) = self._reader.read(
                [topic], [names], begin, last, rows == "instants"
            )
            self._note(missing)
            if values["log_time_ns"].size:
                yield {"t_s": (values["publish_time_ns"] - np.int64(first)) * 1e-9, **values}
            begin = last + 1

    @overload
    def frame(
        self,
        fields: str | Sequence[str],
        *,
        rate_hz: float | None = None,
        method: Interpolation = "linear",
        max_gap_s: float | None = None,
        start_s: float | None = None,
        end_s: float | None = None,
        kind: Literal["pandas"] = "pandas",
    ) -> pd.DataFrame: ...

    @overload
    def frame(
        self,
        fields: str | Sequence[str],
        *,
        rate_hz: float | None = None,
        method: Interpolation = "linear",
        max_gap_s: float | None = None,
        start_s: float | None = None,
        end_s: float | None = None,
        kind: Literal["polars", "arrow", "xarray"],
    ) -> Any: ...

    def frame(
        self,
        fields: str | Sequence[str],
        *,
        rate_hz: float | None = None,
        method: Interpolation = "linear",
        max_gap_s: float | None = None,
        start_s: float | None = None,
        end_s: float | None = None,
        kind: Literal["pandas", "polars", "arrow", "xarray"] = "pandas",
    ) -> Any:
        """Fields of several topics as one table with common times.

        ``fields`` has topics (``"/estimate/motion"``) and fields of topics
        (``"/estimate/motion.sideslip_rad"``, ``"/estimate/tyre_forces.fl"`` for all of a wheel). The
        columns of the table are ``topic.field``, as with ``atvrec export --wide``.

        - ``rate_hz``: the rows are at this rate, on whole seconds of UTC if it is a whole number;
          without it, at the instants of the first topic
        - ``method``: ``"linear"`` between the values around a row, ``"previous"``, or ``"nearest"``.
          Texts, truth values and enumerations are never interpolated linearly, but have the previous
          value
        - ``max_gap_s``: no value is computed inside of a gap between values that is longer; without
          it, three times the median interval of the field, at most 5 s
        - ``kind``: ``"pandas"`` (index of UTC), ``"polars"``, ``"arrow"`` (pyarrow; column
          ``time``), ``"xarray"`` (a dataset with the coordinate ``time`` in UTC)

        A row without a value is NaN or null. Units are in ``frame.attrs["units"]`` (pandas), in the
        metadata of the fields (arrow) and in ``dataset[name].attrs["units"]`` (xarray). The times are
        UTC by the receiver that sent date and time, and those of the log clock, which was set to UTC when
        the recording began, where none did.

        Raises :class:`atvrec.LogError` where the log has no such topic, :class:`atvrec.ArgumentError`
        where a topic has no such field or an argument cannot be used, :class:`ImportError` where the
        package for ``kind`` is not installed.
        """
        if kind not in frames.MAKERS:
            names = ", ".join(repr(name) for name in frames.MAKERS)
            raise ArgumentError(f"kind = {kind!r}: must be one of {names}")
        if max_gap_s is not None and not (np.isfinite(max_gap_s) and max_gap_s > 0.0):
            raise ArgumentError(f"max_gap_s = {max_gap_s} s: must be finite and greater than 0")
        wanted = frames.selection(fields, self.topics)
        first = self.start_ns
        times, found = self._reader.frame(
            list(wanted),
            list(wanted.values()),
            _time_ns("start_s", start_s, first, 0),
            _time_ns("end_s", end_s, first, _LAST_NS),
            rate_hz,
            method,
            None if max_gap_s is None else round(max_gap_s * 1e9),
        )
        columns: dict[str, npt.NDArray[Any]] = {}
        units: dict[str, str] = {}
        for topic, (values, of_topic, missing) in zip(wanted, found, strict=True):
            self._note(missing)
            for name, column in values.items():
                if name not in ("log_time_ns", "publish_time_ns"):
                    columns[f"{topic}.{name}"] = column
                    units[f"{topic}.{name}"] = of_topic.get(name, "")
        return frames.MAKERS[kind](times, columns, units)

    def identify(self, kind: str, *, start_s: float = 2.0, seed: int = 1) -> list[Findings]:
        """Parameters of the vehicle from the log's estimates after ``start_s``, as ``atvrec identify KIND``
        finds them. ``kind`` is ``cornering``, ``tyre``, ``roll-pitch``, ``inertia``, ``understeer``,
        ``response``, ``friction``, ``slip``, ``camber``, ``aligning`` or ``toe``; ``seed`` is that of the
        bootstrap.

        Raises :class:`atvrec.DataError` where the drive does not determine them,
        :class:`atvrec.LogError` or :class:`atvrec.ArgumentError` where the log lacks what is needed.
        """
        return self._reader.identify(kind, start_s, seed)

    def latencies(self) -> list[dict[str, Any]]:
        """Latencies of messages, as ``atvrec identify latency --json`` finds them by repeating the estimate:
        each with the keys ``message``, ``latency_s``, ``sigma_s``, ``interval_s`` (95 %), ``is_found``,
        ``configured_latency_s`` and ``configured_sigma_s``.

        Raises :class:`atvrec.LogError` or :class:`atvrec.ArgumentError` where the log has no configuration, the
        configuration no ``latency_sigma_s``, or the vehicle no linkages.
        """
        found: list[dict[str, Any]] = json.loads(self._reader.latencies_json())["latencies"]
        return found

    def mistakes(self) -> dict[str, Any]:
        """Mistakes of the configuration, as ``atvrec identify mistakes --json`` finds them by repeating the
        estimate: ``found`` is a list with the keys ``time_ns``, ``subject``, ``cause``, ``help``,
        ``log_likelihood_ratio`` and ``corrected``; ``likeliest`` is the likeliest beside them, ``used_s`` the
        driving time that was used since the last correction, ``decisive`` whether it was enough, ``manoeuvre``
        what decides more and how long it takes.

        Raises :class:`atvrec.LogError` or :class:`atvrec.ArgumentError` where the log has no configuration or
        no vehicle with linkages.
        """
        found: dict[str, Any] = json.loads(self._reader.mistakes_json())
        return found

    def summary(self, *, smoothed: bool = False) -> dict[str, Any]:
        """The numbers of ``atvrec report --json``, whose keys are in ``docs/report.md``: distance,
        verdict, events, forces of each wheel and so on."""
        numbers: dict[str, Any] = json.loads(self._reader.report_json(smoothed))
        return numbers

    def to_arrow(
        self,
        topic: str,
        start_s: float | None = None,
        end_s: float | None = None,
        *,
        columns: Sequence[str] | None = None,
    ) -> pa.Table:
        """A topic as a pyarrow table, with units in the metadata of its fields. Numbers are not copied.
        Needs pyarrow."""
        units = self.units(topic)
        return frames.arrow(self.read(topic, start_s, end_s, columns=columns), units)

    def units(self, topic: str) -> dict[str, str]:
        """Units of a topic's fields, by the DBC file or by the field's name. Fields without a unit are
        left out."""
        return self._reader.read([topic], [[]], 1, 0, False)[0][1]

    def enums(self, topic: str) -> dict[str, dict[int, str]]:
        """Names of the values of those fields of a topic that are enumerations."""
        return self._reader.enums(topic)

    def to_pandas(
        self,
        topic: str,
        start_s: float | None = None,
        end_s: float | None = None,
        *,
        columns: Sequence[str] | None = None,
    ) -> pd.DataFrame:
        """A topic as a pandas frame, indexed by ``t_s``. Needs pandas."""
        import pandas as pd

        values = self.read(topic, start_s, end_s, columns=columns)
        series = {name: frames.pandas_column(column) for name, column in values.items()}
        return pd.DataFrame(series).set_index("t_s")

    def to_polars(
        self,
        topic: str,
        start_s: float | None = None,
        end_s: float | None = None,
        *,
        columns: Sequence[str] | None = None,
    ) -> pl.DataFrame:
        """A topic as a polars frame. Needs polars."""
        import polars as pl

        values = self.read(topic, start_s, end_s, columns=columns)
        series = {
            name: frames.plain_values(column)
            if frames.is_masked(column) or column.dtype == object
            else column
            for name, column in values.items()
        }
        return pl.DataFrame(series, strict=False)

    def _repr_html_(self) -> str:
        info = self.info()
        facts = {
            "files": ", ".join(os.path.basename(path) for path, _ in info["files"]),
            "begin": str(np.datetime64(self.start_ns, "ns")) + " UTC",
            "duration": f"{self.duration_s:.3f} s",
        }
        if info["missing"]:
            facts["missing"] = "; ".join(info["missing"])
        span = self.duration_s or 1.0
        rows = [
            (topic, f"{count:,}", f"{count / span:.1f}", schema)
            for topic, (schema, count) in sorted(info["channels"].items())
        ]
        return frames.html("atvrec log", facts, ("topic", "messages", "Hz", "schema"), rows)


def open(paths: Path | Iterable[Path]) -> Log:
    """Opens a log: one file, or all files of one run in any order.

    A file that was cut short or damaged opens as well; ``info()["missing"]`` lists what is missing.

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


def _names(argument: str, names: Sequence[str] | None) -> list[str]:
    if isinstance(names, str):
        raise ArgumentError(f"{argument} = {names!r}: must be a list of names; use [{names!r}]")
    return list(names or ())
