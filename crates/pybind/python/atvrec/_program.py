"""The command ``atvrec`` of the wheel: the program, and the commands that need Python."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable, Sequence

_OWN = ("fleet", "trend")
_EPILOG = "docs/fleet.md describes the tables of a dataset."


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code: 0 good, 1 failed, 2 wrong usage, 3 a part failed."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    if given and given[0] in _OWN:
        return _python(given)
    try:
        from atvrec._atvrec import run_program
    except ImportError:
        print("error: the program runs on Linux only; here, use fleet, trend, or the package in Python", file=sys.stderr)
        return 2
    return run_program(["atvrec", *given])


def _python(given: Sequence[str]) -> int:
    parsed = _parser().parse_args(given)
    command: Callable[[argparse.Namespace], int] = parsed.command
    try:
        return command(parsed)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("atvrec"):
            raise
        print(f"error: the package {error.name} is missing; pip install 'atvrec[fleet]'", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; the results of finished runs are in the dataset", file=sys.stderr)
        return 1
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="atvrec", epilog=_EPILOG)
    commands = parser.add_subparsers(required=True)
    fleet = commands.add_parser("fleet", help="process many drives on many machines")
    actions = fleet.add_subparsers(required=True)
    run = actions.add_parser("run", help="apply steps to every run, and write a dataset", epilog=_EPILOG)
    run.add_argument("paths", nargs="+", metavar="PATH", help="files, directories, globs; also s3://...")
    run.add_argument("-o", "--out", required=True, metavar="DATASET", help="directory or address of the dataset")
    run.add_argument(
        "--steps",
        default="replay,summary",
        metavar="LIST",
        help="steps in their order, with commas: replay, score, summary, springs, rest, estimates, "
        "identify:KIND [default: %(default)s]",
    )
    run.add_argument("--vehicle", metavar="FILE", help="vehicle file of the replay")
    run.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler, such as tcp://host:8786")
    run.add_argument("--workers", type=int, metavar="N", help="processes on this machine [default: processors]")
    run.add_argument("--retries", type=int, default=2, metavar="N", help="tries after a lost worker [default: 2]")
    run.add_argument("--storage-options", type=_options, metavar="JSON", help="options of fsspec for the logs")
    run.add_argument("--out-options", type=_options, metavar="JSON", help="options of fsspec for the dataset")
    run.add_argument("-q", "--quiet", action="store_true", help="no progress")
    run.add_argument("--json", action="store_true", help="print the result as JSON")
    run.set_defaults(command=_fleet_run)
    trend = commands.add_parser("trend", help="which parameters changed over the drives of a dataset")
    trend.add_argument(
        "dataset",
        metavar="DATASET",
        help="directory or address that fleet run wrote; or a directory of logs, to which the steps replay, "
        "identify:cornering, summary, springs and rest are applied first",
    )
    trend.add_argument(
        "-o", "--out", metavar="DATASET", help="where the results of a directory of logs are kept for the next call"
    )
    trend.add_argument("--false-alarms", type=float, default=0.01, metavar="P", help="[default: 0.01]")
    trend.add_argument("--vehicle", metavar="NAME", help="only this vehicle")
    trend.add_argument("--figure", metavar="FILE", help="draw the parameters to this file (PNG, SVG or PDF)")
    trend.add_argument("--storage-options", type=_options, metavar="JSON", help="options of fsspec")
    trend.add_argument("--json", action="store_true", help="print the result as JSON")
    trend.set_defaults(command=_trend)
    return parser


def _options(text: str) -> dict[str, object]:
    try:
        found = json.loads(text)
    except json.JSONDecodeError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no JSON: {error}") from None
    if not isinstance(found, dict):
        raise argparse.ArgumentTypeError(f"{text!r} is no JSON object such as '{{\"anon\": true}}'")
    return found


def _fleet_run(parsed: argparse.Namespace) -> int:
    from atvrec import fleet

    steps = []
    for text in parsed.steps.split(","):
        name, _, kind = text.strip().partition(":")
        if name == "replay":
            steps.append(fleet.replay(vehicle=parsed.vehicle))
        elif name == "identify":
            steps.append(fleet.identify(kind))
        elif name in ("score", "summary", "springs", "rest", "estimates") and not kind:
            steps.append(getattr(fleet, name)())
        else:
            known = "replay, score, summary, springs, rest, estimates, identify:KIND"
            raise ValueError(f"--steps: {text.strip()!r} is unknown; use {known}")
    if parsed.workers is not None and parsed.workers < 1:
        raise ValueError(f"--workers {parsed.workers}: must be at least 1")
    with contextlib.ExitStack() as stack:
        cluster: object = parsed.scheduler
        if cluster is None and parsed.workers is not None:
            cluster = stack.enter_context(fleet.local_cluster(parsed.workers))
        found = fleet.run(
            parsed.paths,
            steps,
            parsed.out,
            cluster=cluster,
            storage_options=parsed.storage_options,
            out_options=parsed.out_options,
            retries=parsed.retries,
            progress=not parsed.quiet,
        )
    if parsed.json:
        print(json.dumps({"out": found.out, "seconds": found.seconds, "runs": found.rows}, indent=1))
    else:
        print(found)
        for row in found.rows:
            if row["status"] == "failed":
                print(f"failed: {row['run']}: {row['reason']}")
    return 3 if found.failed else 0


def _is_directory_of_logs(path: str) -> bool:
    return os.path.isdir(path) and not os.path.isdir(os.path.join(path, "parameters"))


def _process(parsed: argparse.Namespace, dataset: str) -> None:
    """Finds the parameters of all logs of a directory."""
    from atvrec import fleet

    steps = [fleet.replay(), fleet.identify("cornering"), fleet.summary(), fleet.springs(), fleet.rest()]
    found = fleet.run(parsed.dataset, steps, dataset, progress=sys.stderr.isatty())
    for row in found.rows:
        if row["status"] == "failed":
            print(f"failed: {row['run']}: {row['reason']}", file=sys.stderr)


def _trend(parsed: argparse.Namespace) -> int:
    from tempfile import TemporaryDirectory

    from atvrec.trend import trend

    with TemporaryDirectory(prefix="atvrec-trend-") as folder:
        dataset = parsed.dataset
        if _is_directory_of_logs(dataset):
            dataset = parsed.out or folder
            _process(parsed, dataset)
        elif parsed.out:
            raise ValueError(f"--out {parsed.out}: {parsed.dataset} is a dataset already; leave --out away")
        found = trend(
            dataset,
            false_alarms=parsed.false_alarms,
            vehicle=parsed.vehicle,
            storage_options=parsed.storage_options,
        )
    if parsed.figure:
        if os.path.exists(parsed.figure):
            raise ValueError(f"--figure {parsed.figure}: exists already; use another name")
        found.figure().savefig(parsed.figure)
    if parsed.json:
        print(found.frame().to_json(orient="records", indent=1))
    else:
        print(found)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
