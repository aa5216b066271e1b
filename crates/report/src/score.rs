//! Estimates of a log against its truth, or against those of another log of the same drive.
//!
//! The keys of the JSON are a contract: see `docs/score.md`.

mod channels;
mod compare;
mod flights;
mod forces;
mod innovations;
mod landings;
mod lifts;
mod pass;
mod road;
mod signals;
mod stops;
mod surfaces;
mod two_way;

use std::collections::BTreeMap;
use std::rc::Rc;

use estimator::consistency::Consistency;
use estimator::score;
use model::vehicle::Vehicle;
use pass::Pass;
use sample::{Estimate, Event, ForceFrame, LogTime, Motion, PerWheel, Wheel};
use serde_json::{Value, json};
use store::{Attachment, Reader, Record, Selection, Stage};

pub use channels::Channels;
pub use compare::{Comparison, Difference, compare};
pub use forces::{ForceScore, LowPassedScore, NearScore, PartScore};
pub use innovations::{InnovationScore, innovations, innovations_json};
pub use landings::LandingScore;
pub use lifts::{Lift, Lifts, OffGround, WarningLeads};
pub use road::{RoadScore, Roads, RoughnessScore};
pub use stops::StopCounts;
pub use surfaces::{SurfaceChange, SurfaceChanges};

/// Sideslip and slip angles mean little below this speed, m/s.
const SLIP_SPEED_MIN_M_S: f64 = 3.0;
/// Interval of the estimates, s.
const INTERVAL_S: f64 = 0.01;
/// Longest delay that is looked for, intervals.
const DELAY_MAX: usize = 50;
/// Instants whose delay is found together: 82 s. Memory does not grow with the length of a log.
const PART_PAIRS: usize = 8192;
/// Why a log could not be scored.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// The log could not be read.
    #[error(transparent)]
    Log(#[from] store::Error),
    /// No truth.
    #[error(
        "the log has no truth to compare with; use a log of `atvrec simulate`, an import with \
         columns truth.*, or a replay of such a log"
    )]
    NoTruth,
    /// No estimate at an instant of the truth.
    #[error(
        "no estimate has the same time as a {0}; use a log with estimates, and for --smoothed a log \
         of `replay --smooth`"
    )]
    NoPair(&'static str),
    /// The user interrupted the work.
    #[error("interrupted")]
    Interrupted,
    /// No vehicle.
    #[error(
        "the configuration in the log has no valid vehicle, so that nothing was estimated; replay \
         the log with --vehicle"
    )]
    NoVehicle,
}

/// One signal's errors.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalScore {
    /// Its name.
    pub signal: &'static str,
    /// The wheel, if it is a wheel's.
    pub wheel: Option<Wheel>,
    /// Unit of the errors.
    pub unit: &'static str,
    /// Frame of the truth, of forces and moments.
    pub frame: Option<ForceFrame>,
    /// The errors.
    pub errors: score::Errors,
    /// 100 RMSE / max(peak of the truth, static wheel load or 50 N m), of forces and moments.
    pub normalised_percent: Option<f64>,
    /// How late the estimate is, s.
    pub delay_s: Option<f64>,
    /// Mean of ((estimate - truth)/sigma)^2.
    pub nees: Option<f64>,
    /// Part of the windows whose mean lies within the 95 % bounds of its chi-square.
    pub nees_inside: Option<f64>,
}

/// A scored log.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Time that was compared, s.
    pub seconds: f64,
    /// Signals of which both sides know something.
    pub signals: Vec<SignalScore>,
    /// Tyre forces of each output, by frame; first those in the frame that they are given in.
    pub forces: Vec<ForceScore>,
    /// The same after a low-pass, where one was asked for.
    pub low_passed: Option<LowPassedScore>,
    /// Peaks of the load after landings, of each output.
    pub landings: Vec<LandingScore>,
    /// Whether innovations are as large as the filters expect.
    pub innovations: Vec<InnovationScore>,
    /// Lifts of wheels.
    pub lifts: Lifts,
    /// Lifts of both wheels of a side.
    pub two_wheel_lifts: Lifts,
    /// Stops, touchdowns and standstills of the truth.
    pub stops: StopCounts,
    /// Changes of the surface, where the truth tells the friction.
    pub surface_changes: Option<SurfaceChanges>,
    /// The road, where the truth has the heights of the ground.
    pub road: Option<Roads>,
    /// Channels that were excluded, where the log tells the faults that its simulation injected.
    pub channels: Option<Channels>,
    /// How many events of each kind the estimator declared.
    pub events: BTreeMap<&'static str, usize>,
}

/// What is scored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreOptions {
    /// Causal (`Stage::Estimate`) or smoothed (`Stage::Smoothed`) estimates.
    pub stage: Stage,
    /// Time at the start that is left out, s; of events only above `SETTLING_S`.
    pub from_s: f64,
    /// Corner of a low-pass after which the forces are compared, too, Hz: within [`LOW_PASS_HZ`].
    pub low_pass_hz: Option<f64>,
}

/// Corners of a low-pass that are possible at the rate of the estimates, Hz.
pub const LOW_PASS_HZ: [f64; 2] = [0.5, 45.0];

/// Instants whose signals are compared one after the other: their estimates and truths stay in the processor's
/// cache.
const TILE_PAIRS: usize = 32;

/// An estimate that several outputs share. Its box comes from the reader and goes back to it without a copy.
type SharedEstimate = Rc<Box<Estimate>>;

/// What is compared at an instant: the estimate and the truth.
type Pair = (Box<Estimate>, SharedEstimate);

/// Several instants.
type Pairs = Vec<Pair>;

/// A signal of an estimate with its standard deviation (`NaN` if there is none).
trait Pick {
    /// Of one estimate.
    fn of(&self, estimate: &Estimate) -> (f64, f64);

    /// Of at most [`TILE_PAIRS`] estimates: values, and standard deviations. A call for each would take longer
    /// than the rest.
    fn of_each(&self, estimates: &[&Estimate], found: &mut [[f64; TILE_PAIRS]; 2]);
}

impl<F: Fn(&Estimate) -> (f64, f64)> Pick for F {
    fn of(&self, estimate: &Estimate) -> (f64, f64) {
        self(estimate)
    }

    fn of_each(&self, estimates: &[&Estimate], [values, sigmas]: &mut [[f64; TILE_PAIRS]; 2]) {
        for ((value, sigma), estimate) in values.iter_mut().zip(sigmas).zip(estimates) {
            (*value, *sigma) = self(estimate);
        }
    }
}

/// Time in which the filters settle, s. Signals are not compared then, but an event that is declared
/// then is declared to a user too.
const SETTLING_S: f64 = 2.0;

/// Scores a log's estimates, causal (`Stage::Estimate`) or smoothed ones (`Stage::Smoothed`),
/// leaving out its first `from_s` seconds; of events only if they are more than `SETTLING_S`.
///
/// # Errors
/// If the log cannot be read, has no truth, no estimate or no vehicle.
pub fn score(reader: &Reader, stage: Stage, from_s: f64) -> Result<Score, ScoreError> {
    let low_pass_hz = None;
    let options = ScoreOptions {
        stage,
        from_s,
        low_pass_hz,
    };
    score_with(reader, options, &mut |_| Ok(()))
}

/// The same with all options; `progress` is called with the part that was read, 0 to 1, and ends it by an error.
///
/// # Errors
/// As [`score()`], and the error of `progress`.
pub fn score_with(
    reader: &Reader,
    options: ScoreOptions,
    progress: &mut dyn FnMut(f64) -> Result<(), ScoreError>,
) -> Result<Score, ScoreError> {
    let vehicle = vehicle_of(&reader.attachments()?).ok_or(ScoreError::NoVehicle)?;
    let mut pass = Pass::new(&vehicle, options);
    pass.read(reader, progress)?;
    pass.finish(reader)
}

/// Scores the forces of other methods on the same log, by name.
///
/// # Errors
/// If the log cannot be read, has no truth, or no vehicle.
pub fn score_methods(
    reader: &Reader,
    methods: impl IntoIterator<Item = (&'static str, Vec<Estimate>)>,
    from_s: f64,
) -> Result<Vec<ForceScore>, ScoreError> {
    let vehicle = vehicle_of(&reader.attachments()?).ok_or(ScoreError::NoVehicle)?;
    let loads = static_loads(&vehicle);
    let truth = truth(reader)?;
    let mut all = Vec::new();
    for (name, estimates) in methods {
        let pairs = paired(&truth, estimates, from_s)?;
        let frames = forces::known_frames(pairs.iter().map(|(estimate, _)| &**estimate));
        let mut forces = forces::Forces::default();
        for part in pairs.chunks(PART_PAIRS) {
            for tile in part.chunks(TILE_PAIRS) {
                forces.push(tile, frames.as_ref(), None);
            }
            forces.end_part();
        }
        all.extend(forces.finish(name, &loads));
    }
    Ok(all)
}

/// The vehicle of a log's configuration.
#[must_use]
pub fn vehicle_of(attachments: &[Attachment]) -> Option<Vehicle> {
    let text = |name: &str| {
        let found = attachments.iter().find(|file| file.name == name)?;
        String::from_utf8(found.data.clone()).ok()
    };
    let configuration: toml::Table = text("atvrec.toml")?.parse().ok()?;
    let name = configuration.get("vehicle")?.get("file")?.as_str()?;
    let file = text(name)
        .or_else(|| text(&format!("{name}.vehicle.toml")))
        .or_else(|| Vehicle::builtin_text(name).map(str::to_owned))?;
    Vehicle::from_toml(&file, name).ok()
}

/// Load of each wheel at rest, N.
fn static_loads(vehicle: &Vehicle) -> PerWheel<f64> {
    PerWheel::from_fn(|wheel| vehicle.static_load_n(wheel))
}

/// Load of a wheel in the truth, N: in the contact frame if it is known there, otherwise in the
/// wheel-carrier frame.
fn contact_load_n(truth: &Estimate, wheel: Wheel) -> f64 {
    let [contact, carrier] =
        [ForceFrame::Contact, ForceFrame::WheelCarrier].map(|frame| truth.forces(frame)[wheel]);
    let load_n = contact.force_n[2];
    if load_n.is_nan() {
        carrier.force_n[2]
    } else {
        load_n
    }
}

type TruthByTime = BTreeMap<LogTime, SharedEstimate>;

fn truth(reader: &Reader) -> Result<TruthByTime, ScoreError> {
    let mut truth = BTreeMap::new();
    for state in reader.truth() {
        let state = state?;
        truth.insert(state.time, Rc::new(Box::new(state)));
    }
    Ok(truth)
}

/// Estimates beside the truth of the same instant.
fn paired(truth: &TruthByTime, estimates: Vec<Estimate>, from_s: f64) -> Result<Pairs, ScoreError> {
    let start = *truth.keys().next().ok_or(ScoreError::NoTruth)?;
    let late = estimates
        .into_iter()
        .filter(|estimate| estimate.time.seconds_since(start) >= from_s);
    let pairs: Pairs = late
        .filter_map(|estimate| {
            let truth = Rc::clone(truth.get(&estimate.time)?);
            Some((Box::new(estimate), truth))
        })
        .collect();
    if pairs.is_empty() {
        return Err(ScoreError::NoPair("truth"));
    }
    Ok(pairs)
}

fn events(reader: &Reader) -> Result<Vec<Event>, ScoreError> {
    let mut events = Vec::new();
    for message in reader.messages(Selection::topics(["/estimate/events"])) {
        if let Some(Record::Event(event)) = message?.record()? {
            events.push(event);
        }
    }
    Ok(events)
}

fn counts(events: &[Event], from: LogTime) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for event in events.iter().filter(|event| event.time >= from) {
        *counts.entry(event.kind.name()).or_insert(0) += 1;
    }
    counts
}

/// A signal that is compared.
struct Signal<'a> {
    name: &'static str,
    wheel: Option<Wheel>,
    unit: &'static str,
    frame: Option<ForceFrame>,
    /// The signal of an estimate.
    estimate: &'a dyn Pick,
    /// The signal of a truth.
    truth: &'a dyn Pick,
}

/// Names of the forces in the frame in which they are given.
const OWN: [&str; 3] = ["measured_force_x", "measured_force_y", "measured_force_z"];

/// Calls `add` with each signal. `frames`: as [`forces::frames`] gives them.
fn each_signal(frames: &[[ForceFrame; 2]], mut add: impl FnMut(Signal<'_>)) {
    each_plain(&mut add);
    each_force(frames, add);
}

/// An angle of the estimate while the vehicle is fast enough for it, NaN otherwise.
fn quick(estimate: &Estimate, angle_rad: f64) -> f64 {
    if estimate.motion.velocity_x_m_s > SLIP_SPEED_MIN_M_S {
        angle_rad
    } else {
        f64::NAN
    }
}

/// An angle of the truth. A reference may tell it without a speed, which is NaN then.
fn true_angle(truth: &Estimate, angle_rad: f64) -> f64 {
    if truth.motion.velocity_x_m_s <= SLIP_SPEED_MIN_M_S {
        f64::NAN
    } else {
        angle_rad
    }
}

/// Calls `add` with each signal except forces and moments.
fn each_plain(mut add: impl FnMut(Signal<'_>)) {
    let mut add_plain = |name, wheel, unit, estimate: &dyn Pick, truth: &dyn Pick| {
        add(Signal {
            name,
            wheel,
            unit,
            frame: None,
            estimate,
            truth,
        });
    };
    let none = f64::NAN;
    let sideslip = |e: &Estimate| {
        let angle = quick(e, e.motion.sideslip_rad);
        (angle, e.motion.sideslip_sigma_rad)
    };
    let true_sideslip = |e: &Estimate| (true_angle(e, e.motion.sideslip_rad), none);
    add_plain("sideslip", None, "rad", &sideslip, &true_sideslip);
    type Plain = (&'static str, &'static str, fn(&Motion) -> f64);
    let plain: [Plain; 9] = [
        ("velocity_x", "m/s", |m| m.velocity_x_m_s),
        ("velocity_y", "m/s", |m| m.velocity_y_m_s),
        ("roll", "rad", |m| m.roll_rad),
        ("pitch", "rad", |m| m.pitch_rad),
        ("roll_rate", "rad/s", |m| m.rate_rad_s[0]),
        ("pitch_rate", "rad/s", |m| m.rate_rad_s[1]),
        ("yaw_rate", "rad/s", |m| m.rate_rad_s[2]),
        ("bank", "rad", |m| m.bank_rad),
        ("grade", "rad", |m| m.grade_rad),
    ];
    for (signal, unit, value) in plain {
        let pick = |e: &Estimate| (value(&e.motion), none);
        add_plain(signal, None, unit, &pick, &pick);
    }
    for wheel in Wheel::ALL {
        let steer = |e: &Estimate| (e.motion.steer_rad[wheel], none);
        add_plain("steer", Some(wheel), "rad", &steer, &steer);
    }
    for wheel in Wheel::ALL {
        let slip = |e: &Estimate| (quick(e, e.motion.slip_angle_rad[wheel]), none);
        let truth = |e: &Estimate| (true_angle(e, e.motion.slip_angle_rad[wheel]), none);
        add_plain("slip_angle", Some(wheel), "rad", &slip, &truth);
    }
    for wheel in Wheel::ALL {
        let slip = |e: &Estimate| {
            let motion = &e.motion;
            let sigma = motion.longitudinal_slip_sigma[wheel];
            (motion.longitudinal_slip[wheel], sigma)
        };
        add_plain("longitudinal_slip", Some(wheel), "1", &slip, &slip);
    }
}

/// Calls `add` with the forces and moments of each wheel.
fn each_force(frames: &[[ForceFrame; 2]], mut add: impl FnMut(Signal<'_>)) {
    let expected = ["expected_force_x", "expected_force_y", "expected_force_z"];
    let moments = [
        "measured_moment_x",
        "measured_moment_y",
        "measured_moment_z",
    ];
    for (rank, [frame, own_frame]) in frames.iter().copied().enumerate() {
        let names = match frame {
            _ if rank == 0 => OWN,
            ForceFrame::Contact => ["contact_force_x", "contact_force_y", "contact_force_z"],
            ForceFrame::WheelCarrier => ["carrier_force_x", "carrier_force_y", "carrier_force_z"],
        };
        for axis in 0..3 {
            for wheel in Wheel::ALL {
                let wheel_signal = |name, unit, estimate, truth| Signal {
                    name,
                    wheel: Some(wheel),
                    unit,
                    frame: Some(frame),
                    estimate,
                    truth,
                };
                let force = |e: &Estimate, frame: ForceFrame| {
                    let force = &e.forces(frame)[wheel];
                    (force.force_n[axis], force.sigma_n[axis])
                };
                let own = |e: &Estimate| force(e, own_frame);
                let truth = |e: &Estimate| force(e, frame);
                let model = |e: &Estimate| (e.expected[wheel].force_n[axis], f64::NAN);
                let moment = |e: &Estimate| {
                    let force = &e.forces(frame)[wheel];
                    (force.moment_n_m[axis], force.moment_sigma_n_m[axis])
                };
                add(wheel_signal(names[axis], "N", &own, &truth));
                if frame == ForceFrame::Contact {
                    add(wheel_signal(expected[axis], "N", &model, &truth));
                }
                if rank == 0 {
                    add(wheel_signal(moments[axis], "N m", &moment, &moment));
                }
            }
        }
    }
}

impl Score {
    /// The score of a signal.
    #[must_use]
    pub fn signal(&self, name: &str, wheel: Option<Wheel>) -> Option<&SignalScore> {
        let mut all = self.signals.iter();
        all.find(|row| row.signal == name && row.wheel == wheel)
    }

    /// As JSON, by the keys of `docs/score.md`.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let signals: Vec<Value> = self
            .signals
            .iter()
            .map(|row| {
                json!({
                    "signal": row.signal,
                    "wheel": row.wheel.map(Wheel::abbreviation),
                    "unit": row.unit,
                    "frame": row.frame.map(ForceFrame::name),
                    "count": row.errors.count,
                    "mean": row.errors.mean,
                    "rmse": row.errors.rmse,
                    "percentile_95": row.errors.percentile_95,
                    "peak": row.errors.peak,
                    "normalised_percent": row.normalised_percent,
                    "delay_s": row.delay_s,
                    "nees": row.nees,
                    "nees_inside": row.nees_inside,
                })
            })
            .collect();
        let lifts = |lifts: &Lifts, key: &str| -> Vec<Value> {
            lifts.lifts.iter().map(|lift| lift.to_json(key)).collect()
        };
        let surfaces = self.surface_changes.as_ref();
        let changes = surfaces.map(|surfaces| -> Vec<Value> {
            let changes = surfaces.changes.iter();
            changes.map(SurfaceChange::to_json).collect()
        });
        json!({
            "seconds": self.seconds,
            "signals": signals,
            "forces": self.forces.iter().map(ForceScore::to_json).collect::<Vec<_>>(),
            "forces_nees": self.forces.first().and_then(|own| own.windows.as_ref()).map(consistency_json),
            "low_passed": self.low_passed.as_ref().map(LowPassedScore::to_json),
            "landings": self.landings.iter().map(LandingScore::to_json).collect::<Vec<_>>(),
            "innovations": innovations_json(&self.innovations),
            "lifts": lifts(&self.lifts, "wheel"),
            "missed_lifts": self.lifts.missed(),
            "declared_lifts": self.lifts.declared,
            "false_lifts": self.lifts.false_lifts,
            "lift_warnings": self.lifts.warnings,
            "false_lift_warnings": self.lifts.false_warnings,
            "lift_warning_leads": self.lifts.warning_leads().to_json(),
            "off_ground": self.lifts.off_ground.to_json(),
            "two_wheel_lifts": lifts(&self.two_wheel_lifts, "side"),
            "missed_two_wheel_lifts": self.two_wheel_lifts.missed(),
            "declared_two_wheel_lifts": self.two_wheel_lifts.declared,
            "false_two_wheel_lifts": self.two_wheel_lifts.false_lifts,
            "two_wheel_lift_warnings": self.two_wheel_lifts.warnings,
            "false_two_wheel_lift_warnings": self.two_wheel_lifts.false_warnings,
            "two_wheel_lift_warning_leads": self.two_wheel_lifts.warning_leads().to_json(),
            "two_wheels_off_ground": self.two_wheel_lifts.off_ground.to_json(),
            "stops": self.stops.to_json(),
            "surface_changes": changes,
            "missed_surface_changes": surfaces.map(SurfaceChanges::missed),
            "false_surface_changes": surfaces.map(|surfaces| surfaces.false_changes),
            "road": self.road.as_ref().map(Roads::to_json),
            "channels": self.channels.as_ref().map(Channels::to_json),
            "events": self.events,
        })
    }
}

fn consistency_json(found: &Consistency) -> Value {
    json!({
        "mean": found.mean,
        "median": found.median,
        "windows": found.windows,
        "inside": found.inside,
        "above": found.above,
        "freedom": found.freedom,
        "bounds": found.bounds,
    })
}
