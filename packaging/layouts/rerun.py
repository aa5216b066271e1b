#!/usr/bin/env python3
"""Opens a log of atvrec in Rerun: forces, load transfer and path, with a blueprint.

    pip install atvrec rerun-sdk
    python rerun.py drive.mcap
"""

import sys

# Topic, column of the Python package, entity of Rerun.
SIGNALS = [
    ("/estimate/tyre_forces", "fl.z_n", "load/FL"),
    ("/estimate/tyre_forces", "fr.z_n", "load/FR"),
    ("/estimate/tyre_forces", "rl.z_n", "load/RL"),
    ("/estimate/tyre_forces", "rr.z_n", "load/RR"),
    ("/estimate/tyre_forces", "fl.y_n", "side/FL"),
    ("/estimate/tyre_forces", "fr.y_n", "side/FR"),
    ("/estimate/tyre_forces", "rl.y_n", "side/RL"),
    ("/estimate/tyre_forces", "rr.y_n", "side/RR"),
    ("/estimate/rollover", "load_transfer_ratio", "rollover/load_transfer_ratio"),
    ("/estimate/motion", "velocity_x_m_s", "motion/speed"),
    ("/estimate/motion", "roll_rad", "motion/roll"),
]


def blueprint(rrb):
    """Views of the signals, one for each group."""
    view = lambda origin, name: rrb.TimeSeriesView(origin=origin, name=name)
    return rrb.Blueprint(
        rrb.Vertical(
            view("load", "F_z, N"),
            view("side", "F_y, N"),
            rrb.Horizontal(view("rollover", "load-transfer ratio"), view("motion", "speed, roll")),
        )
    )


def main() -> None:
    import atvrec
    import rerun as rr
    import rerun.blueprint as rrb

    log = atvrec.open(sys.argv[1])
    rr.init("atvrec", spawn=True, default_blueprint=blueprint(rrb))
    for topic, column, entity in SIGNALS:
        table = log.read(topic)
        times = rr.TimeColumn("log", timestamp=table["log_time_ns"].astype("datetime64[ns]"))
        rr.send_columns(entity, indexes=[times], columns=rr.Scalars.columns(scalars=table[column]))


if __name__ == "__main__":
    main()
