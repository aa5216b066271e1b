//! Mistakes of the configuration: what the drive proves is reported, and corrected where it is known.

mod events;

use std::sync::Arc;

use model::sensors::Sensors;
use model::vehicle::{MassProperties, Payload, Vehicle};
use nalgebra::{Matrix3, Rotation3, Vector3};
use sample::{CornerSample, Event, LogTime, StrainChannel, Wheel};

use super::{Estimator, Output};
use crate::Calibration;
use crate::calibration::{Channel, ChannelCalibration, Resolved};
use crate::fusion::relations::{CHANNELS, channel_of};
use crate::fusion::{Forces, Fusion};
use crate::mistakes::{
    Described, Driven, Hypothesis, Judged, Mistakes, Setup, right_angles, stated_tuning,
};
use crate::statics::AXIAL;
use crate::tuning::{MistakeTuning, Tuning};
use crate::units::{UnitWatch, WrongUnit};

/// Name of the payload that the drive has shown.
const FOUND_PAYLOAD: &str = "found by the estimator";

/// A mistake that the drive has proved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundMistake {
    /// When.
    pub time: LogTime,
    /// What, and its numbers.
    pub judged: Judged,
    /// Whether the estimator uses the corrected value from then on.
    pub corrected: bool,
}

/// Errors of the parameters of vehicle and sensors files within their tolerances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ParameterErrors {
    /// Factor on the tolerances that the drive shows; 0 as long as the parameters are taken for exact.
    pub factor: f64,
    /// Since when the standard deviations of the forces contain them, if the drive has shown them.
    pub since: Option<LogTime>,
    /// The same from the first estimate, s.
    pub since_s: Option<f64>,
    /// Whether a file states tolerances: then the standard deviations contain them from the beginning.
    pub are_stated: bool,
}

/// What a drive says of the configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MistakeReport {
    /// Mistakes that it has proved.
    pub found: Vec<(FoundMistake, Described)>,
    /// The mistake that is likeliest after these, and the logarithm of its ratio of likelihoods.
    pub likeliest: Option<(Described, f64)>,
    /// Whether that one is so likely that the configuration is in doubt.
    pub is_suspected: bool,
    /// What was driven since the last correction.
    pub driven: Driven,
    /// Whether a drive without a mistake shows that the configuration is right.
    pub is_decisive: bool,
    /// Manoeuvre that decides what is not decided, with its duration.
    pub manoeuvre: String,
    /// Corrections of the calibration.
    pub changes: CalibrationChanges,
    /// Load to add to the vehicle file.
    pub payload: Option<Payload>,
    /// Errors of the parameters.
    pub parameters: ParameterErrors,
    /// Wrong units of rates, angles and speeds, with the time at which each was found and corrected.
    pub units: Vec<(LogTime, WrongUnit)>,
}

impl MistakeReport {
    /// Whether no mistake was found.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.found.is_empty() && self.units.is_empty()
    }
}

/// Corrections of a calibration file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CalibrationChanges {
    channels: Vec<(Wheel, StrainChannel, ChannelCalibration)>,
    misalignment_rad: Option<[f64; 3]>,
    imu_m: Option<[f64; 3]>,
}

impl CalibrationChanges {
    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Applies them.
    pub fn apply(&self, calibration: &mut Calibration) {
        for (wheel, channel, change) in &self.channels {
            let corner = calibration.corner.entry(*wheel).or_default();
            *corner.strain.entry(*channel).or_default() = *change;
        }
        let imu = &mut calibration.imu;
        imu.misalignment_rad = self.misalignment_rad.or(imu.misalignment_rad);
        imu.position_m = self.imu_m.or(imu.position_m);
    }
}

/// The search for mistakes of the configuration.
#[derive(Clone, Debug)]
pub(super) struct MistakeWatch {
    /// Shared by copies of the estimator until it changes.
    evidence: Arc<Mistakes>,
    found: Vec<(FoundMistake, Described)>,
    /// Member that each axial channel of a corner measures.
    members: [[usize; AXIAL.len()]; 4],
    /// Wheel that the channels of a corner belong to.
    wheels: [Wheel; 4],
    /// Factor on the specific force.
    pub(super) scale: f64,
    /// The first step, and since when a mistake is likely.
    started: Option<LogTime>,
    suspected: Option<LogTime>,
    /// Nothing more is looked for: what was found cannot be corrected.
    ended: bool,
    pub(super) units: UnitWatch,
    wrong_units: Vec<(LogTime, WrongUnit)>,
    /// Since when the drive shows that the parameters are not exact.
    inexact: Option<LogTime>,
    /// Variances of the forces by parameters that are not exact, a step before, N^2.
    variances_before: Option<[f64; 12]>,
}

impl MistakeWatch {
    pub(super) fn new(
        fusion: &Fusion,
        vehicle: &Vehicle,
        sensors: &Sensors,
        calibration: &Resolved,
        all: &Tuning,
    ) -> Self {
        let setup = fusion.mistake_setup(vehicle, sensors, calibration);
        let tuning = stated_tuning(&all.mistakes, vehicle, sensors);
        Self {
            evidence: Arc::new(Mistakes::new(setup, &tuning)),
            found: Vec::new(),
            members: [std::array::from_fn(|i| i); 4],
            wheels: Wheel::ALL,
            scale: 1.0,
            started: None,
            suspected: None,
            ended: false,
            units: UnitWatch::new(&all.units),
            wrong_units: Vec::new(),
            inexact: None,
            variances_before: None,
        }
    }

    /// Adds what parameters within their tolerances leave uncertain to the standard deviations of the forces.
    pub(super) fn consider(&mut self, fusion: &Fusion, forces: &mut Forces) {
        let variances = self.evidence.force_variances(fusion.loads());
        let before = std::mem::replace(&mut self.variances_before, variances);
        for (forces, variances) in [(&mut forces.now, variances), (&mut forces.lagged, before)] {
            let sigmas = forces.0.iter_mut().flat_map(|force| &mut force.sigma_n);
            for (sigma, variance) in sigmas.zip(variances.into_iter().flatten()) {
                *sigma = (*sigma * *sigma + variance).sqrt();
            }
        }
    }

    /// Errors of the parameters.
    fn parameters(&self) -> ParameterErrors {
        ParameterErrors {
            factor: self.evidence.tolerance_factor(),
            since: self.inexact,
            since_s: (self.inexact.zip(self.started))
                .map(|(since, started)| since.seconds_since(started)),
            are_stated: self.evidence.are_tolerances_stated(),
        }
    }

    /// The event that the drive shows parameters that are not exact, once. Tolerances that a file states count from the
    /// beginning, and need no event. Late in a drive, small errors of the models add up to a factor as well.
    fn inexact_event(&mut self, now: LogTime, t: &MistakeTuning) -> Option<Event> {
        let known = self.parameters();
        let is_early =
            (self.started).is_some_and(|at| now.seconds_since(at) < t.care_reported_within_s);
        if !is_early || known.factor < t.care_reported || known.are_stated || known.since.is_some()
        {
            return None;
        }
        self.inexact = Some(now);
        Some(events::inexact(now, known.factor))
    }

    /// Whether no channel is blamed alone: the drive has not said yet that the configuration is right, or a mistake
    /// is likely. Each lasts `hold_s` at most.
    fn is_undecided(&mut self, now: LogTime, hold_s: f64) -> bool {
        let within = |since: LogTime| now.seconds_since(since) < hold_s;
        let is_new = within(*self.started.get_or_insert(now)) && !self.evidence.is_agreed();
        self.suspected = self
            .evidence
            .is_suspected()
            .then(|| self.suspected.unwrap_or(now));
        is_new || self.suspected.is_some_and(within)
    }

    /// The sample of the corner to which it belongs, its channels in the order of the members.
    pub(super) fn routed(&self, sample: &CornerSample) -> CornerSample {
        let mut routed = *sample;
        let from = sample.wheel.index();
        routed.wheel = self.wheels[from];
        for (i, member) in self.members[from].into_iter().enumerate() {
            routed.strain_counts[AXIAL[member].index()] = sample.strain_counts[AXIAL[i].index()];
        }
        routed
    }
}

impl Estimator {
    /// What the drive says of the configuration so far; `None` for a vehicle without linkages.
    #[must_use]
    pub fn mistake_report(&self) -> Option<MistakeReport> {
        let watch = self.mistakes.as_ref()?;
        let count_n = self.count_n();
        let words = |judged: &Judged| judged.describe(&self.vehicle, &count_n);
        let evidence = &watch.evidence;
        let (driven, tuning) = (evidence.driven(), &self.settings.tuning.mistakes);
        Some(MistakeReport {
            found: watch.found.clone(),
            likeliest: evidence
                .judged()
                .first()
                .map(|best| (words(best), best.ratio)),
            is_suspected: evidence.is_suspected(),
            driven: *driven,
            is_decisive: driven.is_decisive(tuning),
            manoeuvre: driven.manoeuvre(tuning),
            changes: self.calibration_changes(&watch.found),
            payload: self
                .unloaded
                .payload
                .iter()
                .find(|load| load.name == FOUND_PAYLOAD)
                .cloned(),
            parameters: watch.parameters(),
            units: watch.wrong_units.clone(),
        })
    }

    fn calibration_changes(&self, found: &[(FoundMistake, Described)]) -> CalibrationChanges {
        let mut changes = CalibrationChanges::default();
        let c = &self.unloaded_calibration;
        for (found, _) in found.iter().filter(|(found, _)| found.corrected) {
            let channels = match found.judged.hypothesis {
                Hypothesis::Zeros => 0..CHANNELS,
                Hypothesis::Gain(at) | Hypothesis::Bent(at) => at..at + 1,
                Hypothesis::Tilted(_) | Hypothesis::Turned(_) => {
                    let turned = Rotation3::from_matrix(&c.body_from_imu).inverse();
                    let (x, y, z) = turned.euler_angles();
                    changes.misalignment_rad = Some([x, y, z]);
                    0..0
                }
                Hypothesis::Moved => {
                    changes.imu_m = Some(c.imu_m.into());
                    0..0
                }
                _ => 0..0,
            };
            for at in channels {
                let (wheel, channel) = channel_of(at);
                let known = &c.corners.0[wheel].strain[channel.index()];
                let change = ChannelCalibration {
                    offset_counts: Some(known.offset_counts),
                    offset_sigma_counts: Some((known.offset_sigma / known.gain).abs()),
                    gain_per_count: Some(known.gain),
                    dead: known.dead,
                    ..ChannelCalibration::default()
                };
                let wheel = Wheel::ALL[wheel];
                changes
                    .channels
                    .retain(|(w, c, _)| (*w, *c) != (wheel, channel));
                changes.channels.push((wheel, channel, change));
            }
        }
        changes
    }

    /// Weighs the mistakes by the relations of the last window, if it is complete.
    pub(super) fn watch_mistakes(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        self.watch_units(now, out);
        let (Some(fusion), Some(watch)) = (&mut self.fusion, &mut self.mistakes) else {
            return;
        };
        if watch.ended {
            return;
        }
        let t = &self.settings.tuning.mistakes;
        if watch.units.is_doubtful(now) {
            fusion.with_relations(|_| {});
            return;
        }
        let mut certain = None;
        let has_begun = fusion.has_leapt();
        fusion.with_relations(|window| {
            certain = Arc::make_mut(&mut watch.evidence).take(window, has_begun);
        });
        fusion.hold_blame(watch.is_undecided(now, t.hold_s));
        if let Some(event) = watch.inexact_event(now, t) {
            out(Output::Event(event));
        }
        let Some(judged) = certain else { return };
        let count_n = self.count_n();
        let described = judged.describe(&self.vehicle, &count_n);
        let corrected = self.correct(&judged).is_some();
        let then = if corrected {
            events::CORRECTED
        } else {
            "the estimates are wrong until this is corrected"
        };
        out(Output::Event(events::mistake(now, &described, then)));
        if let Some(watch) = &mut self.mistakes {
            let found = FoundMistake {
                time: now,
                judged,
                corrected,
            };
            watch.found.push((found, described));
            watch.ended |= !corrected;
            if judged.hypothesis == Hypothesis::Several {
                Arc::make_mut(&mut watch.evidence).doubt(judged.value[0]);
                return;
            }
        }
        self.begin_again();
    }

    /// Corrects a wrong unit that the last window shows.
    fn watch_units(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        let Some(watch) = &mut self.mistakes else {
            return;
        };
        let Some(wrong) = watch.units.step(now) else {
            return;
        };
        watch.wrong_units.push((now, wrong));
        out(Output::Event(events::mistake(
            now,
            &wrong.describe(),
            events::CORRECTED,
        )));
        self.motion.begin_again();
        self.begin_again();
    }

    /// Value of one count of each axial channel, N.
    pub(super) fn count_n(&self) -> [f64; CHANNELS] {
        std::array::from_fn(|at| {
            let (wheel, channel) = channel_of(at);
            self.unloaded_calibration.corners.0[wheel].strain[channel.index()].gain
        })
    }

    /// Corrects the configuration; `None` if the drive does not tell how, or not well enough.
    fn correct(&mut self, judged: &Judged) -> Option<()> {
        let t = self.settings.tuning.mistakes;
        let three = |values: &[f64]| Vector3::new(values[0], values[1], values[2]);
        match judged.hypothesis {
            Hypothesis::Zeros => {
                for at in 0..CHANNELS {
                    self.shift_zero(at, judged.value[at], judged.sigma[at]);
                }
            }
            Hypothesis::Gain(at) => {
                let gain = judged.usual_gain(t.gain_known);
                self.change_channel(at, |channel| match gain {
                    Some(gain) => {
                        channel.gain /= gain;
                        channel.noise_sigma /= gain.abs();
                    }
                    None => channel.dead = true,
                });
            }
            Hypothesis::Bent(at) => self.change_channel(at, |channel| channel.dead = true),
            Hypothesis::Exchanged(wheel, [a, b]) => {
                self.mistakes.as_mut()?.members[wheel].swap(a, b);
                self.change_calibrations(|c| {
                    let strain = &mut c.corners.0[wheel].strain;
                    let [a, b] = [a, b].map(|i| AXIAL[i].index());
                    let offset = strain[a].offset_counts;
                    strain[a].offset_counts = strain[b].offset_counts;
                    strain[b].offset_counts = offset;
                });
            }
            Hypothesis::Corners([a, b]) => {
                self.mistakes.as_mut()?.wheels.swap(a, b);
                self.change_calibrations(|c| {
                    for i in 0..AXIAL.len() {
                        let i = AXIAL[i].index();
                        let offset = c.corners.0[a].strain[i].offset_counts;
                        c.corners.0[a].strain[i].offset_counts =
                            c.corners.0[b].strain[i].offset_counts;
                        c.corners.0[b].strain[i].offset_counts = offset;
                    }
                    let offset = c.corners.0[a].deflection.offset_counts;
                    c.corners.0[a].deflection.offset_counts =
                        c.corners.0[b].deflection.offset_counts;
                    c.corners.0[b].deflection.offset_counts = offset;
                });
            }
            Hypothesis::Payload => self.add_payload(judged)?,
            Hypothesis::Tilted(axis) => {
                let turn = Rotation3::new(Vector3::ith(axis, -judged.value[0]));
                self.turn_imu(*turn.matrix());
            }
            Hypothesis::Turned(k) => self.turn_imu(right_angles(k + 1).transpose()),
            Hypothesis::Moved => {
                let by = three(&judged.value);
                self.change_calibrations(|c| c.imu_m += by);
                self.place_antennas();
            }
            Hypothesis::Unit(is_large) => {
                let g = sample::STANDARD_GRAVITY_M_S2;
                self.mistakes.as_mut()?.scale *= if is_large { 1.0 / g } else { g };
                self.motion.begin_again();
            }
            Hypothesis::Hitched
            | Hypothesis::Offset(_)
            | Hypothesis::Strut(_)
            | Hypothesis::Several => return None,
        }
        Some(())
    }

    fn change_calibrations(&mut self, mut change: impl FnMut(&mut Resolved)) {
        change(&mut self.calibration);
        change(&mut self.unloaded_calibration);
    }

    fn change_channel(&mut self, at: usize, mut change: impl FnMut(&mut Channel)) {
        let (wheel, channel) = channel_of(at);
        self.change_calibrations(|c| change(&mut c.corners.0[wheel].strain[channel.index()]));
    }

    /// Shifts the zero of an axial channel whose reading is too large by `by_n`.
    fn shift_zero(&mut self, at: usize, by_n: f64, sigma_n: f64) {
        self.change_channel(at, |channel| {
            channel.offset_counts += by_n / channel.gain;
            channel.offset_sigma = sigma_n;
        });
    }

    fn turn_imu(&mut self, turn: Matrix3<f64>) {
        self.change_calibrations(|c| c.body_from_imu = turn * c.body_from_imu);
        self.motion.begin_again();
    }

    fn place_antennas(&mut self) {
        let c = &self.calibration;
        let antennas = [c.velocity_antenna_m, c.attitude_antenna_m];
        self.motion.place(c.imu_m, antennas);
    }

    /// Puts the load on the vehicle that the drive has shown, beside what it has shown before.
    fn add_payload(&mut self, judged: &Judged) -> Option<()> {
        let body = &self.vehicle.body;
        let [mass_kg, moments @ ..] = [0, 1, 2, 3].map(|i| judged.value[i]);
        let [x, y, z] = moments.map(|moment| moment / mass_kg);
        let new = MassProperties {
            mass_kg,
            cg_m: [
                x - body.front_axle_to_cg_m,
                y + body.cg_y_m,
                (z + body.cg_height_m).max(0.0),
            ],
            moments_kg_m2: [0.0; 3],
            products_kg_m2: [0.0; 3],
        };
        let before = self.unloaded.payload.clone();
        let payloads = &mut self.unloaded.payload;
        let known = payloads
            .iter()
            .position(|payload| payload.name == FOUND_PAYLOAD);
        let all = match known {
            Some(k) => new.with(&payloads.remove(k).mass_properties()),
            None => new,
        };
        payloads.push(Payload {
            name: FOUND_PAYLOAD.to_owned(),
            mass_kg: all.mass_kg,
            position_m: all.cg_m,
            inertia_kg_m2: [0.0; 3],
        });
        let mut names = self.payload.clone();
        if known.is_none() {
            names.push(FOUND_PAYLOAD.to_owned());
            names.sort();
        }
        let put = self.put_on(names);
        if put.is_err() {
            self.unloaded.payload = before;
        }
        put.ok()
    }

    /// Starts the force filter and the search again after a correction.
    fn begin_again(&mut self) {
        let (Some(fusion), Some(watch)) = (&mut self.fusion, &mut self.mistakes) else {
            return;
        };
        fusion.begin_again(&self.calibration.corners);
        let setup: Setup = fusion.mistake_setup(&self.vehicle, &self.sensors, &self.calibration);
        Arc::make_mut(&mut watch.evidence).restart(setup);
        watch.units.restart();
        watch.suspected = None;
    }
}
