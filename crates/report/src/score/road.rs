//! The road against the heights of the ground in the truth.

use std::collections::{BTreeMap, VecDeque};

use estimator::Tuning;
use estimator::road::RoadStatistics;
use model::vehicle::Vehicle;
use sample::{Estimate, LogTime, Road, RoadRoughness, RoadUnknown, Wheel};
use serde_json::{Value, json};
use store::Stage;

use super::INTERVAL_S;
use super::pass::WAITING_MAX;
use super::two_way::TwoWay;

/// Corner of the high-pass that estimate and truth pass forward and backward, Hz.
const HIGH_PASS_HZ: f64 = 0.5;

/// Errors of the road of one output.
#[derive(Clone, Debug, PartialEq)]
pub struct RoadScore {
    /// `estimate` or `lagged`.
    pub output: &'static str,
    /// Heights above 0.5 Hz, of the worst wheel, m.
    pub height: Errors,
    /// Bank and grade of the plane through the ground points, rad, and its warp, m.
    pub plane: [Errors; 3],
}

/// Root mean squares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Instants.
    pub count: usize,
    /// Of the error.
    pub rms: f64,
    /// Of the truth.
    pub truth_rms: f64,
    /// Mean of (error/sigma)^2.
    pub nees: f64,
}

/// Roughness and index against those of the true heights under the same wheels.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughnessScore {
    /// The last estimate and the truth at its instant.
    pub last: Option<[RoadRoughness; 2]>,
    /// Part of the instants whose class is that of the truth.
    pub class_agrees: f64,
    /// Part of the instants whose bounds contain the Gd(n0) of the truth.
    pub inside: f64,
    /// Mean index of both tracks, of the estimate and of the truth, m/km.
    pub iri_m_km: Option<[f64; 2]>,
    /// Class that the simulation states.
    pub stated_class: Option<String>,
}

/// All about the road.
#[derive(Clone, Debug, PartialEq)]
pub struct Roads {
    /// Each output.
    pub outputs: Vec<RoadScore>,
    /// Of the output with the lag, which has the same statistics.
    pub roughness: RoughnessScore,
    /// Instants without values, by reason.
    pub unknown: BTreeMap<&'static str, usize>,
}

/// Heights and speed of the truth.
struct Truth {
    height_m: [f64; 4],
    /// The road of the true heights.
    road: Road,
}

/// The road so far.
pub(super) struct Ground<'a> {
    vehicle: &'a Vehicle,
    from: LogTime,
    /// Speeds and heights of the truth that wait for each other.
    speeds: BTreeMap<LogTime, f64>,
    heights: BTreeMap<LogTime, [f64; 4]>,
    statistics: RoadStatistics,
    is_known: bool,
    /// The last instants of the truth.
    truth: BTreeMap<LogTime, Truth>,
    stated_class: Option<String>,
    outputs: [Output; 2],
    unknown: BTreeMap<&'static str, usize>,
}

impl<'a> Ground<'a> {
    pub fn new(vehicle: &'a Vehicle) -> Self {
        Self {
            vehicle,
            from: LogTime(u64::MAX),
            speeds: BTreeMap::new(),
            heights: BTreeMap::new(),
            statistics: RoadStatistics::new(&Tuning::default().road),
            is_known: false,
            truth: BTreeMap::new(),
            stated_class: None,
            outputs: [Stage::Estimate, Stage::Lagged].map(Output::new),
            unknown: BTreeMap::new(),
        }
    }

    /// Takes an instant of the truth; roads are compared from `from` on.
    pub fn push_truth(&mut self, truth: &Estimate, from: LogTime) {
        self.from = from;
        keep(
            &mut self.speeds,
            truth.time,
            truth.motion.velocity_x_m_s.abs(),
        );
        self.join(truth.time);
        self.compare(false);
    }

    /// Takes the ground of an instant of the truth.
    pub fn push_ground(&mut self, time: LogTime, ground: store::Ground) {
        let height = |wheel| ground.wheels[wheel].ground_height_m;
        let heights = Wheel::ALL.map(|wheel| height(wheel).unwrap_or(f64::NAN));
        self.stated_class = ground.road_class;
        if heights.iter().all(|h| h.is_finite()) {
            keep(&mut self.heights, time, heights);
            self.join(time);
        }
    }

    /// Takes a road of the estimator.
    pub fn push_road(&mut self, stage: Stage, road: Road) {
        if let Some(output) = self.outputs.iter_mut().find(|output| output.stage == stage) {
            output.waiting.push_back(road);
        }
    }

    /// Joins speed and heights of an instant.
    fn join(&mut self, time: LogTime) {
        let (Some(speed_m_s), Some(height_m)) = (self.speeds.get(&time), self.heights.get(&time))
        else {
            return;
        };
        let (speed_m_s, height_m) = (*speed_m_s, *height_m);
        let known = speed_m_s >= Tuning::default().road.speed_min_m_s;
        self.statistics
            .step(INTERVAL_S, speed_m_s, known.then_some(&height_m));
        let blank = Road {
            unknown: None,
            ..Road::unknown(time, RoadUnknown::Settling)
        };
        let road = self.statistics.complete(blank, speed_m_s);
        keep(&mut self.truth, time, Truth { height_m, road });
        self.is_known = true;
    }

    /// Compares the roads up to the last instant of the truth, or all.
    fn compare(&mut self, all: bool) {
        let last = self.truth.keys().next_back().copied().unwrap_or_default();
        for output in &mut self.outputs {
            let is_due = |road: &Road| road.time <= last || all;
            while output.waiting.len() > WAITING_MAX || output.waiting.front().is_some_and(is_due) {
                if let Some(road) = output.waiting.pop_front() {
                    output.take(
                        &road,
                        self.from,
                        &self.truth,
                        self.vehicle,
                        &mut self.unknown,
                    );
                }
            }
        }
    }

    /// The scores; `None` where the truth has no heights or the log no road.
    pub fn finish(mut self, from: LogTime) -> Option<Roads> {
        self.from = from;
        self.compare(true);
        let known = self.outputs.into_iter().filter(|output| output.count > 0);
        let mut known: Vec<Output> = known.collect();
        if !self.is_known {
            return None;
        }
        let roughness = known.last_mut()?.roughness.finish(self.stated_class);
        Some(Roads {
            outputs: known.into_iter().map(Output::finish).collect(),
            roughness,
            unknown: self.unknown,
        })
    }
}

/// Keeps a value beside the last ones.
fn keep<T>(all: &mut BTreeMap<LogTime, T>, time: LogTime, value: T) {
    all.insert(time, value);
    if all.len() > WAITING_MAX {
        all.pop_first();
    }
}

/// The road of one output so far.
struct Output {
    stage: Stage,
    /// Roads whose truth was not read yet.
    waiting: VecDeque<Road>,
    count: usize,
    heights: [HighPassed; 4],
    plane: [Errors; 3],
    roughness: RoughnessSums,
}

impl Output {
    fn new(stage: Stage) -> Self {
        Self {
            stage,
            waiting: VecDeque::new(),
            count: 0,
            heights: Default::default(),
            plane: Default::default(),
            roughness: RoughnessSums::default(),
        }
    }

    fn take(
        &mut self,
        road: &Road,
        from: LogTime,
        truth: &BTreeMap<LogTime, Truth>,
        vehicle: &Vehicle,
        unknown: &mut BTreeMap<&'static str, usize>,
    ) {
        if road.time < from {
            return;
        }
        self.count += 1;
        if self.stage == Stage::Estimate
            && let Some(why) = road.unknown
        {
            *unknown.entry(why.name()).or_insert(0) += 1;
        }
        let Some(truth) = truth.get(&road.time) else {
            return;
        };
        for (wheel, errors) in Wheel::ALL.into_iter().zip(&mut self.heights) {
            let found = road.height_m[wheel];
            let truth_m = truth.height_m[wheel.index()];
            errors.push(
                road.time,
                [found - truth_m, truth_m, road.height_sigma_m[wheel]],
            );
        }
        let places = Wheel::ALL.map(|wheel| vehicle.wheel_place_m(wheel));
        let of_truth = plane(&truth.height_m, &places);
        let p = &road.plane;
        let found = [
            [p.bank_rad, p.bank_sigma_rad],
            [p.grade_rad, p.grade_sigma_rad],
            [p.warp_m, p.warp_sigma_m],
        ];
        for ((errors, [found, sigma]), truth) in self.plane.iter_mut().zip(found).zip(of_truth) {
            errors.add([found - truth, truth, sigma]);
        }
        self.roughness.add(road, &truth.road);
    }

    fn finish(self) -> RoadScore {
        let worst = self.heights.map(HighPassed::finish).into_iter();
        RoadScore {
            output: self.stage.name(),
            height: worst
                .max_by(|a, b| a.rms.total_cmp(&b.rms))
                .unwrap_or_default(),
            plane: self.plane.map(Errors::means),
        }
    }
}

/// Bank, grade and warp of heights by the places of the wheels.
fn plane(height_m: &[f64; 4], places: &[[f64; 2]; 4]) -> [f64; 3] {
    let [fl, fr, rl, rr] = *height_m;
    let [front, rear] = [places[0][1] - places[1][1], places[2][1] - places[3][1]];
    let left = ((fl - fr) * front + (rl - rr) * rear) / (front * front + rear * rear);
    let base = places[0][0] - places[2][0];
    let ahead = 0.5 * (fl + fr - rl - rr) / base;
    [math::atan(left), -math::atan(ahead), fl - fr - rl + rr]
}

impl Errors {
    /// Adds the squares of [error, truth, sigma], which are sums until [`Errors::means`].
    fn add(&mut self, [error, truth, sigma]: [f64; 3]) {
        if [error, truth, sigma].iter().all(|v| v.is_finite()) {
            self.count += 1;
            self.rms += error * error;
            self.truth_rms += truth * truth;
            self.nees += error * error / (sigma * sigma);
        }
    }

    /// Root mean squares of the sums.
    fn means(self) -> Self {
        let count = self.count.max(1) as f64;
        Self {
            count: self.count,
            rms: (self.rms / count).sqrt(),
            truth_rms: (self.truth_rms / count).sqrt(),
            nees: self.nees / count,
        }
    }
}

/// Errors above [`HIGH_PASS_HZ`], of the parts without a gap.
struct HighPassed {
    filter: TwoWay,
    errors: Errors,
}

impl Default for HighPassed {
    fn default() -> Self {
        Self {
            filter: TwoWay::high_pass(HIGH_PASS_HZ),
            errors: Errors::default(),
        }
    }
}

impl HighPassed {
    /// Takes error, truth and standard deviation of the next instant.
    fn push(&mut self, time: LogTime, values: [f64; 3]) {
        let errors = &mut self.errors;
        self.filter.push(time, values, &mut |done| errors.add(done));
    }

    fn finish(mut self) -> Errors {
        let errors = &mut self.errors;
        self.filter.finish(&mut |done| errors.add(done));
        self.errors.means()
    }
}

/// Roughness and index so far.
#[derive(Default)]
struct RoughnessSums {
    last: Option<[RoadRoughness; 2]>,
    count: usize,
    agrees: usize,
    inside: usize,
    index: [f64; 2],
    indexed: usize,
}

impl RoughnessSums {
    fn add(&mut self, road: &Road, truth: &Road) {
        if let (Some(found), Some(truth)) = (road.roughness, truth.roughness) {
            self.count += 1;
            self.agrees += usize::from(found.class() == truth.class());
            let [low, high] = found.bounds_m3;
            self.inside += usize::from((low..=high).contains(&truth.gd_n0_m3));
            self.last = Some([found, truth]);
        }
        let means = [road, truth].map(|road| 0.5 * (road.iri_m_km[0] + road.iri_m_km[1]));
        if means.iter().all(|mean| mean.is_finite()) {
            self.indexed += 1;
            self.index = [self.index[0] + means[0], self.index[1] + means[1]];
        }
    }

    fn finish(&self, stated_class: Option<String>) -> RoughnessScore {
        let part = |some: usize| some as f64 / self.count.max(1) as f64;
        let index = self.index.map(|sum| sum / self.indexed as f64);
        RoughnessScore {
            last: self.last,
            class_agrees: part(self.agrees),
            inside: part(self.inside),
            iri_m_km: (self.indexed > 0).then_some(index),
            stated_class,
        }
    }
}

impl Errors {
    fn to_json(self, unit: &str) -> Value {
        json!({
            "count": self.count,
            format!("rms_{unit}"): self.rms,
            format!("truth_rms_{unit}"): self.truth_rms,
            "nees": self.nees,
        })
    }
}

impl Roads {
    /// As JSON, by the keys of `docs/score.md`.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let outputs: Vec<Value> = self
            .outputs
            .iter()
            .map(|output| {
                let [bank, grade, warp] = output.plane;
                json!({
                    "output": output.output,
                    "height": output.height.to_json("m"),
                    "bank": bank.to_json("rad"),
                    "grade": grade.to_json("rad"),
                    "warp": warp.to_json("m"),
                })
            })
            .collect();
        let roughness = &self.roughness;
        let one = |found: &RoadRoughness| {
            json!({
                "class": found.class().to_string(),
                "class_bounds": found.class_bounds().map(|class| class.to_string()),
                "gd_n0_m3": found.gd_n0_m3,
                "bounds_m3": found.bounds_m3,
                "waviness": if found.waviness.is_nan() { None } else { Some(found.waviness) },
                "distance_m": found.distance_m,
            })
        };
        let last = roughness.last.as_ref();
        json!({
            "outputs": outputs,
            "roughness": last.map(|[found, _]| one(found)),
            "roughness_truth": last.map(|[_, truth]| one(truth)),
            "class_agrees": roughness.class_agrees,
            "roughness_inside": roughness.inside,
            "stated_class": roughness.stated_class,
            "iri_m_km": roughness.iri_m_km.map(|[found, _]| found),
            "iri_truth_m_km": roughness.iri_m_km.map(|[_, truth]| truth),
            "unknown": self.unknown,
        })
    }
}
