"""Whether the table of docs/thesis.md lists every section, figure and table of the thesis."""

from __future__ import annotations

import re
from pathlib import Path

from entry import Entry

# All sections of the thesis that contain work.
SECTIONS = (
    "1.1 1.2 1.3 2.1.1 2.1.2 2.2.1 2.2.2 2.2.3 2.2.4 2.3 2.4.1 2.4.2 2.4.3 2.4.4 2.4.5 2.5 "
    "3.1 3.2 3.3 3.4 3.5 4.1 4.2.1 4.2.2 4.2.3 4.2.4 5.1 5.2.1 5.2.2 5.2.3 5.2.4 5.2.5 5.2.6 "
    "5.3.1 5.3.2 5.3.3 A.1 A.2 A.3 B"
).split()

# What the page must hold.
FIGURES = (
    "2.2 2.3 2.14 2.15 2.16 2.17 2.20 2.21 2.23 2.25 2.26 2.27 2.28 2.29 2.30 2.31 2.32 2.33 "
    "3.6 3.17 3.18 4.8 4.9 4.10 4.11 4.12 4.13 4.14 4.15 4.16 4.17"
).split()
TABLES = "2.1 2.2 2.3 2.4 2.5 3.1 3.2".split()


def listed(cell: str) -> set[str]:
    """Numbers in a cell such as `2.2, 2.14-2.17`."""
    numbers: set[str] = set()
    for first, last in re.findall(r"(\d+\.\d+)(?:-(\d+\.\d+))?", cell):
        chapter, low = first.split(".")
        high = int(last.split(".")[1]) if last else int(low)
        numbers |= {f"{chapter}.{place}" for place in range(int(low), high + 1)}
    return numbers


def problems(document: Path, entries: list[Entry]) -> list[str]:
    """What is missing of the document or of the page."""
    found: list[str] = []
    have = {kind: {e.number for e in entries if e.kind == kind} for kind in ("figure", "table")}
    for kind, wanted in (("figure", FIGURES), ("table", TABLES)):
        found += [f"{kind} {n} is not made; add its entry" for n in wanted if n not in have[kind]]
    if not document.exists():
        return [*found, "the file does not exist"]
    rows = [
        [cell.strip() for cell in line.strip().strip("|").split("|")]
        for line in document.read_text(encoding="utf-8").splitlines()
        if line.startswith("| ")
    ]
    sections = {row[0].split()[0] for row in rows}
    found += [f"section {n} has no row" for n in SECTIONS if n not in sections]
    named = {"figure": set(), "table": set()}
    for row in rows:
        for cell in row:
            for kind, numbers in re.findall(
                r"(figure|table)s? ((?:\d+\.\d+(?:-\d+\.\d+)?(?:, | and )?)+)", cell
            ):
                named[kind] |= listed(numbers)
    for kind, numbers in have.items():
        found += [f"{kind} {n} is in no row" for n in sorted(numbers - named[kind])]
    return found
