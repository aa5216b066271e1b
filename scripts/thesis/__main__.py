"""Draws the figures and tables of the thesis, checks them, and writes one HTML page.

    python scripts/thesis [-o PAGE] [--only NUMBER,...] [--checks]

Exits with 1 if a check does not hold, if an entry of the table in docs/thesis.md is missing, or if a figure
cannot be made.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from pathlib import Path

import listing
from drives import ROOT, Drives
from entry import ENTRIES, Check, Entry, Made
from page import as_text, page

for module in ("tyres", "models", "vehicle", "validation", "strain", "turn", "sine"):
    __import__(module)


def made(entry: Entry, drives: Drives) -> Made:
    """The entry; what raises becomes a failed check that names it."""
    try:
        return entry.make(drives)
    except Exception as error:  # noqa: BLE001: the page and the other figures are still made
        traceback.print_exc()
        failed = Check(f"made without an error ({error})", float("nan"), "", 0.0, 0.0)
        return Made(checks=[failed], today="")


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("-o", "--output", type=Path, default=ROOT / "target/thesis/thesis.html")
    arguments.add_argument("--only", help="numbers of figures and tables, separated by commas")
    arguments.add_argument("--checks", action="store_true", help="print all checks")
    chosen = arguments.parse_args()
    started = time.monotonic()
    problems = listing.problems(ROOT / "docs/thesis.md", ENTRIES)
    entries = sorted(ENTRIES, key=lambda entry: entry.key)
    if chosen.only:
        entries = [one for one in entries if one.number in chosen.only.split(",")]
    drives = Drives(chosen.output.parent / "drives")
    results = [(entry, made(entry, drives)) for entry in entries]
    took_s = time.monotonic() - started
    facts = f"{len(results)} figures and tables, made by <code>make thesis</code>."
    chosen.output.parent.mkdir(parents=True, exist_ok=True)
    text = page(results, facts)
    chosen.output.write_text(text, encoding="utf-8")
    lines = as_text(results).splitlines()
    failed = [line for line in lines if line.startswith("FAILED")]
    for line in lines if chosen.checks else failed:
        print(line)
    for problem in problems:
        print(f"FAILED docs/thesis.md: {problem}")
    print(
        f"thesis: {len(results)} figures and tables, {len(lines)} checks, {len(failed)} failed, "
        f"{took_s:.0f} s, {len(text) / 1e6:.1f} MB: {chosen.output}"
    )
    return 1 if failed or problems else 0


sys.exit(main())
