"""Stores: the logs of a fleet, and its dataset."""

from __future__ import annotations

import contextlib
import hashlib
import os
import posixpath
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path as FilePath
from typing import Any, TypeVar

from atvrec._atvrec import ArgumentError
from atvrec.fleet import tables

Options = Mapping[str, Any]
T = TypeVar("T")

_PART = re.compile(r"^(?P<stem>.+)_(?P<part>\d{4})\.mcap$")
_TRIES = 4
_WAIT_S = 0.5
"""Wait before the second try of a store; doubled each time."""


@dataclass(frozen=True)
class Run:
    """A run: its files in the order of recording."""

    name: str
    """Name of the first file, without its number and extension."""
    files: tuple[str, ...]
    """Paths or addresses."""
    bytes: int
    """Size of all files."""
    source: str
    """What identifies the files without reading them: a hash of their addresses, sizes and times."""


def find(paths: str | os.PathLike[str] | Iterable[Any], storage_options: Options | None = None) -> list[Run]:
    """The runs of some paths: files, directories, globs (``s3://bucket/**/*.mcap``), or rows of a table with
    the column ``path``. The parts of a run (``NAME_0000.mcap``, ``NAME_0001.mcap``) are one run. Files that
    are still being written (``.active``) are left out.

    Raises :class:`FileNotFoundError` where a path has no log.
    """
    parts: dict[str, list[tuple[int, str, int, str]]] = {}
    for text in _listed(paths):
        for url, info in _logs_of(text, storage_options or {}):
            found = _PART.match(url)
            stem, part = (found["stem"], int(found["part"])) if found else (url, 0)
            stamp = str(info.get("ETag") or info.get("mtime") or info.get("LastModified") or "")
            entry = (part, url, int(info.get("size") or 0), stamp)
            known = parts.setdefault(stem, [])
            if entry not in known:
                known.append(entry)
    runs = []
    for stem, entries in sorted(parts.items()):
        entries.sort()
        name = posixpath.basename(stem).removesuffix(".mcap")
        source = hashlib.sha256(repr(entries).encode()).hexdigest()
        files = tuple(url for _, url, _, _ in entries)
        runs.append(Run(name, files, sum(size for _, _, size, _ in entries), source))
    return runs


def _listed(paths: str | os.PathLike[str] | Iterable[Any]) -> list[str]:
    if isinstance(paths, (str, os.PathLike)):
        return [os.fspath(paths)]
    table: Any = paths
    if hasattr(table, "columns"):
        columns = list(table.columns)
        if "path" not in columns:
            raise ArgumentError(f"paths: the table has no column path; it has {', '.join(columns)}")
        table = list(table["path"])
    return [os.fspath(path) for path in table]


def _logs_of(text: str, options: Options) -> Iterator[tuple[str, dict[str, Any]]]:
    import fsspec

    fs, path = fsspec.core.url_to_fs(text, **options)
    if any(sign in path for sign in "*?["):
        found = again(lambda: fs.glob(path, detail=True))
    elif again(lambda: fs.isdir(path)):
        found = again(lambda: fs.find(path, detail=True))
        found = {name: info for name, info in found.items() if str(name).endswith(".mcap")}
    else:
        found = {path: again(lambda: fs.info(path))}
    logs = {
        str(name): info
        for name, info in found.items()
        if info.get("type") != "directory" and not str(name).endswith(".active")
    }
    if not logs:
        raise FileNotFoundError(f"{text}: no log is there")
    for name, info in sorted(logs.items()):
        yield fs.unstrip_protocol(name) if "://" in text else name, info


@dataclass(frozen=True)
class Known:
    """What the dataset has."""

    keys: frozenset[str]
    """Keys of results that are not to be computed again."""
    contents: Mapping[str, str]
    """Hash of the contents by what identifies the files."""


@dataclass(frozen=True)
class Target:
    """A dataset."""

    url: str
    options: Options

    @classmethod
    def open(cls, url: str, options: Options) -> Target:
        target = cls(url if "://" in url else os.path.abspath(url), options)
        fs, path = target._fs()
        others = []
        if again(lambda: fs.exists(path)):
            if not again(lambda: fs.isdir(path)):
                raise ArgumentError(f"out = {url}: is a file; name a directory")
            names = [posixpath.basename(str(name).rstrip("/")) for name in fs.ls(path, detail=False)]
            others = sorted(set(names) - {*tables.TABLES, "estimates", "manifest.json", ""})
        if others:
            raise ArgumentError(
                f"out = {url}: has other data ({', '.join(others[:5])}); use an empty directory, or one that "
                "fleet.run wrote"
            )
        return target

    def _fs(self) -> tuple[Any, str]:
        import fsspec

        fs, path = fsspec.core.url_to_fs(self.url, **self.options)
        # Other machines write into the same directory.
        fs.invalidate_cache()
        return fs, str(path).rstrip("/")

    def known(self) -> Known:
        fs, path = self._fs()
        rows = again(lambda: tables.read_runs(fs, path))
        return Known(
            frozenset(row["key"] for row in rows if not row["transient"]),
            {row["source"]: row["content"] for row in rows if row["content"]},
        )

    def has(self, key: str) -> bool:
        """Whether there is a result with this key that is not to be computed again."""
        import pyarrow.parquet as pq

        fs, path = self._fs()
        name = f"{path}/runs/{key}.parquet"
        if not again(lambda: fs.exists(name)):
            return False

        def is_transient() -> bool:
            with fs.open(name, "rb") as file:
                return bool(pq.read_table(file, columns=["transient"])["transient"][0].as_py())

        return not again(is_transient)

    def put(self, name: str, data: bytes) -> None:
        """Writes a file of the dataset."""
        fs, path = self._fs()
        again(lambda: tables.put(fs, f"{path}/{name}", data))

    def write(self, key: str, files: Mapping[str, bytes]) -> None:
        """Writes the files of a result. That of the table ``runs`` comes last, and makes the result
        valid."""
        for table in sorted(files, key=lambda table: table == "runs"):
            self.put(f"{table}/{key}.parquet", files[table])

    def remove(self, key: str) -> None:
        fs, path = self._fs()
        with contextlib.suppress(FileNotFoundError):
            fs.rm_file(f"{path}/runs/{key}.parquet")


def fetched(one: Run, folder: FilePath, options: Options) -> tuple[list[FilePath], str]:
    """The files of a run on this machine, and a hash of their contents."""
    import fsspec

    hashed = hashlib.sha256()
    files = []
    for number, url in enumerate(one.files):
        fs, path = fsspec.core.url_to_fs(url, **options)
        if "file" in tables.protocols(fs):
            local = FilePath(path)
        else:
            local = folder / f"{number:04}-{posixpath.basename(path)}"
            again(partial(fs.get_file, path, str(local)))
        with open(local, "rb") as file:
            digest = hashlib.file_digest(file, "sha256") if hasattr(hashlib, "file_digest") else None
            if digest is None:
                digest = hashlib.sha256()
                while piece := file.read(1 << 20):
                    digest.update(piece)
        hashed.update(digest.digest())
        files.append(local)
    return files, hashed.hexdigest()


def again(call: Callable[[], T]) -> T:
    """Calls a store, and again where it fails for a while. A missing file and a refused access are not
    tried again."""
    wait_s = _WAIT_S
    for attempt in range(_TRIES):
        try:
            return call()
        except (FileNotFoundError, PermissionError, NotADirectoryError, IsADirectoryError):
            raise
        except OSError:
            if attempt + 1 == _TRIES:
                raise
        time.sleep(wait_s)
        wait_s *= 2.0
    raise AssertionError("the last try returns or raises")
