"""Many drives on many machines, on Dask.

:func:`run` applies steps to every run that it finds, and writes the results as a dataset of Parquet files:

.. code-block:: python

    from atvrec import fleet

    done = fleet.run(
        "s3://drives/2026/**/*.mcap",
        steps=[fleet.replay(), fleet.score(), fleet.identify("cornering"), fleet.summary()],
        out="s3://results/2026",
    )

Each run is processed on its own, by one task. Results have a key made of the contents of the log, the
version of the package and the steps with their options; a second call computes only what is new. A run that
fails becomes a row with the reason. ``docs/fleet.md`` describes the tables and has queries.

Needs the packages of ``pip install atvrec[fleet]``.
"""

from atvrec.fleet.steps import (
    Step,
    estimates,
    identify,
    replay,
    rest,
    score,
    springs,
    summary,
)
from atvrec.fleet.store import Run, find
from atvrec.fleet.tables import TABLES
from atvrec.fleet.work import Result, local_cluster, run

__all__ = [
    "TABLES",
    "Result",
    "Run",
    "Step",
    "estimates",
    "find",
    "identify",
    "local_cluster",
    "replay",
    "rest",
    "run",
    "score",
    "springs",
    "summary",
]
