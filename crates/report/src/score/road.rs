//! The road against the heights of the ground in the truth.

use std::collections::BTreeMap;

use estimator::Tuning;
use estimator::road::{RoadStatistics, Section};
use model::vehicle::Vehicle;
use sample::{LogTime, Road, RoadRoughness, RoadUnknown, Wheel};
use serde_json::{Value, json};
use store::{Reader, Record, Selection, Stage};

use super::{INTERVAL_S, ScoreError};

/// Corner of the high-pass that estimate and truth pass forward and backward, Hz.
const HIGH_PASS_HZ: f64 = 0.5;
/// Shortest part without a gap that is compared, s.
const PART_MIN_S: f64 = 4.0;

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
    speed_m_s: f64,
}

/// Scores the road of a log without its first `from_s` seconds; `None` where the truth has no heights or the
/// log no road.
pub(super) fn find(
    reader: &Reader,
    start: LogTime,
    from_s: f64,
    vehicle: &Vehicle,
) -> Result<Option<Roads>, ScoreError> {
    let (truth, stated_class) = truth(reader)?;
    if truth.is_empty() {
        return Ok(None);
    }
    let mut unknown = BTreeMap::new();
    let mut all = Vec::new();
    for stage in [Stage::Estimate, Stage::Lagged] {
        let roads = roads(reader, stage, start.offset_seconds(from_s))?;
        if stage == Stage::Estimate {
            for why in roads.iter().filter_map(|road| road.unknown) {
                *unknown.entry(why.name()).or_insert(0) += 1;
            }
        }
        if !roads.is_empty() {
            all.push((stage.name(), roads));
        }
    }
    let Some((_, roads)) = all.last() else {
        return Ok(None);
    };
    let roughness = roughness(&truth, roads, stated_class);
    let outputs = all
        .iter()
        .map(|(output, roads)| of_output(output, roads, &truth, vehicle))
        .collect();
    Ok(Some(Roads {
        outputs,
        roughness,
        unknown,
    }))
}

type TruthByTime = BTreeMap<LogTime, Truth>;

fn truth(reader: &Reader) -> Result<(TruthByTime, Option<String>), ScoreError> {
    let mut speeds = BTreeMap::new();
    for state in reader.truth() {
        let state = state?;
        speeds.insert(state.time, state.motion.velocity_x_m_s.abs());
    }
    let mut truth = BTreeMap::new();
    let mut class = None;
    for message in reader.messages(Selection::topics(["/truth/ground"])) {
        if let Some(Record::Ground { time, ground }) = message?.record()? {
            let height = |wheel| ground.wheels[wheel].ground_height_m;
            let heights = Wheel::ALL.map(|wheel| height(wheel).unwrap_or(f64::NAN));
            class = ground.road_class;
            if let Some(speed_m_s) = speeds.get(&time)
                && heights.iter().all(|h| h.is_finite())
            {
                truth.insert(
                    time,
                    Truth {
                        height_m: heights,
                        speed_m_s: *speed_m_s,
                    },
                );
            }
        }
    }
    Ok((truth, class))
}

fn roads(reader: &Reader, stage: Stage, from: LogTime) -> Result<Vec<Road>, ScoreError> {
    let topic = format!("/{}/road", stage.name());
    let mut roads = Vec::new();
    for message in reader.messages(Selection::topics([topic])) {
        if let Some(Record::Road { road, .. }) = message?.record()?
            && road.time >= from
        {
            roads.push(road);
        }
    }
    Ok(roads)
}

fn of_output(
    output: &'static str,
    roads: &[Road],
    truth: &TruthByTime,
    vehicle: &Vehicle,
) -> RoadScore {
    let worst = Wheel::ALL.map(|wheel| {
        let i = wheel.index();
        above(roads, truth, |road, truth| {
            let found = road.height_m[wheel];
            [found, truth.height_m[i], road.height_sigma_m[wheel]]
        })
    });
    let height = worst.into_iter().max_by(|a, b| a.rms.total_cmp(&b.rms));
    let places = Wheel::ALL.map(|wheel| vehicle.wheel_place_m(wheel));
    let plane = [0, 1, 2].map(|part| {
        errors(roads.iter().filter_map(|road| {
            let truth = plane(&truth.get(&road.time)?.height_m, &places)[part];
            let p = &road.plane;
            let [found, sigma] = [
                [p.bank_rad, p.bank_sigma_rad],
                [p.grade_rad, p.grade_sigma_rad],
                [p.warp_m, p.warp_sigma_m],
            ][part];
            Some([found - truth, truth, sigma])
        }))
    });
    RoadScore {
        output,
        height: height.unwrap_or_default(),
        plane,
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

/// Errors of [error, truth, sigma].
fn errors(values: impl Iterator<Item = [f64; 3]>) -> Errors {
    let mut all = Errors::default();
    for [error, truth, sigma] in values.filter(|all| all.iter().all(|v| v.is_finite())) {
        all.count += 1;
        all.rms += error * error;
        all.truth_rms += truth * truth;
        all.nees += error * error / (sigma * sigma);
    }
    let count = all.count.max(1) as f64;
    Errors {
        count: all.count,
        rms: (all.rms / count).sqrt(),
        truth_rms: (all.truth_rms / count).sqrt(),
        nees: all.nees / count,
    }
}

/// Errors above the corner of the high-pass, of the parts without a gap. `pick` gives estimate, truth, sigma.
fn above(roads: &[Road], truth: &TruthByTime, pick: impl Fn(&Road, &Truth) -> [f64; 3]) -> Errors {
    let mut parts: Vec<Vec<[f64; 3]>> = vec![Vec::new()];
    let mut before: Option<LogTime> = None;
    for road in roads {
        let values = truth.get(&road.time).map(|truth| pick(road, truth));
        let Some(values) = values.filter(|all| all.iter().all(|v| v.is_finite())) else {
            continue;
        };
        if before.is_some_and(|before| road.time.seconds_since(before) > 1.5 * INTERVAL_S) {
            parts.push(Vec::new());
        }
        before = Some(road.time);
        if let Some(part) = parts.last_mut() {
            part.push(values);
        }
    }
    let long = |part: &&Vec<[f64; 3]>| part.len() as f64 * INTERVAL_S >= PART_MIN_S;
    errors(parts.iter().filter(long).flat_map(|part| {
        let column = |value: fn(&[f64; 3]) -> f64| high_passed(part.iter().map(value).collect());
        let error = column(|[found, truth, _]| found - truth);
        let truth = column(|[_, truth, _]| *truth);
        let both = error.into_iter().zip(truth).zip(part);
        both.map(|((error, truth), [_, _, sigma])| [error, truth, *sigma])
            .collect::<Vec<_>>()
    }))
}

/// The values above [`HIGH_PASS_HZ`]: Butterworth of second order, forward and backward.
fn high_passed(mut values: Vec<f64>) -> Vec<f64> {
    let section = Section::new(HIGH_PASS_HZ * INTERVAL_S, true);
    for _ in 0..2 {
        let first = values.first().copied().unwrap_or_default();
        let mut memory = [0.0; 2];
        for value in &mut values {
            *value = section.push(&mut memory, *value - first);
        }
        values.reverse();
    }
    values
}

fn roughness(truth: &TruthByTime, roads: &[Road], stated: Option<String>) -> RoughnessScore {
    let mut statistics = RoadStatistics::new(&Tuning::default().road);
    let mut of_truth = BTreeMap::new();
    let speed_min = Tuning::default().road.speed_min_m_s;
    for (time, truth) in truth {
        let known = truth.speed_m_s >= speed_min;
        statistics.step(
            INTERVAL_S,
            truth.speed_m_s,
            known.then_some(&truth.height_m),
        );
        let blank = Road {
            unknown: None,
            ..Road::unknown(*time, RoadUnknown::Settling)
        };
        of_truth.insert(*time, statistics.complete(blank, truth.speed_m_s));
    }
    let (mut last, mut count, mut agrees, mut inside) = (None, 0_usize, 0_usize, 0_usize);
    let (mut index, mut indexed) = ([0.0; 2], 0_usize);
    for road in roads {
        let Some(truth) = of_truth.get(&road.time) else {
            continue;
        };
        if let (Some(found), Some(truth)) = (road.roughness, truth.roughness) {
            count += 1;
            agrees += usize::from(found.class() == truth.class());
            let [low, high] = found.bounds_m3;
            inside += usize::from((low..=high).contains(&truth.gd_n0_m3));
            last = Some([found, truth]);
        }
        let means = [road, truth].map(|road| 0.5 * (road.iri_m_km[0] + road.iri_m_km[1]));
        if means.iter().all(|mean| mean.is_finite()) {
            indexed += 1;
            index = [index[0] + means[0], index[1] + means[1]];
        }
    }
    let part = |some: usize| some as f64 / count.max(1) as f64;
    RoughnessScore {
        last,
        class_agrees: part(agrees),
        inside: part(inside),
        iri_m_km: (indexed > 0).then(|| index.map(|sum| sum / indexed as f64)),
        stated_class: stated,
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
