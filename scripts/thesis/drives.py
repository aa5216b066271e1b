"""The drives behind the figures: motion → bytes of the sensors → log → estimates → arrays.

Each drive is simulated once and kept in the working folder. The drives of chapter 4 take their motion
from runs of an independent multibody simulator (testdata/truth), so that nothing of their truth was
made with the models of this project.
"""

from __future__ import annotations

import functools
import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

import atvrec

ROOT = Path(__file__).resolve().parents[2]
TRUTH = ROOT / "testdata" / "truth"
MEMBERS = ("upper_front", "upper_rear", "lower_front", "lower_rear", "tie_rod")
WHEELS = ("fl", "fr", "rl", "rr")
LONG = {"fl": "front_left", "fr": "front_right", "rl": "rear_left", "rr": "rear_right"}
GRAVITY_M_S2 = 9.80665
SEED = 1

# Channels that the thesis could use: one gauge on a front upper arm, which did not respond, and none on
# the rear tie rods (section 4.2.1).
FITTED = {
    wheel: ("lower_front", "lower_rear", "tie_rod") if wheel[0] == "f" else MEMBERS[:4] for wheel in WHEELS
}
# The half bridges of table 3.2; section 5.2.1 names 12 of 16 that were wired for bending.
HALF_BRIDGES = {wheel: MEMBERS[2:4] if wheel[0] == "f" else MEMBERS[:4] for wheel in WHEELS}


def _fault(wheel: str, channel: str, kind: str) -> str:
    return f'[[faults.channel]]\nwheel = "{LONG[wheel]}"\nchannel = "{channel}"\nkind = {kind}\n\n'


def missing_gauges() -> str:
    """Options of the virtual vehicle: the channels that the thesis did not have are dead."""
    return "".join(
        _fault(wheel, channel, '"dead"')
        for wheel in WHEELS
        for channel in MEMBERS
        if channel not in FITTED[wheel]
    )


def bending_wired() -> str:
    """Options of the virtual vehicle: the 12 half bridges read bending."""
    return "".join(
        _fault(wheel, channel, '"bending_wired"') for wheel in WHEELS for channel in HALF_BRIDGES[wheel]
    )


# When the static baseline of the gauges is taken, s.
BASELINE_S = (0.2, 0.5)


def in_baseline(time_s: Any) -> Any:
    return (time_s > BASELINE_S[0]) & (time_s < BASELINE_S[1])


class Drive:
    """A log as arrays."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.log = atvrec.open(path)

    @functools.cache
    def topic(self, name: str) -> dict[str, Any]:
        return self.log.read(name)

    def column(self, topic: str, name: str, at_s: Any = None) -> Any:
        """A column, at its own times or at other ones."""
        columns = self.topic(topic)
        if at_s is None:
            return columns[name]
        return np.interp(at_s, columns["t_s"], np.asarray(columns[name], float))

    def time_s(self, topic: str) -> Any:
        return self.topic(topic)["t_s"]

    def force(self, wheel: str, axis: str, of: str, at_s: Any = None) -> Any:
        """Contact force of a wheel, N, of `truth`, `estimate` or `model`."""
        topic = "/model/tyre_forces" if of == "model" else f"/{of}/contact_forces"
        return self.column(topic, f"{wheel}.{axis}_n", at_s)

    def strain(self) -> tuple[Any, dict[str, Any]]:
        """Times, and the counts of the five axial channels of each wheel."""
        columns = self.topic("/strain")
        counts = {
            wheel: np.stack(
                [columns[f"{wheel}.{member}.raw_counts"].astype(float) for member in MEMBERS], axis=1
            )
            for wheel in WHEELS
        }
        return columns["t_s"], counts

    def events(self) -> list[tuple[float, str]]:
        if "/estimate/events" not in self.log.topics:
            return []
        columns = self.topic("/estimate/events")
        return list(zip(columns["t_s"].tolist(), columns["text"]))

    def event_s(self, *words: str) -> float:
        """Time of the first event whose text has all words; NaN without one."""
        return next((t for t, text in self.events() if all(w in text for w in words)), float("nan"))


class Drives:
    """All drives, made when they are first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.prowler = atvrec.Vehicle.builtin("prowler")

    def _options(self, name: str, text: str) -> Path | None:
        if not text:
            return None
        path = self.folder / f"{name}-options.toml"
        path.write_text(text, encoding="utf-8")
        return path

    def _simulated(
        self,
        name: str,
        manoeuvre: str | None,
        *,
        truth: str | None = None,
        options: str = "",
        **more: Any,
    ) -> Drive:
        path = self.folder / f"{name}.mcap"
        atvrec.simulate(
            manoeuvre,
            path,
            truth=TRUTH / f"{truth}.parquet" if truth else None,
            options=self._options(name, options),
            seed=SEED,
            force=True,
            **more,
        )
        return Drive(path)

    def _replayed(self, name: str, drive: Drive, **more: Any) -> Drive:
        path = self.folder / f"{name}.mcap"
        atvrec.replay(drive.path, path, force=True, **more)
        return Drive(path)

    @functools.cached_property
    def thesis_sensors(self) -> atvrec.Sensors:
        """The thesis's chain with the gain resistors of its front lower bridges (table 3.2) everywhere:
        with 100 ohm a bridge that reads bending is beyond its converter's range."""
        text = atvrec.Sensors.builtin().to_toml()
        return atvrec.Sensors.from_toml(
            text.replace("gain_resistor_ohm = 100.0", "gain_resistor_ohm = 350.0")
        )

    @functools.cached_property
    def circle(self) -> Drive:
        """Right turn of 15.24 m at rising speed, all gauges right."""
        return self._simulated("circle", None, truth="b_circle")

    @functools.cached_property
    def circle_statics(self) -> Drive:
        """The same bytes by the method of the thesis: statics of each corner."""
        return self._replayed("circle-statics", self.circle, method="thesis")

    @functools.cached_property
    def circle_springs(self) -> Drive:
        """The vertical forces from the deflections alone."""
        return self._replayed("circle-springs", self.circle, method="thesis", without=["strain"])

    @functools.cached_property
    def circle_miswired(self) -> Drive:
        """The same turn with the gauges as the thesis had them."""
        return self._simulated(
            "circle-miswired",
            None,
            truth="b_circle",
            options=missing_gauges() + bending_wired(),
            sensors=self.thesis_sensors,
        )

    @functools.cached_property
    def sine(self) -> Drive:
        """Sine steer of 0.3 Hz at 8 m/s, all gauges right."""
        return self._simulated("sine", None, truth="c_sine03")

    @functools.cached_property
    def sine_statics(self) -> Drive:
        return self._replayed("sine-statics", self.sine, method="thesis")

    @functools.cached_property
    def sine_springs(self) -> Drive:
        return self._replayed("sine-springs", self.sine, method="thesis", without=["strain"])

    @functools.cached_property
    def sine_miswired(self) -> Drive:
        return self._simulated(
            "sine-miswired",
            None,
            truth="c_sine03",
            options=missing_gauges() + bending_wired(),
            sensors=self.thesis_sensors,
        )

    @functools.cached_property
    def gravel(self) -> Drive:
        """Sine steer whose ground changes from a friction of 0.9 to 0.4 after 12 s."""
        return self._simulated("gravel", None, truth="d_sine_mu")

    @functools.cached_property
    def gravel_statics(self) -> Drive:
        return self._replayed("gravel-statics", self.gravel, method="thesis")

    @functools.cached_property
    def slow_sine(self) -> Drive:
        """Sine steer of 0.3 Hz, virtual vehicle of this project on road tyres."""
        return self._simulated("slow-sine", "slow-sine")

    @functools.cached_property
    def slow_sine_offset(self) -> Drive:
        """The same with an error of the steering wheel's zero that no file states."""
        return self._simulated("slow-sine-offset", "slow-sine", options="[hidden]\nsteer_offset_rad = 0.3\n")

    @functools.cached_property
    def fast_sine(self) -> Drive:
        return self._simulated("fast-sine", "fast-sine")

    @functools.cached_property
    def fast_sine_statics(self) -> Drive:
        return self._replayed("fast-sine-statics", self.fast_sine, method="thesis")

    @functools.cached_property
    def slow_sine_off_road(self) -> Drive:
        return self._simulated("slow-sine-off-road", "slow-sine", vehicle="prowler-off-road")

    @functools.cached_property
    def launch_brake(self) -> Drive:
        """From rest to 15 m/s, then braking."""
        return self._simulated("launch-brake", "launch-brake")

    @functools.cached_property
    def rough(self) -> Drive:
        """20 s on a road of ISO 8608 class C."""
        return self._simulated("rough-road", "rough-road", duration_s=20.0)

    @functools.cached_property
    def weighed(self) -> Drive:
        return self._simulated("weighed", "weighed")

    @functools.cached_property
    def jackstand(self) -> Drive:
        """On jackstands with zeros of up to 40 counts that no file states, and a drifting channel in
        front right."""
        drift = _fault("fr", "lower_rear", "{ drifting = { counts_per_s = 2.0 } }")
        hidden = "[hidden]\nbridge_offset_counts = 40.0\npotentiometer_offset_counts = 20.0\n\n"
        return self._simulated(
            "jackstand",
            "jackstand",
            options=hidden + drift,
            true_calibration=self.folder / "jackstand-true.toml",
        )

    @functools.cached_property
    def jackstand_miswired(self) -> Drive:
        return self._simulated(
            "jackstand-miswired",
            "jackstand",
            options=missing_gauges() + bending_wired(),
            sensors=self.thesis_sensors,
        )

    @functools.cached_property
    def jackstand_zeros(self) -> tuple[Path, dict[str, Any]]:
        """Calibration file of the jackstand drive, and what `calibrate zero` says."""
        output = self.folder / "jackstand-zeros.toml"
        return output, self.calibrate_zero(self.jackstand, output)

    @functools.cached_property
    def jackstand_calibrated(self) -> Drive:
        return self._replayed("jackstand-calibrated", self.jackstand, calibration=self.jackstand_zeros[0])

    @functools.cached_property
    def miswired_zeros(self) -> tuple[Path, dict[str, Any]]:
        """The same with the gauges as the thesis had them."""
        output = self.folder / "miswired-zeros.toml"
        return output, self.calibrate_zero(self.jackstand_miswired, output)

    @functools.cached_property
    def circle_calibrated(self) -> Drive:
        """The turn with the thesis's gauges after `calibrate zero` called its bad channels dead."""
        return self._replayed("circle-calibrated", self.circle_miswired, calibration=self.miswired_zeros[0])

    @functools.cached_property
    def sine_calibrated(self) -> Drive:
        return self._replayed("sine-calibrated", self.sine_miswired, calibration=self.miswired_zeros[0])

    def member_forces(
        self, drive: Drive, channel: atvrec.StrainChannel, fitted: dict[str, Any] = FITTED
    ) -> tuple[Any, dict[str, Any]]:
        """Times and link forces, N, of each wheel: counts less those of `BASELINE_S`, as the thesis
        takes off its static baseline, times newtons for a count. A channel that is not fitted is 0."""
        time_s, counts = drive.strain()
        # The low-pass filters of the chain settle first.
        settled = time_s > BASELINE_S[0]
        time_s = time_s[settled]
        first = in_baseline(time_s)
        forces = {}
        for wheel, every in counts.items():
            rows = every[settled]
            change = (rows - rows[first].mean(axis=0)) * channel.load_per_count
            has = np.array([member in fitted[wheel] for member in MEMBERS])
            forces[wheel] = np.column_stack([np.where(has, change, 0.0), np.zeros(len(change))])
        return time_s, forces

    def lateral_n(self, forces: dict[str, Any]) -> dict[str, Any]:
        """Lateral force that the link forces of each wheel hold, N: the statics of the corner."""
        found = {}
        for wheel, members in forces.items():
            corner = atvrec.Corner(self.prowler, wheel)
            rest = corner.wrench(np.zeros(6))[1]
            found[wheel] = corner.wrench(members)[:, 1] - rest
        return found

    def spring_alone_n(self, drive: Drive, wheel: str, at_s: Any) -> Any:
        """Static load and rate of the spring times the lever of the hard-points, N: equations 2.25 to
        2.27 with the lever the right way up."""
        axle = self.prowler.to_dict()["front" if wheel[0] == "f" else "rear"]
        span_m = tomllib.loads(atvrec.Sensors.builtin().to_toml())["deflection"]["span_m"]
        counts = drive.column("/deflection", f"{wheel}.raw_counts", at_s)
        rate_n_m = axle["strut"]["stiffness_n_m"] * axle["strut"]["motion_ratio"]
        return axle["tyre"]["reference_load_n"] + rate_n_m * span_m / 1024.0 * (counts - 512.0)

    def calibrate_zero(self, drive: Drive, output: Path) -> dict[str, Any]:
        """`atvrec calibrate zero` on a log: its findings."""
        output.unlink(missing_ok=True)
        found = command("calibrate", "zero", drive.path, "-o", output, "--json")
        return dict(found["results"][0])


def command(*arguments: Any) -> dict[str, Any]:
    """Runs a command of the program and reads the JSON that it prints."""
    run = subprocess.run(
        [sys.executable, "-m", "atvrec", *map(str, arguments)],
        check=False,
        capture_output=True,
        text=True,
    )
    if run.returncode != 0:
        raise RuntimeError(f"atvrec {' '.join(map(str, arguments))}: {run.stderr.strip()}")
    return dict(json.loads(run.stdout))


def rms(values: Any) -> float:
    values = np.asarray(values, float)
    return float(np.sqrt(np.nanmean(values**2)))


def error_percent(found: Any, true: Any, static: float = 0.0) -> float:
    """100 RMS of the difference over the peak of the truth (at least the static value)."""
    return 100.0 * rms(np.asarray(found) - np.asarray(true)) / max(np.nanmax(np.abs(true)), static)
