"""The work on many runs with Dask."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import atvrec
from atvrec import frames
from atvrec._atvrec import ArgumentError, AtvrecError, __version__
from atvrec.fleet import tables
from atvrec.fleet.steps import Drive, NoResult, Step, apply
from atvrec.fleet.store import Options, Run, Target, fetched, find

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Result:
    """What a call of :func:`run` did."""

    out: str
    """The dataset."""
    rows: list[dict[str, Any]] = field(repr=False)
    """A row for each run: name, key, status (``done``, ``known`` or ``failed``) and reason."""
    seconds: float
    """Time of the call."""

    @property
    def done(self) -> int:
        """Runs with a new result."""
        return self._count("done")

    @property
    def known(self) -> int:
        """Runs whose result was there."""
        return self._count("known")

    @property
    def failed(self) -> int:
        """Runs without a result; :attr:`rows` has the reasons."""
        return self._count("failed")

    def frame(self) -> pd.DataFrame:
        """The rows as a pandas frame."""
        import pandas as pd

        return pd.DataFrame(self.rows)

    def _count(self, status: str) -> int:
        return sum(row["status"] == status for row in self.rows)

    def __str__(self) -> str:
        return (
            f"{len(self.rows)} runs: {self.done} done, {self.known} known, {self.failed} failed, "
            f"in {self.seconds:.1f} s; results in {self.out}"
        )

    def _repr_html_(self) -> str:
        failed = [row for row in self.rows if row["status"] == "failed"]
        rows = [(row["run"], row["reason"] or "") for row in failed[:20]]
        return frames.html("atvrec fleet", {"result": str(self)}, ("failed run", "reason"), rows)


def run(
    paths: str | os.PathLike[str] | Iterable[Any],
    steps: Sequence[Step],
    out: str | os.PathLike[str],
    *,
    cluster: Any = None,
    storage_options: Options | None = None,
    out_options: Options | None = None,
    retries: int = 2,
    in_flight: int | None = None,
    progress: bool = True,
) -> Result:
    """Applies steps to runs, and writes a dataset.

    - ``paths``: what :func:`find` accepts, or the runs that it returned
    - ``steps``: what to do with each run, in this order
    - ``out``: directory or address of the dataset, see ``docs/fleet.md``; other files in it are refused
    - ``cluster``: a Dask client or cluster, or the address of a scheduler; without it, a process for each
      processor of this machine
    - ``storage_options``, ``out_options``: options of fsspec for the logs and for the dataset
    - ``retries``: how often a run is tried again on another worker after its worker was lost
    - ``in_flight``: runs that are given to the scheduler at the same time; without it, four for each worker
    - ``progress``: whether to show a bar (terminal or notebook)

    A run that fails is a row with the reason. The call itself fails only where the paths, the steps or the
    dataset cannot be used.
    """
    begin = time.monotonic()
    if not steps:
        raise ArgumentError("steps = []: name at least one step, such as fleet.summary()")
    if retries < 0:
        raise ArgumentError(f"retries = {retries}: must not be negative")
    given = list(paths) if not isinstance(paths, (str, os.PathLike)) and not hasattr(paths, "columns") else None
    if given and all(isinstance(one, Run) for one in given):
        runs = given
    else:
        runs = find(paths if given is None else given, storage_options)
    target = Target.open(os.fspath(out), out_options or {})
    job = _Job(tuple(steps), target, dict(storage_options or {}))
    known = target.known()
    rows: list[dict[str, Any]] = []
    todo: list[Run] = []
    for one in runs:
        content = known.contents.get(one.source)
        key = None if content is None else job.key(content)
        if key is not None and key in known.keys:
            rows.append(_row(one, "known", key))
        else:
            todo.append(one)
    if todo:
        with _client(cluster) as client:
            rows += _work(client, job, todo, retries, in_flight, progress)
    result = Result(target.url, sorted(rows, key=lambda row: str(row["run"])), time.monotonic() - begin)
    target.put("manifest.json", json.dumps(_manifest(job, result), indent=1).encode())
    return result


def _manifest(job: _Job, result: Result) -> dict[str, Any]:
    """Content of ``manifest.json``: the last call."""
    return {
        "version": __version__,
        "steps": [{"name": step.name, "options": step.options} for step in job.steps],
        "runs": result.rows,
        "done": result.done,
        "known": result.known,
        "failed": result.failed,
        "seconds": result.seconds,
    }


def _row(one: Run, status: str, key: str | None, reason: str | None = None) -> dict[str, Any]:
    return {"run": one.name, "status": status, "key": key, "reason": reason, "files": list(one.files)}


def _work(
    client: Any,
    job: _Job,
    todo: Sequence[Run],
    retries: int,
    in_flight: int | None,
    progress: bool,
) -> list[dict[str, Any]]:
    """Keeps some runs in flight until all are done."""
    from distributed import as_completed
    from tqdm.auto import tqdm

    workers = max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
    limit = in_flight or 4 * workers
    waiting = iter(todo)
    open_runs: dict[str, Run] = {}
    rows = []

    def submit(one: Run) -> Any:
        key = f"atvrec-run-{one.source[:24]}-{job.digest[:8]}"
        open_runs[key] = one
        return client.submit(work_on, job, one, key=key, retries=retries, pure=False)

    first = [submit(one) for _, one in zip(range(limit), waiting, strict=False)]
    queue = as_completed(first, with_results=False)
    with tqdm(total=len(todo), unit="run", disable=not progress) as bar:
        for future in queue:
            one = open_runs.pop(future.key)
            error = None if future.status == "finished" else future.exception()
            if error is None:
                rows.append(future.result())
            else:
                reason = f"the worker was lost or failed: {type(error).__name__}: {error}"
                rows.append(job.failed(one, None, reason, transient=True))
            future.release()
            bar.update()
            following = next(waiting, None)
            if following is not None:
                queue.add(submit(following))
    return rows


@contextlib.contextmanager
def local_cluster(workers: int | None = None) -> Iterator[Any]:
    """A Dask cluster of this machine: one process with one thread for each worker.

    - ``workers``: number of workers; without it, one for each processor

    Workers do not profile themselves. A profile grows by about 50 kB for each second of work.
    """
    if workers is not None and workers < 1:
        raise ArgumentError(f"workers = {workers}: must be at least 1")
    import dask
    from distributed import LocalCluster

    with (
        dask.config.set({"distributed.worker.profile.enabled": False}),
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as local,
    ):
        yield local


@contextlib.contextmanager
def _client(cluster: Any) -> Iterator[Any]:
    from distributed import Client

    if isinstance(cluster, Client):
        yield cluster
    elif cluster is None:
        with local_cluster() as local, Client(local) as client:
            yield client
    else:
        with Client(cluster) as client:
            yield client


@dataclass(frozen=True)
class _Job:
    """What is to be done with every run."""

    steps: tuple[Step, ...]
    target: Target
    storage_options: Options

    @property
    def digest(self) -> str:
        """Hash of the version and of the steps with their options."""
        hashed = hashlib.sha256(__version__.encode())
        for step in self.steps:
            hashed.update(json.dumps([step.name, step.options], sort_keys=True, default=str).encode())
            for name, content in sorted(step.files.items()):
                hashed.update(name.encode() + hashlib.sha256(content).digest())
        return hashed.hexdigest()

    def key(self, content: str) -> str:
        """Key of the result of a log with these contents."""
        return hashlib.sha256(f"{content} {self.digest}".encode()).hexdigest()[:32]

    def names(self) -> str:
        return json.dumps([[step.name, step.options] for step in self.steps], default=str)

    def failed(self, one: Run, content: str | None, reason: str, *, transient: bool) -> dict[str, Any]:
        """Writes the row of a run that failed, and returns it."""
        key = self.key(content) if content else f"unread-{self.key(one.source)[:25]}"
        row = {
            "key": key,
            "run": one.name,
            "status": "failed",
            "reason": reason,
            "transient": transient,
            "files": list(one.files),
            "source": one.source,
            "content": content,
            "bytes": one.bytes,
            "version": __version__,
            "steps": self.names(),
        }
        try:
            self.target.write(key, {"runs": tables.file_of([row], tables.TABLES["runs"])})
        except Exception as error:
            reason = f"{reason}; and the row could not be written: {type(error).__name__}: {error}"
        return _row(one, "failed", key, reason)


def work_on(job: _Job, one: Run) -> dict[str, Any]:
    """The work on one run, on a worker. Failures are rows, not exceptions."""
    begin = time.monotonic()
    content = None
    with tempfile.TemporaryDirectory(prefix="atvrec-fleet-") as folder:
        try:
            files, content = fetched(one, FilePath(folder), job.storage_options)
            key = job.key(content)
            if job.target.has(key):
                return _row(one, "known", key)
            drive = Drive(atvrec.open(files), FilePath(folder))
            failure = _apply_all(job, drive)
            result = _files(job, one, content, drive, time.monotonic() - begin, failure)
            job.target.write(key, result)
            job.target.remove(f"unread-{job.key(one.source)[:25]}")
            return _row(one, "failed" if failure else "done", key, failure)
        except AtvrecError as error:
            return job.failed(one, content, f"{type(error).__name__}: {error}", transient=False)
        except OSError as error:
            return job.failed(one, content, f"{type(error).__name__}: {error}", transient=True)
        except Exception as error:
            return job.failed(one, content, f"internal error: {error!r}", transient=False)


def _apply_all(job: _Job, drive: Drive) -> str | None:
    """Applies the steps. A failed replay ends the work, and its reason is returned; another step without a
    result is a row of the table ``steps``."""
    for step in job.steps:
        begin = time.monotonic()
        status, reason = "done", None
        try:
            apply(step, drive)
        except (NoResult, atvrec.DataError) as error:
            status, reason = "no result", str(error)
        except AtvrecError as error:
            # A log that opens lacks what the step needs; without a replay, nothing that follows is right.
            status = "failed" if step.name == "replay" else "no result"
            reason = f"{type(error).__name__}: {error}"
        seconds = time.monotonic() - begin
        drive.add("steps", step=step.name, status=status, reason=reason, seconds=seconds)
        if status == "failed":
            return f"{step.name}: {reason}"
    return None


def _files(
    job: _Job, one: Run, content: str, drive: Drive, seconds: float, failure: str | None
) -> dict[str, bytes]:
    """The Parquet files of a result by table."""
    import numpy as np
    import pyarrow as pa

    info = drive.log.info()
    start = info["start_ns"]
    head = {
        "key": job.key(content),
        "run": one.name,
        "vehicle": drive.vehicle,
        "start": None if start is None else pa.scalar(start, pa.timestamp("ns", "UTC")).as_py(),
    }
    distances = [row["value"] for row in drive.rows.get("summary", []) if row["quantity"] == "distance"]
    drive.add(
        "runs",
        status="failed" if failure else "done",
        reason=failure,
        transient=False,
        files=list(one.files),
        source=one.source,
        content=content,
        bytes=one.bytes,
        duration_s=drive.log.duration_s,
        distance_m=distances[0] if distances else None,
        version=__version__,
        steps=job.names(),
        seconds=seconds,
    )
    files = {
        table: tables.file_of([head | row for row in rows], tables.TABLES[table])
        for table, rows in drive.rows.items()
    }
    if drive.estimates is not None:
        table = drive.estimates
        for name in ("vehicle", "run", "key"):
            column = pa.array(np.full(table.num_rows, head[name], object), pa.string())
            table = table.add_column(0, name, column.dictionary_encode())
        files["estimates"] = tables.file_of_table(table)
    return files
