//! Laps: the stretches between passes of gates.

use serde_json::{Value, json};

use crate::drive::Drive;
use crate::frame::Frame;
use crate::options::{Gate, Gates, Options, Quantity};
use crate::reference::{distance_m, interpolate};

/// Half the width of a gate, m.
const HALF_WIDTH_M: f64 = 25.0;
/// Shortest time between two passes, s: a vehicle that stands on a gate does not pass it.
const BETWEEN_MIN_S: f64 = 3.0;
/// The gate of `--laps` is this far from the first position, m.
const START_M: f64 = 5.0;

/// A gate on the local map.
struct Place {
    east_m: f64,
    north_m: f64,
    /// Direction of travel, east and north; `None`: that of the first pass.
    along: Option<[f64; 2]>,
}

/// One stretch between two passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Lap {
    /// Gates at the begin and at the end, from 1.
    pub gates: [usize; 2],
    /// Begin and end, s from the start.
    pub span_s: [f64; 2],
    /// Distance along the path, m.
    pub distance_m: f64,
    /// Greatest lateral acceleration, m/s².
    pub lateral_m_s2: Option<f64>,
    /// Greatest load-transfer ratio.
    pub ratio: Option<f64>,
}

impl Lap {
    /// Duration, s.
    pub fn time_s(&self) -> f64 {
        self.span_s[1] - self.span_s[0]
    }
}

/// Laps of a drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Laps {
    /// Passes: gate, from 1, and s from the start.
    pub passes: Vec<(usize, f64)>,
    /// The stretches between them.
    pub laps: Vec<Lap>,
    /// Why there is none, or which gate the path does not pass.
    pub problem: Option<String>,
}

impl Laps {
    /// Laps by the gates of the options; `None` if they name no gate.
    pub fn of(drive: &Drive, options: &Options) -> Option<Self> {
        if options.gates == Gates::None {
            return None;
        }
        let Some((positions, origin)) = drive.positions() else {
            return Some(Self::problem("No satellite receiver gave a position"));
        };
        let Some(path) = Path::of(positions) else {
            return Some(Self::problem("The vehicle did not move by 10 m"));
        };
        let places: Vec<Place> = match &options.gates {
            Gates::None => Vec::new(),
            Gates::Start => vec![path.start()],
            Gates::At(gates) => gates.iter().map(|gate| Place::of(gate, origin)).collect(),
        };
        let mut passes = Vec::new();
        let mut problem = None;
        for (index, place) in places.iter().enumerate() {
            let (found, nearest_m) = path.passes(place);
            if found.is_empty() {
                let number = index + 1;
                problem.get_or_insert(format!(
                    "The path does not pass gate {number}: it comes as near as {nearest_m:.0} m, and a \
                     gate is {:.0} m wide",
                    2.0 * HALF_WIDTH_M
                ));
            }
            passes.extend(found.into_iter().map(|at_s| (index + 1, at_s)));
        }
        passes.sort_by(|a, b| a.1.total_cmp(&b.1));
        if problem.is_none() && passes.len() < 2 {
            problem = Some("The path passes the gates only once".to_owned());
        }
        let laps = laps(drive, &passes);
        Some(Self {
            passes,
            laps,
            problem,
        })
    }

    fn problem(text: &str) -> Self {
        Self {
            problem: Some(text.to_owned()),
            ..Self::default()
        }
    }

    /// As JSON, by the keys of `docs/report.md`.
    pub fn to_json(&self, options: &Options) -> Value {
        let (length, unit) = options.units.of(Quantity::Length);
        let laps = self.laps.iter().enumerate().map(|(index, lap)| {
            json!({
                "number": index + 1,
                "gates": lap.gates,
                "from_s": lap.span_s[0],
                "to_s": lap.span_s[1],
                "time_s": lap.time_s(),
                "distance": lap.distance_m * length,
                "distance_unit": unit,
                "lateral_acceleration_max_m_s2": lap.lateral_m_s2,
                "load_transfer_ratio_max": lap.ratio,
            })
        });
        json!({
            "laps": laps.collect::<Vec<_>>(),
            "problem": self.problem,
        })
    }
}

impl Place {
    fn of(gate: &Gate, origin: [f64; 2]) -> Self {
        let [east_m, north_m] = crate::drive::local_m(
            [
                gate.longitude_deg.to_radians(),
                gate.latitude_deg.to_radians(),
            ],
            origin,
        );
        let heading = gate.heading_deg.map(f64::to_radians);
        Self {
            east_m,
            north_m,
            along: heading.map(|heading| [math::sin(heading), math::cos(heading)]),
        }
    }
}

/// Solved positions of a receiver: s from the start, m east, m north.
struct Path(Vec<[f64; 3]>);

impl Path {
    fn of(positions: &Frame) -> Option<Self> {
        let [east, north] = ["east_m", "north_m"].map(|name| positions.get(name));
        let places = positions.time_s.iter().zip(east?).zip(north?);
        let all = places.map(|((time, east), north)| [*time, f64::from(*east), f64::from(*north)]);
        let path = Self(
            all.filter(|row| row[1].is_finite() && row[2].is_finite())
                .collect(),
        );
        path.reached(2.0 * START_M).map(|_| path)
    }

    /// First position that is this far from the first one.
    fn reached(&self, radius_m: f64) -> Option<[f64; 3]> {
        let first = self.0.first()?;
        let far = |row: &&[f64; 3]| math::hypot(row[1] - first[1], row[2] - first[2]) >= radius_m;
        self.0.iter().find(far).copied()
    }

    /// The gate where the drive began.
    fn start(&self) -> Place {
        let [from, to] = [START_M, 2.0 * START_M].map(|radius_m| self.reached(radius_m));
        let (from, to) = (from.unwrap_or_default(), to.unwrap_or_default());
        Place {
            east_m: from[1],
            north_m: from[2],
            along: direction([to[1] - from[1], to[2] - from[2]]),
        }
    }

    /// Times at which the path passes a gate, and how near it comes, m.
    fn passes(&self, gate: &Place) -> (Vec<f64>, f64) {
        let mut along = gate.along;
        let mut passes: Vec<f64> = Vec::new();
        let mut nearest_m = f64::INFINITY;
        for pair in self.0.windows(2) {
            let [before, after] =
                [pair[0], pair[1]].map(|row| [row[1] - gate.east_m, row[2] - gate.north_m]);
            let away_m = math::hypot(after[0], after[1]);
            nearest_m = nearest_m.min(away_m);
            if away_m > 4.0 * HALF_WIDTH_M {
                continue;
            }
            // Without a heading, the first step that comes within the gate's width has it.
            if along.is_none() && away_m <= HALF_WIDTH_M {
                along = direction([after[0] - before[0], after[1] - before[1]]);
            }
            let Some(along) = along else { continue };
            let [from_m, to_m] =
                [before, after].map(|place| place[0] * along[0] + place[1] * along[1]);
            if !(from_m < 0.0 && to_m >= 0.0) {
                continue;
            }
            let part = from_m / (from_m - to_m);
            let across = [0, 1].map(|axis| before[axis] + part * (after[axis] - before[axis]));
            let at_s = pair[0][0] + part * (pair[1][0] - pair[0][0]);
            let is_new = passes.last().is_none_or(|last| at_s - last > BETWEEN_MIN_S);
            if math::hypot(across[0], across[1]) <= HALF_WIDTH_M && is_new {
                passes.push(at_s);
            }
        }
        (passes, nearest_m)
    }
}

fn direction([east, north]: [f64; 2]) -> Option<[f64; 2]> {
    let length = math::hypot(east, north);
    (length > 0.0).then(|| [east / length, north / length])
}

fn laps(drive: &Drive, passes: &[(usize, f64)]) -> Vec<Lap> {
    let travelled_m = distance_m(&drive.motion);
    let at_m = |at_s: f64| interpolate(&drive.motion.time_s, &travelled_m, at_s);
    let pairs = passes.windows(2);
    pairs
        .map(|pair| {
            let span_s = [pair[0].1, pair[1].1];
            Lap {
                gates: [pair[0].0, pair[1].0],
                span_s,
                distance_m: at_m(span_s[1]) - at_m(span_s[0]),
                lateral_m_s2: greatest(&drive.motion, "acceleration_m_s2.y", span_s),
                ratio: greatest(&drive.rollover, "load_transfer_ratio", span_s),
            }
        })
        .collect()
}

/// Greatest absolute value of a column within a stretch of time.
fn greatest(frame: &Frame, column: &str, [from_s, to_s]: [f64; 2]) -> Option<f64> {
    let values = frame.get(column)?;
    let from = frame.time_s.partition_point(|time| *time < from_s);
    let to = frame.time_s.partition_point(|time| *time <= to_s);
    let finite = values
        .get(from..to)?
        .iter()
        .filter(|value| value.is_finite());
    finite.map(|value| f64::from(value.abs())).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of 100 m radius in 60 s, three times, with the start in the east and the first metres to
    /// the north.
    fn circle() -> Drive {
        let time_s: Vec<f64> = (0..=1_800).map(|n| f64::from(n) * 0.1).collect();
        let angle = |time: &f64| time / 60.0 * std::f64::consts::TAU;
        let mut positions = Frame::at(time_s.clone());
        let east = time_s
            .iter()
            .map(|t| (100.0 * math::cos(angle(t)) - 100.0) as f32);
        positions.set("east_m", east.collect());
        let north = time_s.iter().map(|t| (100.0 * math::sin(angle(t))) as f32);
        positions.set("north_m", north.collect());
        let mut motion = Frame::at(time_s.clone());
        let speed = (std::f64::consts::TAU * 100.0 / 60.0) as f32;
        motion.set("velocity_x_m_s", vec![speed; time_s.len()]);
        let lateral = time_s
            .iter()
            .map(|t| if *t > 70.0 && *t < 71.0 { -5.0 } else { 1.0 });
        motion.set("acceleration_m_s2.y", lateral.collect());
        let mut drive = Drive::default();
        drive.motion = motion;
        drive.span_s = [0.0, 180.0];
        drive.sensors.insert("/gnss/one".to_owned(), positions);
        drive.place("/gnss/one", [0.1, 0.8]);
        drive
    }

    fn laps_of(gates: Gates) -> Laps {
        let options = Options {
            gates,
            ..Options::default()
        };
        Laps::of(&circle(), &options).expect("gates were given")
    }

    #[test]
    fn a_gate_at_the_start_gives_whole_laps() {
        let found = laps_of(Gates::Start);
        assert_eq!(found.passes.len(), 3);
        assert_eq!(found.laps.len(), 2);
        for lap in &found.laps {
            assert!((lap.time_s() - 60.0).abs() < 0.01, "{lap:?}");
            assert!(
                (lap.distance_m - std::f64::consts::TAU * 100.0).abs() < 0.5,
                "{lap:?}"
            );
        }
        let lateral: Vec<Option<f64>> = found.laps.iter().map(|lap| lap.lateral_m_s2).collect();
        assert_eq!(
            lateral,
            [Some(1.0), Some(5.0)],
            "the second begins at 60.5 s"
        );
    }

    #[test]
    fn gates_have_a_direction_and_a_width() {
        let [longitude_deg, latitude_deg] = [0.1_f64, 0.8].map(f64::to_degrees);
        let gate = |metres_north: f64, heading_deg| Gate {
            latitude_deg: latitude_deg + (metres_north / 6_371_008.8).to_degrees(),
            longitude_deg,
            heading_deg,
        };
        let north = laps_of(Gates::At(vec![gate(10.0, Some(0.0))]));
        assert_eq!(north.passes.len(), 3, "{north:?}");
        let free = laps_of(Gates::At(vec![gate(10.0, None)]));
        assert_eq!(free.passes.len(), 3, "{free:?}");
        let south = laps_of(Gates::At(vec![gate(10.0, Some(180.0))]));
        assert!(
            south.passes.is_empty() && south.problem.is_some(),
            "{south:?}"
        );
        let far = laps_of(Gates::At(vec![gate(500.0, None)]));
        let problem = far.problem.expect("a reason");
        assert!(
            problem.contains("gate 1") && problem.contains("as near as 4"),
            "{problem}"
        );
    }

    #[test]
    fn two_gates_divide_a_lap() {
        let [longitude_deg, latitude_deg] = [0.1_f64, 0.8].map(f64::to_degrees);
        let west_deg = (200.0 / 6_371_008.8 / math::cos(0.8)).to_degrees();
        let gate = |longitude_deg: f64| Gate {
            latitude_deg,
            longitude_deg,
            heading_deg: None,
        };
        let gates = vec![gate(longitude_deg), gate(longitude_deg - west_deg)];
        let found = laps_of(Gates::At(gates));
        let order: Vec<[usize; 2]> = found.laps.iter().map(|lap| lap.gates).collect();
        assert!(order.len() >= 4, "{found:?}");
        assert!(order.windows(2).all(|two| two[0] != two[1]), "{order:?}");
        assert!(
            found
                .laps
                .iter()
                .all(|lap| (lap.time_s() - 30.0).abs() < 0.1),
            "{found:?}"
        );
    }
}
