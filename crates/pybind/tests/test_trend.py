"""The test for changes over drives: its rate of false alarms, its power, its intervals."""

from __future__ import annotations

import numpy as np
import pytest

import atvrec
from atvrec.trend import trend

pandas = pytest.importorskip("pandas")
pytest.importorskip("pyarrow")

START_NS = 1_790_000_000_000_000_000
DAY_NS = 86_400_000_000_000


def drives(
    random: np.random.Generator,
    parameters: int,
    count: int = 40,
    *,
    change: float = 0.0,
    scatter: float = 0.0,
    tails: bool = False,
) -> object:
    """Parameters of drives of one vehicle; the first one changes by ``change`` at the 25th drive."""
    rows = []
    for number in range(parameters):
        sigma = random.uniform(0.5, 2.0, count)
        noise = random.standard_t(3, count) if tails else random.standard_normal(count)
        value = 100.0 + sigma * noise + scatter * random.standard_normal(count)
        if number == 0:
            value[25:] += change
        for index in range(count):
            rows.append(
                {
                    "vehicle": "buggy",
                    "run": f"run-{index:03}",
                    "start": pandas.Timestamp(START_NS + index * DAY_NS, tz="UTC"),
                    "step": "springs",
                    "parameter": f"p{number}",
                    "unit": "N/m",
                    "value": value[index],
                    "sigma": sigma[index],
                }
            )
    random.shuffle(rows)
    return pandas.DataFrame(rows)


@pytest.mark.parametrize(
    ("scatter", "tails"), [(0.0, False), (3.0, False), (0.0, True)], ids=["honest", "scatter", "tails"]
)
def test_false_alarms_are_as_rare_as_stated(scatter: float, tails: bool) -> None:
    """Of 200 fleets of three parameters without a change, 5 % have an alarm at the level of 5 %, whether the
    stated deviations are right or not."""
    random = np.random.default_rng(11)
    alarms = 0
    for _ in range(200):
        table = drives(random, 3, 30, scatter=scatter, tails=tails)
        alarms += bool(trend(table, false_alarms=0.05).changed)
    # 10 are expected; more than 21 have a probability of 0.1 %.
    assert alarms <= 21
    assert alarms >= 1


def test_a_change_is_found_with_its_size_and_date() -> None:
    found = trend(drives(np.random.default_rng(12), 20, change=3.0))
    (one,) = found.changed
    assert one.parameter == "p0" and found.series[0] is one
    low, high = one.interval
    assert low < 3.0 < high and high - low < 2.0
    assert abs(one.split - 25) <= 1
    assert "CHANGED buggy  springs p0" in str(found)
    assert "<td>yes</td>" in found._repr_html_()
    assert found.frame()["changed"].sum() == 1


def test_intervals_of_the_change_hold() -> None:
    random = np.random.default_rng(13)
    inside = 0
    for _ in range(100):
        (one,) = trend(drives(random, 1, change=4.0, scatter=1.0), false_alarms=0.05).series
        low, high = one.interval
        inside += low < 4.0 < high
    # The date is chosen by the data, so that the interval is a little short.
    assert inside >= 86


def test_too_few_drives_are_named() -> None:
    with pytest.raises(atvrec.DataError, match="springs p0: 7 drives; 8 are needed"):
        trend(drives(np.random.default_rng(1), 1, 7))
    with pytest.raises(atvrec.ArgumentError, match="false_alarms = 0"):
        trend(drives(np.random.default_rng(1), 1), false_alarms=0.0)
    with pytest.raises(atvrec.ArgumentError, match="has no table parameters"):
        trend("/nonexistent")


def test_the_figure_is_drawn() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    figure = trend(drives(np.random.default_rng(12), 3, change=3.0)).figure()
    assert len([axis for axis in figure.axes if axis.get_visible()]) == 3
