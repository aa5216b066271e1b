"""Many drives: what is written, what is not done again, workers that die, stores that fail."""

from __future__ import annotations

import http.client
import http.server
import itertools
import json
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import atvrec

pytest.importorskip("distributed")
duckdb = pytest.importorskip("duckdb")

from atvrec import fleet  # noqa: E402
from atvrec._program import main  # noqa: E402

STEPS = [fleet.replay(), fleet.score(), fleet.identify("cornering"), fleet.summary()]


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three drives, a log that was cut, and a file that is no log."""
    folder = tmp_path_factory.mktemp("drives")
    for seed in (11, 12, 13):
        atvrec.simulate("slow-sine", folder / f"drive-{seed}.mcap", seed=seed, duration_s=14.0)
    whole = (folder / "drive-11.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (folder / "text.mcap").write_text("no log")
    return folder


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from distributed import Client

    with fleet.local_cluster(2) as local, Client(local) as client:
        yield client


def test_workers_of_this_machine_do_not_profile_themselves(cluster: Any) -> None:
    """Profiles would fill the memory of a worker."""
    profiles = cluster.run(lambda dask_worker: "profile" in dask_worker.periodic_callbacks)
    assert list(profiles.values()) == [False, False]
    with pytest.raises(atvrec.ArgumentError, match="workers = 0: must be at least 1"):
        fleet.local_cluster(0).__enter__()


def rows(out: Path, query: str) -> list[tuple[Any, ...]]:
    return duckdb.sql(query.replace("TABLE:", f"{out}/")).fetchall()


def test_results_are_a_dataset_and_failures_are_rows(drives: Path, cluster: Any, tmp_path: Path) -> None:
    out = tmp_path / "out"
    found = fleet.run(drives, STEPS, out, cluster=cluster, progress=False)
    assert (found.done, found.known, found.failed) == (4, 0, 1)
    (bad,) = [row for row in found.rows if row["status"] == "failed"]
    assert bad["run"] == "text" and "not an MCAP file" in bad["reason"]
    assert "text" in found._repr_html_() and "4 done" in str(found)
    # What the dataset says is what the package says of one log.
    log = atvrec.open(drives / "drive-12.mcap")
    ((rmse,),) = rows(
        out,
        "select rmse from 'TABLE:scores/*.parquet' where run = 'drive-12' and wheel = 'FL' "
        "and signal = 'measured_force_z'",
    )
    expected = [
        signal["rmse"]
        for signal in atvrec.score(log)["signals"]
        if signal["signal"] == "measured_force_z" and signal["wheel"] == "FL"
    ]
    assert rmse == expected[0]
    (of_log,) = log.identify("cornering")
    found_parameters = dict(
        rows(
            out,
            "select parameter, value from 'TABLE:parameters/*.parquet' "
            "where run = 'drive-12' and step = 'identify:cornering'",
        )
    )
    assert found_parameters == {name: one["value"] for name, one in of_log["findings"].items()}
    ((distance, vehicle),) = rows(
        out, "select distance_m, vehicle from 'TABLE:runs/*.parquet' where run = 'drive-12'"
    )
    assert distance == log.summary()["distance_m"] and vehicle == "Prowler, road tyres"
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["done"] == 4 and len(manifest["runs"]) == 5


def test_a_second_call_does_only_what_is_new(drives: Path, cluster: Any, tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    shutil.copy(drives / "drive-11.mcap", logs)
    steps = [fleet.summary()]
    first = fleet.run(logs, steps, tmp_path / "out", cluster=cluster, progress=False)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.parquet")}
    shutil.copy(drives / "drive-12.mcap", logs)
    # The same contents with another name are the same result.
    shutil.copy(drives / "drive-11.mcap", logs / "copy.mcap")
    second = fleet.run(logs, steps, tmp_path / "out", cluster=cluster, progress=False)
    assert first.done == 1 and (second.done, second.known) == (1, 2)
    assert all(path.stat().st_mtime_ns == time_ns for path, time_ns in before.items())
    # Other options are another result.
    other = [fleet.summary(cycle_classes=8)]
    assert fleet.run(logs, other, tmp_path / "out", cluster=cluster, progress=False).done >= 2


def test_parts_of_a_run_are_one_run(drives: Path, tmp_path: Path) -> None:
    for part in (1, 0):
        shutil.copy(drives / "drive-11.mcap", tmp_path / f"20260101T120000Z_{part:04}.mcap")
    shutil.copy(drives / "drive-12.mcap", tmp_path / "20260101T130000Z_0000.mcap")
    (tmp_path / "20260101T140000Z_0000.mcap.active").write_bytes(b"")
    found = fleet.find(tmp_path)
    assert [run.name for run in found] == ["20260101T120000Z", "20260101T130000Z"]
    assert [Path(name).name for name in found[0].files] == [
        "20260101T120000Z_0000.mcap",
        "20260101T120000Z_0001.mcap",
    ]
    assert [run.name for run in fleet.find(str(tmp_path / "*T13*.mcap"))] == ["20260101T130000Z"]


def test_cycles_are_those_of_another_counter(drives: Path, cluster: Any, tmp_path: Path) -> None:
    other = pytest.importorskip("rainflow")
    from atvrec._atvrec import rainflow

    load = atvrec.open(drives / "drive-11.mcap").read("/estimate/tyre_forces")["fl.z_n"]
    counts, (begin, end) = rainflow(load)
    ours: dict[float, float] = {}
    for count, span in zip(counts, np.abs(load[begin] - load[end]), strict=True):
        ours[round(span, 6)] = ours.get(round(span, 6), 0.0) + count
    theirs: dict[float, float] = {}
    for span, _, count, _, _ in other.extract_cycles(load):
        theirs[round(span, 6)] = theirs.get(round(span, 6), 0.0) + count
    assert ours == theirs
    out = tmp_path / "out"
    fleet.run(drives / "drive-11.mcap", [fleet.summary()], out, cluster=cluster, progress=False)
    ((total, spread),) = rows(
        out,
        "select sum(cycles), max(sigma) from 'TABLE:cycles/*.parquet' "
        "where wheel = 'front left' and axis = 'z'",
    )
    assert total == pytest.approx(counts.sum()) and spread > 0.0


def die_once(job: Any, run: fleet.Run) -> dict[str, Any]:
    """Kills the worker's process when it works on the second drive for the first time."""
    from atvrec.fleet.store import Target

    flag = Path(os.environ["ATVREC_TEST_FLAG"])
    if run.name == "drive-12" and not flag.exists():
        flag.write_text("died")
        # The files of the result are there but for the last one.
        original = Target.write

        def half(target: Any, key: str, files: dict[str, bytes]) -> None:
            files.pop("runs")
            original(target, key, files)
            os._exit(9)

        Target.write = half  # type: ignore[method-assign, assignment]
    return WORK_ON(job, run)


WORK_ON = fleet.work.work_on


def test_a_worker_that_dies_loses_nothing_and_does_nothing_twice(
    drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from distributed import Client, LocalCluster

    monkeypatch.setenv("ATVREC_TEST_FLAG", str(tmp_path / "flag"))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setattr(fleet.work, "work_on", die_once)
    out = tmp_path / "out"
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as local,
        Client(local) as client,
    ):
        found = fleet.run(drives, STEPS, out, cluster=client, progress=False)
    assert (tmp_path / "flag").exists()
    assert (found.done, found.failed) == (4, 1)
    ((doubled,),) = rows(
        out,
        "select count(*) from (select run, signal, wheel, count(*) as n from 'TABLE:scores/*.parquet' "
        "group by all having n > 1)",
    )
    assert doubled == 0
    assert rows(out, "select count(distinct run) from 'TABLE:scores/*.parquet'") == [(4,)]


def always_die(job: Any, run: fleet.Run) -> dict[str, Any]:
    os._exit(9)


def test_a_run_that_kills_every_worker_is_a_row(
    drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dask
    from distributed import Client, LocalCluster

    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setattr(fleet.work, "work_on", always_die)
    log = drives / "drive-11.mcap"
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as local,
        Client(local) as client,
    ):
        found = fleet.run(log, STEPS, tmp_path / "out", cluster=client, retries=0, progress=False)
        assert found.failed == 1 and "the worker was lost" in found.rows[0]["reason"]
        # The reason may be gone the next time.
        monkeypatch.setattr(fleet.work, "work_on", WORK_ON)
        again = fleet.run(log, STEPS, tmp_path / "out", cluster=client, progress=False)
    assert again.done == 1
    assert rows(tmp_path / "out", "select status from 'TABLE:runs/*.parquet'") == [("done",)]


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def test_scheduler_and_workers_are_processes_of_their_own(drives: Path, tmp_path: Path) -> None:
    port = free_port()
    folder = Path(sys.executable).parent
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    address = f"tcp://127.0.0.1:{port}"
    processes = [
        subprocess.Popen(
            [folder / "dask", "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet
        )
    ]
    try:
        for _ in range(2):
            worker = [folder / "dask", "worker", address, "--nthreads", "1", "--no-dashboard"]
            processes.append(subprocess.Popen(worker, cwd=tmp_path, **quiet))
        arguments = ["fleet", "run", str(drives), "-o", str(tmp_path / "out"), "--scheduler", address, "-q"]
        assert main([*arguments, "--steps", "replay,score,identify:cornering,summary"]) == 3
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait()
    assert rows(tmp_path / "out", "select count(*) from 'TABLE:runs/*.parquet' where status = 'done'") == [(4,)]


class FaultyProxy(http.server.BaseHTTPRequestHandler):
    """Passes requests on; every fifth one fails."""

    # The client waits for "100 Continue", which this version sends.
    protocol_version = "HTTP/1.1"
    target = 0
    count = itertools.count(1)
    failed = 0

    def pass_on(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(length)
        if next(self.count) % 5 == 0:
            type(self).failed += 1
            self.send_error(503)
            return
        connection = http.client.HTTPConnection("127.0.0.1", self.target)
        headers = {name: value for name, value in self.headers.items() if name.lower() != "expect"}
        connection.request(self.command, self.path, body, headers)
        answer = connection.getresponse()
        data = answer.read()
        self.send_response(answer.status)
        for name, value in answer.getheaders():
            if name.lower() not in ("transfer-encoding", "content-length", "connection"):
                self.send_header(name, value)
        size = answer.getheader("Content-Length") if self.command == "HEAD" else str(len(data))
        self.send_header("Content-Length", size or "0")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    do_GET = do_PUT = do_POST = do_HEAD = do_DELETE = pass_on

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def object_store(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Any]]:
    """Options of an object store behind a proxy at which every fifth request fails."""
    pytest.importorskip("s3fs")
    pytest.importorskip("moto")
    port = free_port()
    server = subprocess.Popen(
        [Path(sys.executable).parent / "moto_server", "-p", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    FaultyProxy.target = port
    proxy = http.server.ThreadingHTTPServer(("127.0.0.1", 0), FaultyProxy)
    threading.Thread(target=proxy.serve_forever, daemon=True).start()
    try:
        for _ in range(200):
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/moto-api", timeout=1).close()
                break
            except OSError:
                time.sleep(0.1)
        for bucket in ("drives", "results"):
            create = urllib.request.Request(f"http://127.0.0.1:{port}/{bucket}", method="PUT")
            urllib.request.urlopen(create, timeout=10).close()
        yield {
            "key": "test",
            "secret": "test",
            "client_kwargs": {"region_name": "us-east-1"},
            "endpoint_url": f"http://127.0.0.1:{proxy.server_port}",
        }
    finally:
        proxy.shutdown()
        server.terminate()
        server.wait()


def test_an_object_store_that_fails_now_and_then(
    drives: Path, cluster: Any, object_store: dict[str, Any], tmp_path: Path
) -> None:
    import s3fs

    store = s3fs.S3FileSystem(**object_store)
    for path in drives.glob("*.mcap"):
        store.put_file(str(path), f"drives/2026/{path.name}")
    options = {"storage_options": object_store, "out_options": object_store}
    steps = [fleet.summary()]
    arguments: dict[str, Any] = {"cluster": cluster, "progress": False, **options}
    found = fleet.run("s3://drives/2026/*.mcap", steps, "s3://results/one", **arguments)
    assert FaultyProxy.failed > 3
    assert (found.done, found.failed) == (4, 1), found.rows
    again = fleet.run("s3://drives/2026/*.mcap", steps, "s3://results/one", **arguments)
    assert (again.done, again.known) == (0, 5 - again.failed), again.rows
    local = tmp_path / "out"
    store.invalidate_cache()
    store.get("results/one", str(local), recursive=True)
    assert rows(local, "select count(*) from 'TABLE:runs/*.parquet' where status = 'done'") == [(4,)]
    wrong = object_store | {"key": "test"}
    with pytest.raises((FileNotFoundError, PermissionError), match="nothing-here"):
        fleet.run("s3://nothing-here/*.mcap", steps, "s3://results/two", storage_options=wrong, progress=False)


def test_wrong_arguments_are_named(drives: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(FileNotFoundError, match="nothing"):
        fleet.run(tmp_path / "nothing", STEPS, tmp_path / "out", progress=False)
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.txt").write_text("")
    with pytest.raises(atvrec.ArgumentError, match=r"has other data \(thesis\.txt\)"):
        fleet.run(drives, STEPS, other, progress=False)
    assert [path.name for path in other.iterdir()] == ["thesis.txt"]
    with pytest.raises(atvrec.ArgumentError, match="name at least one step"):
        fleet.run(drives, [], tmp_path / "out", progress=False)
    with pytest.raises(atvrec.ArgumentError, match="'slip' is unknown; use one of cornering"):
        fleet.identify("slip")
    assert main(["fleet", "run", str(drives), "-o", str(tmp_path / "out"), "--steps", "paint"]) == 2
    assert "'paint' is unknown; use replay, score" in capsys.readouterr().err
    assert main(["trend", str(tmp_path / "out")]) == 2
    assert "has no table parameters" in capsys.readouterr().err
    empty = tmp_path / "empty"
    empty.mkdir()
    assert main(["trend", str(empty)]) == 2
    assert "no log is there" in capsys.readouterr().err


def test_trend_takes_a_directory_of_logs(
    drives: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["trend", str(drives), "-o", str(out)]) == 2
    said = capsys.readouterr().err
    assert "no parameter has enough drives" in said and "3 drives; 8 are needed" in said
    assert "failed: text:" in said
    found = rows(out, "select distinct step from 'TABLE:parameters/*.parquet' order by step")
    assert [step for (step,) in found] == ["identify:cornering", "learnt", "springs"]


def test_the_command_of_the_wheel_is_the_program() -> None:
    program = Path(sys.executable).parent / "atvrec"
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    assert said.stdout.startswith("atvrec 0.1.0")
    wrong = subprocess.run([program, "info", "/nonexistent.mcap"], capture_output=True, text=True)
    assert wrong.returncode == 1 and "cannot open /nonexistent.mcap" in wrong.stderr
    usage = subprocess.run([program, "--nonsense"], capture_output=True, text=True)
    assert usage.returncode == 2 and "--nonsense" in usage.stderr
    # As a function it can be called again.
    assert [main(["info", "/nonexistent.mcap"]) for _ in range(2)] == [1, 1]
