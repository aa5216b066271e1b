"""What the page is made of: one entry for each figure and each table of the thesis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drives import Drives


@dataclass(frozen=True)
class Check:
    """A number that must lie between two limits."""

    what: str
    value: float
    unit: str
    low: float
    high: float

    @property
    def holds(self) -> bool:
        return math.isfinite(self.value) and self.low <= self.value <= self.high

    @property
    def limit(self) -> str:
        if self.low == self.high:
            return f"= {shown(self.low)}"
        if self.high == math.inf:
            return f"≥ {shown(self.low)}"
        if self.low == -math.inf:
            return f"≤ {shown(self.high)}"
        return f"{shown(self.low)} to {shown(self.high)}"


def shown(value: float) -> str:
    """A number with at most four significant digits, without an exponent where it has few digits."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e5:
        text = f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"
        return text.replace("-", "−")
    return f"{value:.1e}".replace("e-0", "e-").replace("-", "−")


def at_most(what: str, value: float, high: float, unit: str = "") -> Check:
    return Check(what, float(value), unit, -math.inf, high)


def at_least(what: str, value: float, low: float, unit: str = "") -> Check:
    return Check(what, float(value), unit, low, math.inf)


def within(what: str, value: float, low: float, high: float, unit: str = "") -> Check:
    return Check(what, float(value), unit, low, high)


@dataclass
class Made:
    """What an entry made: a drawing or a table, its checks, and today's estimator beside it."""

    checks: list[Check]
    today: str
    """What the estimator makes of the same drive, with numbers; or why there is no drive."""
    figure: Any = None
    table: tuple[list[str], list[list[str]]] | None = None
    seen: str = ""
    """What is drawn, and where it differs from the thesis's set-up."""


@dataclass(frozen=True)
class Entry:
    """A figure or a table of the thesis."""

    kind: str
    number: str
    title: str
    says: str
    """What the thesis states about it, in the words of this project."""
    erratum: str
    make: Callable[[Drives], Made] = field(repr=False)

    @property
    def name(self) -> str:
        return f"{self.kind} {self.number}"

    @property
    def key(self) -> tuple[int, ...]:
        """Place on the page: by number, tables before the figures of the same chapter's end."""
        chapter, place = (int(part) for part in self.number.split("."))
        return chapter, 1000 * (self.kind == "table") + place


ENTRIES: list[Entry] = []


def _entry(
    kind: str, number: str, title: str, says: str, erratum: str
) -> Callable[[Callable[[Drives], Made]], Callable[[Drives], Made]]:
    def register(make: Callable[[Drives], Made]) -> Callable[[Drives], Made]:
        ENTRIES.append(Entry(kind, number, title, says, erratum, make))
        return make

    return register


def figure(number: str, title: str, says: str, erratum: str = "") -> Any:
    """Registers the function that makes a figure."""
    return _entry("figure", number, title, says, erratum)


def table(number: str, title: str, says: str, erratum: str = "") -> Any:
    """Registers the function that makes a table."""
    return _entry("table", number, title, says, erratum)
