"""Figures as SVG whose colours follow the colour scheme of the page."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullFormatter

WHEELS = ("fl", "fr", "rl", "rr")
WHEEL_NAMES = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}

# Name of the colour, its placeholder in the drawing, and its value in the light and the dark scheme.
COLOURS = {
    "ink": ("#010001", "#1f2937", "#e5e7eb"),
    "soft": ("#010002", "#6b7280", "#9ca3af"),
    "line": ("#010003", "#dfe3e8", "#333b47"),
    "fl": ("#010004", "#1d4ed8", "#7aa7ff"),
    "fr": ("#010005", "#c2410c", "#fb923c"),
    "rl": ("#010006", "#0f766e", "#2dd4bf"),
    "rr": ("#010007", "#9333ea", "#d0a5ff"),
    "measured": ("#010008", "#1d4ed8", "#7aa7ff"),
    "expected": ("#010009", "#c2410c", "#fb923c"),
    "truth": ("#01000a", "#111827", "#f3f4f6"),
    "estimate": ("#01000b", "#0f766e", "#2dd4bf"),
    "other": ("#01000c", "#9333ea", "#d0a5ff"),
    "step1": ("#01000d", "#0369a1", "#38bdf8"),
    "step2": ("#01000e", "#4d7c0f", "#a3e635"),
    "step3": ("#01000f", "#b45309", "#fbbf24"),
    "step4": ("#010010", "#be185d", "#f472b6"),
}
C = {name: sentinel for name, (sentinel, _, _) in COLOURS.items()}
# For members and for steps of a parameter, so that the colours of wheels are those of wheels alone.
STEPS = [C["step1"], C["step2"], C["step3"], C["step4"]]

# Width of a figure, inches; 9 pt on it are 9.6 px on a phone of 400 px.
WIDTH_IN = 4.8
POINTS_MAX = 440

plt.rcParams.update(
    {
        "svg.fonttype": "none",
        "figure.max_open_warning": 0,
        "font.family": "DejaVu Sans",
        "font.size": 9.0,
        "axes.titlesize": 9.0,
        "axes.titleweight": "bold",
        "axes.labelsize": 9.0,
        "xtick.labelsize": 8.5,
        "ytick.labelsize": 8.5,
        "legend.fontsize": 8.5,
        "legend.frameon": False,
        "legend.handlelength": 1.6,
        "legend.columnspacing": 1.0,
        "lines.linewidth": 1.3,
        "figure.facecolor": "none",
        "axes.facecolor": "none",
        "savefig.facecolor": "none",
        "axes.edgecolor": C["soft"],
        "axes.labelcolor": C["ink"],
        "axes.titlecolor": C["ink"],
        "text.color": C["ink"],
        "xtick.color": C["soft"],
        "ytick.color": C["soft"],
        "xtick.labelcolor": C["ink"],
        "ytick.labelcolor": C["ink"],
        "axes.grid": True,
        "grid.color": C["line"],
        "grid.linewidth": 0.7,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "figure.constrained_layout.use": True,
    }
)


def panels(rows: int = 1, columns: int = 1, height_in: float = 2.7, **more: Any) -> tuple[Any, Any]:
    """A figure with panels; one panel is returned by itself, more as a flat list."""
    drawn, axes = plt.subplots(rows, columns, figsize=(WIDTH_IN, height_in), **more)
    return drawn, (list(axes.flat) if rows * columns > 1 else axes)


def wheels(height_in: float = 4.2, ylabel: str = "", **more: Any) -> tuple[Any, dict[str, Any]]:
    """A panel for each wheel, as the wheels stand: left wheels left, front wheels above."""
    drawn, axes = panels(2, 2, height_in, sharex=True, **more)
    by_wheel = dict(zip(WHEELS, axes))
    for wheel, one in by_wheel.items():
        one.set_title(WHEEL_NAMES[wheel])
        if wheel in ("fl", "rl"):
            one.set_ylabel(ylabel)
        if wheel in ("rl", "rr"):
            one.set_xlabel("time (s)")
    return drawn, by_wheel


def thinned(x: Any, y: Any) -> tuple[Any, Any]:
    """The least and the greatest value of each of some hundred stretches, so that no peak is lost."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if x.size <= POINTS_MAX:
        return x, y
    edges = np.linspace(0, x.size, POINTS_MAX // 2 + 1).astype(int)
    kept: list[int] = []
    for first, last in zip(edges[:-1], edges[1:]):
        part = y[first:last]
        if np.isfinite(part).any():
            kept += sorted({first + int(np.nanargmin(part)), first + int(np.nanargmax(part))})
    return x[kept], y[kept]


def plot(axes: Any, x: Any, y: Any, colour: str, label: str | None = None, **more: Any) -> None:
    """A curve over time, thinned."""
    axes.plot(*thinned(x, y), color=C.get(colour, colour), label=label, **more)


def plain_decades(axis: Any) -> None:
    """Numbers without exponents at the decades of a logarithmic axis, and none between them."""
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def shared_legend(drawn: Any, axes: Any, columns: int = 3) -> None:
    """One legend for all panels, above them."""
    handles, labels = axes.get_legend_handles_labels()
    drawn.legend(handles, labels, loc="outside upper left", ncols=columns)


def svg(drawn: Any, number: str, label: str) -> str:
    """The figure as SVG text with identifiers of its own and colours of the page."""
    buffer = io.StringIO()
    plt.rcParams["svg.hashsalt"] = number
    drawn.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(drawn)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    prefix = "g" + number.replace(".", "-") + "-"
    text = re.sub(
        r'\sid="(figure|axes|patch|line2d|text|matplotlib|xtick|ytick|legend|PathCollection|LineCollection|QuadMesh|FillBetweenPolyCollection)[^"]*"',
        "",
        text,
    )
    text = text.replace(' id="', f' id="{prefix}').replace("url(#", f"url(#{prefix}")
    text = text.replace('xlink:href="#', f'xlink:href="#{prefix}')
    text = re.sub(r"'DejaVu Sans'(, [^;\"]*)?", "'DejaVu Sans', Verdana, sans-serif", text)
    for name, (sentinel, _, _) in COLOURS.items():
        text = text.replace(sentinel, f"var(--{name})")
    text = re.sub(
        r'(<svg [^>]*?) width="[^"]*"',
        r"\1",
        re.sub(r'(<svg [^>]*?) height="[^"]*"', r"\1", text, count=1),
        count=1,
    )
    text = re.sub(r"(\d+\.\d\d)\d+", r"\1", text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)
