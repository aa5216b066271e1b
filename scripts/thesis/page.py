"""One HTML page that needs no network."""

from __future__ import annotations

import html
import re
from typing import Any

from drawing import COLOURS, svg
from entry import Check, Entry, Made, shown

STYLE = """
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 76rem; padding: 1rem clamp(.7rem, 2vw, 1.6rem) 4rem; font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); }
h1 { font-size: 1.55rem; line-height: 1.25; margin: .4rem 0; }
h2 { font-size: 1.3rem; margin: 2.6rem 0 .4rem; }
h3 { font-size: 1.1rem; line-height: 1.3; margin: 0 0 .5rem; }
p { margin: 0 0 .6rem; overflow-wrap: break-word; }
code { font-size: .92em; overflow-wrap: anywhere; }
a { color: var(--accent); }
section { border-top: 1px solid var(--line); padding: 1.2rem 0 1rem; display: grid; grid-template-columns: minmax(0, 1fr); gap: 0 2rem; scroll-margin-top: .5rem; }
@media (min-width: 60rem) { section { grid-template-columns: minmax(0, 34rem) minmax(0, 1fr); } }
section > h3 { grid-column: 1 / -1; }
figure { margin: 0; }
figure svg { display: block; width: 100%; height: auto; max-width: 40rem; }
figcaption, .seen { color: var(--soft-text); font-size: .93rem; }
b.tag { display: block; font-size: .8rem; letter-spacing: .03em; color: var(--soft-text); margin-top: .2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .93rem; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .25rem .8rem .25rem 0; border-bottom: 1px solid var(--line); }
th { color: var(--soft-text); font-weight: 600; }
.checks { margin-top: .2rem; }
@media (min-width: 40rem) { .checks td + td { white-space: nowrap; } }
@media (max-width: 40rem) { table { font-size: .85rem; } th, td { padding-right: .5rem; } }
.checks td:last-child, .checks th:last-child { padding-right: 0; }
sub { line-height: 0; }
tr.bad td, .bad { color: var(--bad); font-weight: 600; }
ol.contents { columns: 20rem; padding-left: 1.2rem; list-style: none; margin: .6rem 0; font-size: .95rem; }
ol.contents li { break-inside: avoid; padding: .1rem 0; }
@media print { section { break-inside: avoid; } }
"""

CHAPTERS = {
    2: "Chapter 2: models and parameters",
    3: "Chapter 3: strain and deflection",
    4: "Chapter 4: drives",
}


def scheme() -> str:
    """The colours of both schemes as CSS variables."""
    light = {name: value for name, (_, value, _) in COLOURS.items()}
    dark = {name: value for name, (_, _, value) in COLOURS.items()}
    light |= {"paper": "#fff", "soft-text": "#4b5563", "accent": "#1d4ed8", "bad": "#b91c1c"}
    dark |= {"paper": "#111418", "soft-text": "#aab2bf", "accent": "#93c5fd", "bad": "#f87171"}
    text = lambda values: "".join(f"--{name}: {value};" for name, value in values.items())
    return (
        f":root {{ color-scheme: light dark; {text(light)} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {text(dark)} }} }}\n"
    )


def marked(text: str) -> str:
    """HTML with the indices of symbols such as F_y below the line."""
    return re.sub(r"\b([A-Za-z])_([A-Za-z0-9]{1,3})\b", r"\1<sub>\2</sub>", text)


def table(head: list[str], rows: list[list[str]], *, kind: str = "", bad: list[bool] | None = None) -> str:
    cells = "".join(f"<th>{one}</th>" for one in head)
    lines = []
    for index, row in enumerate(rows):
        failed = ' class="bad"' if bad and bad[index] else ""
        lines.append(f"<tr{failed}>" + "".join(f"<td>{one}</td>" for one in row) + "</tr>")
    return f'<div class="scroll"><table class="{kind}"><tr>{cells}</tr>{"".join(lines)}</table></div>'


def check_rows(checks: list[Check]) -> str:
    rows = [
        [marked(html.escape(one.what)), f"{shown(one.value)} {one.unit}", f"{one.limit} {one.unit}"]
        for one in checks
    ]
    return table(["check", "value", "limit"], rows, kind="checks", bad=[not one.holds for one in checks])


def anchor(entry: Entry) -> str:
    return f"{entry.kind}-{entry.number.replace('.', '-')}"


def section(entry: Entry, made: Made) -> str:
    body = ""
    if made.figure is not None:
        body += svg(made.figure, entry.number, html.escape(f"{entry.name}: {entry.title}", quote=True))
    if made.table is not None:
        body += table(*made.table)
    caption = f"<figcaption>{marked(made.seen)}</figcaption>" if made.seen else ""
    erratum = f"<p><b class=tag>Erratum</b>{marked(entry.erratum)}</p>" if entry.erratum else ""
    return (
        f'<section id="{anchor(entry)}"><h3>{entry.name.capitalize()}: {html.escape(entry.title)}</h3>'
        f"<figure>{body}{caption}</figure>"
        f"<div><p><b class=tag>The thesis</b>{marked(entry.says)}</p>{erratum}"
        f"<p><b class=tag>Today</b>{marked(made.today)}</p>{check_rows(made.checks)}</div></section>"
    )


def page(made: list[tuple[Entry, Made]], facts: str) -> str:
    checks = [check for _, one in made for check in one.checks]
    failed = sum(not check.holds for check in checks)
    verdict = (
        f"All {len(checks)} checks hold."
        if failed == 0
        else f'<span class="bad">{failed} of {len(checks)} checks do not hold.</span>'
    )
    contents = "".join(
        f'<li><a href="#{anchor(entry)}">{entry.name.capitalize()}</a> {html.escape(entry.title)}</li>'
        for entry, _ in made
    )
    body, chapter = "", 0
    for entry, one in made:
        if entry.key[0] != chapter:
            chapter = entry.key[0]
            body += f"<h2>{CHAPTERS[chapter]}</h2>"
        body += section(entry, one)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
        f"<title>Figures and tables of the thesis</title><style>{scheme()}{STYLE}</style></head><body>"
        "<h1>Figures and tables of the thesis, drawn through the measuring chain of atvrec</h1>"
        "<p>R. S. Hill, <i>Tire Force Estimation in Off-Road Vehicles Using Suspension Strain and Deflection "
        "Measurements</i>, Auburn University, 2012. Each figure here has the number of the thesis. A drive becomes "
        "the bytes of the sensors, a log, and estimates; the figures read the log. Axes follow ISO 8855 (left and "
        "up positive), so that a right turn has negative lateral forces; the thesis draws right positive.</p>"
        f"<p><b>{verdict}</b> {facts}</p><nav><ol class=contents>{contents}</ol></nav>{body}</body></html>\n"
    )


def as_text(made: list[tuple[Entry, Any]]) -> str:
    """The table of all checks, for the terminal."""
    lines = []
    for entry, one in made:
        for check in one.checks:
            word = "ok    " if check.holds else "FAILED"
            unit = f" {check.unit}" if check.unit else ""
            lines.append(
                f"{word} {entry.name:<12} {check.what}: {shown(check.value)}{unit} (limit {check.limit}{unit})"
            )
    return "\n".join(lines)
