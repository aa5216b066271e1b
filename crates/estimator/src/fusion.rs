//! The force filter: one Kalman filter over the forces of four tyres, measured by strain channels,
//! by struts, and by the inertial unit through the balances of forces and moments.
//!
//! | states | content | frame, unit |
//! |---|---|---|
//! | [`layout::FORCE`] | F_x, F_y, F_z of each tyre | wheel-carrier frame, N |
//! | [`layout::RATE`] | their rates; of F_z what the wheel's travel does not explain | N/s |
//! | [`layout::MOMENT`] | M_x, M_z of each tyre beyond tread and trail | wheel-carrier frame, N m |
//! | [`layout::SPEED`], [`layout::LENGTH`] | rate and length of each strut | mm/s, mm |
//! | [`layout::STRUT`] | error of each strut's force | N |
//! | [`layout::TORQUE`] | moment of the wheels on their spindles, front and rear: mean and half the difference | N m |
//! | [`layout::BODY_RATE`] | angular rate of the body | body axes, rad/s |
//! | [`layout::ACCEL_BIAS`] | remaining accelerometer bias | body axes, m/s^2 |
//! | [`layout::OFFSET`] | offset of each axial strain channel | N |
//! | [`layout::LENGTH_ERROR`] | strut length less the potentiometer's reading | mm |
//! | [`layout::BETWEEN`] | mean load since the step before, less that of the line between | N |
//! | [`layout::ROAD`] | rate at which the road presses each tyre | N/s |
//! | [`layout::BEFORE`], [`layout::LAGGED`] | the forces one and two steps before | N |
//! | [`layout::HUB_BIAS`] | remaining bias of each hub accelerometer | m/s^2 |
//!
//! The unsprung masses accelerate. The row of the strut in a corner's statics ties the strut's
//! acceleration to its force and to the tyre's, so that l'' needs no state:
//!
//! l'' = (F_s(l, l') + e - A_6 F - B_6 M - c_6)/(dF_6/dl'')
//!
//! A member's force is then A F + B M + c + (dF/dl'') l'', from [`CornerStatics`]. The tyre is a spring
//! that the wheel's travel presses, on a road whose height is a random walk, smoothed by the contact. The moments of all tyres about
//! the centre of gravity turn the body:
//!
//! I w' = sum(r_i x R_i F_i + R_i M_i) - (moments of the unsprung masses against the body) - w x (I w + h) - h'
//!
//! with the wheels' spin momentum h. The forces of one and two steps before are states: readings are older
//! than the step, and the forces of two steps before are the estimate with a lag.
//!
//! Every equation is linear in the states, because geometry, attitude and inertia forces come from
//! the motion filter; no iteration is needed. Measurements are scalars. Rows with common states share the passes over the covariance (`fusion/joint.rs`). The
//! covariance is a full symmetric matrix: a square root of 122 states would cost more than the step
//! may take, and the states are scaled so that the condition number is small for doubles.

mod body;
mod channel;
mod corner;
mod covariance;
mod force_noise;
mod forms;
mod inertial;
mod joint;
mod lag;
mod latency;
pub mod layout;
mod lengths;
mod live_axle;
mod matrix;
mod moments;
mod process;
mod propagation;
mod recording;
pub mod relations;
mod transition;

use model::sensors::StrainChain;
use model::suspension::CornerStatics;
use model::vehicle::Vehicle;
use nalgebra::{Matrix3, Vector3};
use sample::{
    ForceSource, InnovationKind, LogTime, PerWheel, StrainChannel, TyreForce, Wheel, WheelAxes,
};

use crate::calibration::{CornerChannels, HubSensor};
use crate::corners::{CornerState, LiveAxleState};
use crate::feedback::{BodyMotionEstimate, StrutEstimate};
use crate::gaussian::{Gaussian, within};
use crate::innovation::InnovationTally;
use crate::inputs::Readings;
use crate::motion::MotionState;
use crate::process_noise::ProcessNoise;
use crate::triads::{Triads, UsedAxes};
use crate::tuning::{FusionTuning, ProcessNoiseTuning, Tuning};

use body::Body;
use channel::{Change, ChannelHealth};
use covariance::Covariance;
use force_noise::ForceNoise;
use forms::CornerForms;
use inertial::Balance;
use joint::Joint;
use lag::Lag;
use latency::Latencies;
use layout::{
    ACCEL_BIAS, BEFORE, BODY_RATE, FORCE, HUB_BIAS, LAGGED, LENGTH, MOMENT, RATE, SIZE, SPEED,
    State, TORQUE,
};
use lengths::LengthWatch;
use live_axle::AxleForms;
use moments::KnownMoment;
use process::{accel_noise, tipping_noise, torque_noise};
pub use recording::{FusionTrace, OUTPUTS};
use relations::{Loads, RelationWindow};

/// Axes of the moments that are states.
const MOMENT_AXES: [usize; 2] = [0, 2];

/// The filter.
#[derive(Clone, Debug)]
pub struct Fusion {
    tuning: FusionTuning,
    process_noise: ProcessNoiseTuning,
    state: State,
    covariance: Box<Covariance>,
    body: Body,
    lag_s: f64,
    bending_distance_m: f64,
    health: [[ChannelHealth; StrainChannel::COUNT]; 4],
    force_noise: ForceNoise,
    torque: [ProcessNoise<2>; 2],
    accel: ProcessNoise<3>,
    /// Of each tyre's M_x.
    tipping: ProcessNoise<4>,
    lengths: [LengthWatch; 4],
    /// Consecutive innovations of each potentiometer that no strut makes.
    jumps: [u32; 4],
    /// Potentiometers that have jumped in this step.
    suspected: [bool; 4],
    /// Potentiometers with a reading in this step.
    length_measured: [bool; 4],
    strain_lag: [[Lag; StrainChannel::COUNT]; 4],
    hub_lag: [[Lag; 3]; 4],
    hubs: [Option<HubSensor>; 4],
    /// Wheels of a live axle.
    live: [bool; 4],
    /// Part of the unsprung parts of each corner between the gauges of its matrix and the road.
    outboard_parts: [f64; 4],
    /// Standard deviations of the forces by the errors of the corners' matrices, N.
    matrix_sigma_n: [[f64; 3]; 4],
    /// Length, m, and rate, m/s, of each strut at the next step.
    moved: [[f64; 2]; 4],
    body_motion: Option<BodyMotionEstimate>,
    /// Acceleration of the body from the sum of all tyre forces, also while the inertial unit
    /// disagrees.
    ahead: BodyMotionEstimate,
    /// Its angular acceleration a step before, rad/s^2.
    rate_dot_before_rad_s2: Vector3<f64>,
    /// Consecutive readings of each gyro beyond the gate.
    gyro_rejections: [u32; 3],
    /// Variance of each accelerometer's expected reading, (m/s^2)^2.
    accel_variance: [f64; 3],
    /// Whether the inertial unit agreed with the balances in this step.
    agreed: bool,
    /// Whether stands or a jack carry a part of the weight.
    held: bool,
    blind: bool,
    /// Whether the vehicle moves: then the tyres alone carry it.
    rolling: bool,
    /// F_x of each tyre three steps before, N.
    earlier_n: [f64; 4],
    /// Second difference of each tyre's F_x, N.
    blow_n: [f64; 4],
    steps: u32,
    resets: u32,
    innovations: InnovationTally,
    /// What the errors of the parameters act on in the last step.
    loads: Loads,
    /// Relations since the last complete window, and whether the window is complete.
    relations: Option<Box<RelationWindow>>,
    related: bool,
    /// Steps of a window, and the largest age of a reading in it, s.
    window_steps: u32,
    related_age_s: f64,
    /// No channel is blamed alone: the configuration can be wrong.
    undecided: bool,
    latencies: Latencies,
}

/// Input of one step.
#[derive(Clone, Copy)]
pub struct StepInput<'a> {
    /// The instant.
    pub now: LogTime,
    /// Since the last one, s.
    pub dt: f64,
    /// A reading that is older is not used, s.
    pub fresh_s: f64,
    /// The corners' geometry.
    pub corners: &'a [CornerState; 4],
    /// Their maps between members and tyres a step before.
    pub statics_before: &'a [CornerStatics; 4],
    /// The body's motion.
    pub motion: &'a MotionState,
    /// Channels' calibration.
    pub channels: &'a PerWheel<CornerChannels>,
    /// What the vehicle model expects.
    pub expected: &'a PerWheel<TyreForce>,
    /// Inertial unit from the centre of gravity, m.
    pub imu_m: Vector3<f64>,
    /// Gyro noise, rad/s, and accelerometer noise, m/s^2.
    pub imu_sigma: [f64; 2],
    /// Message of the inertial unit, if its latency is not known.
    pub imu_stream: Option<u8>,
    /// Axes of the inertial unit that are used.
    pub used: UsedAxes,
    /// A live axle now and a step before.
    pub axle: Option<&'a [LiveAxleState; 2]>,
    /// Roll and pitch rate of the body over the ground, rad/s, in place of gyros that are not used.
    pub turn_over_ground: Option<[f64; 2]>,
    /// Standard deviation of the ground's normal at a wheel, rad.
    pub tilt_rad: f64,
}

/// Change of a channel between good and faulty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelChange {
    /// Wheel, by index.
    pub wheel: usize,
    /// Which strain channel; none for the potentiometer.
    pub channel: Option<StrainChannel>,
    /// Faulty from now on.
    pub faulty: bool,
}

/// States whose corrections adapt the process noise.
struct Adapting {
    rates: [Gaussian; 12],
    forces: [Gaussian; 12],
    /// Mean and half the difference of left and right.
    torques: [[Gaussian; 2]; 2],
    accels: [Gaussian; 3],
    moments: [Gaussian; 8],
}

/// The equations of one step.
struct StepModel {
    /// The tyres' moments that belong to the forces of the last step.
    known: [KnownMoment; 4],
    forms: [CornerForms; 4],
    /// Of a live axle.
    axle: Option<AxleForms>,
    balance: Balance,
}

/// Axes of the wheel-carrier frame, vehicle axes.
fn carrier(corner: &CornerState) -> Matrix3<f64> {
    let axes = WheelAxes::carrier(corner.pose.spindle.into());
    Matrix3::from_fn(|row, column| axes.rows()[column][row])
}

/// Forces of the tyres, wheel-carrier frame, by one step.
#[derive(Clone, Copy, Debug)]
pub struct Forces {
    /// At the instant.
    pub now: PerWheel<TyreForce>,
    /// Two steps before, by what was measured since.
    pub lagged: PerWheel<TyreForce>,
}

impl Fusion {
    /// A filter without readings.
    #[must_use]
    pub fn new(
        vehicle: &Vehicle,
        strain: &StrainChain,
        channels: &PerWheel<CornerChannels>,
        hubs: &PerWheel<Option<HubSensor>>,
        tuning: &Tuning,
    ) -> Self {
        let (t, process_noise) = (&tuning.fusion, tuning.process_noise);
        let mut fusion = Self {
            tuning: *t,
            process_noise,
            state: [0.0; SIZE],
            covariance: Box::default(),
            body: Body::new(vehicle),
            lag_s: corner::time_constant_s(strain.lag_hz),
            bending_distance_m: strain
                .bending
                .as_ref()
                .map_or(0.0, |coast| coast.distance_from_ball_joint_m),
            health: [[ChannelHealth::default(); StrainChannel::COUNT]; 4],
            force_noise: ForceNoise::new(t.force_noise, process_noise),
            torque: torque_noise(t, process_noise),
            accel: accel_noise(t, process_noise),
            tipping: tipping_noise(t, process_noise),
            lengths: [LengthWatch::default(); 4],
            jumps: [0; 4],
            suspected: [false; 4],
            length_measured: [false; 4],
            strain_lag: Default::default(),
            hub_lag: Default::default(),
            hubs: std::array::from_fn(|wheel| {
                let is_live = vehicle.axle(Wheel::ALL[wheel]).is_solid();
                hubs.0[wheel].filter(|_| !is_live)
            }),
            live: Wheel::ALL.map(|wheel| vehicle.axle(wheel).is_solid()),
            outboard_parts: matrix::outboard_parts(vehicle, channels),
            matrix_sigma_n: [[0.0; 3]; 4],
            moved: [[0.0; 2]; 4],
            body_motion: None,
            ahead: BodyMotionEstimate::default(),
            rate_dot_before_rad_s2: Vector3::zeros(),
            gyro_rejections: [0; 3],
            accel_variance: [0.0; 3],
            agreed: false,
            held: false,
            blind: false,
            rolling: false,
            earlier_n: [0.0; 4],
            blow_n: [0.0; 4],
            steps: 0,
            resets: 0,
            innovations: InnovationTally::default(),
            loads: Loads::default(),
            relations: Some(Box::default()),
            related: false,
            undecided: false,
            latencies: Latencies::default(),
            related_age_s: tuning.mistakes.age_max_s,
            window_steps: (tuning.mistakes.window_s / crate::grid::GRID_S).round() as u32,
        };
        if fusion.hubs.iter().all(Option::is_none) {
            fusion.covariance.leave_out_from(HUB_BIAS);
        }
        fusion.restart(channels);
        fusion
    }

    /// Number of restarts.
    #[must_use]
    pub fn resets(&self) -> u32 {
        self.resets
    }

    fn restart(&mut self, channels: &PerWheel<CornerChannels>) {
        self.state = [0.0; SIZE];
        self.steps = 0;
        self.lengths = [LengthWatch::default(); 4];
        self.force_noise = ForceNoise::new(self.tuning.force_noise, self.process_noise);
        self.torque = torque_noise(&self.tuning, self.process_noise);
        self.accel = accel_noise(&self.tuning, self.process_noise);
        self.tipping = tipping_noise(&self.tuning, self.process_noise);
        for (wheel, load) in self.body.static_load.into_iter().enumerate() {
            self.state[FORCE + 3 * wheel + 2] = load;
        }
        self.forget(channels);
    }

    /// Starts again with channels that were corrected.
    pub(crate) fn begin_again(&mut self, channels: &PerWheel<CornerChannels>) {
        self.health = Default::default();
        self.restart(channels);
    }

    /// Whether a fault of a strain channel has begun by a leap of its readings and lasts.
    pub(crate) fn has_leapt(&self) -> bool {
        let mut all = self.health.as_flattened().iter();
        all.any(ChannelHealth::has_leapt)
    }

    /// Whether no channel is blamed alone.
    pub(crate) fn hold_blame(&mut self, hold: bool) {
        self.undecided = hold;
    }

    /// The same filter of a vehicle whose mass properties have changed.
    pub fn load(&mut self, vehicle: &Vehicle) {
        self.body = Body::new(vehicle);
    }

    /// One step: propagates the state by `dt`, then takes every new reading.
    pub fn step(
        &mut self,
        input: &StepInput<'_>,
        readings: &mut Readings,
        changes: &mut impl FnMut(ChannelChange),
    ) -> Forces {
        if self.steps == 0 || self.steps == self.tuning.settling_steps / 2 {
            // The first steps used struts and poses that had not settled.
            self.place(input);
            self.forget(input.channels);
        }
        let model = self.model(input);
        self.earlier_n = std::array::from_fn(|wheel| self.state[LAGGED + 3 * wheel]);
        self.force_noise.drive(input.motion.velocity_m_s.x);
        self.relate(input, &model, readings);
        self.predict(input, &model);
        let before = self.adapting();
        let has_agreed = std::mem::replace(&mut self.agreed, false);
        let inertial = input.motion.inertial && !self.settling();
        if inertial {
            self.take_inertial(input, &model, has_agreed);
        }
        self.blind = false;
        self.length_measured = [false; 4];
        let of_axle = model.axle.as_ref().map(|axle| axle.wheels);
        for wheel in 0..4 {
            if of_axle.is_none_or(|wheels| !wheels.contains(&wheel)) {
                self.take_corner(input, &model, wheel, readings, changes);
            }
        }
        if let Some(axle) = &model.axle {
            self.take_axle(input, axle, readings, changes);
        }
        for wheel in 0..4 {
            if std::mem::take(&mut self.suspected[wheel]) {
                self.suspect_length(wheel);
            }
        }
        if !self.settling() {
            self.learn_noise(&before);
        }
        self.fold_latencies();
        self.watch_lengths(input.channels, changes);
        if !self.sound() {
            self.resets += 1;
            self.restart(input.channels);
            self.place(input);
        }
        // On jackstands the tyre forces are not the only ones that move the body.
        self.rolling = input.motion.velocity_m_s.x.abs() > self.tuning.rolling_speed_m_s;
        let alone = !input.motion.inertial && self.rolling;
        self.rate_dot_before_rad_s2 = self.ahead.rate_dot_rad_s2;
        self.ahead = self.body_motion_ahead(&model.balance);
        self.body_motion = (alone && !self.settling()).then_some(self.ahead);
        for wheel in 0..4 {
            self.moved[wheel] = self.strut_ahead(&model, wheel, input.dt);
        }
        self.learn_blows();
        self.matrix_sigma_n = std::array::from_fn(|wheel| {
            self.matrix_sigma_n(input, wheel, &model.known[wheel].moment_n_m)
        });
        self.steps = self.steps.saturating_add(1);
        Forces {
            now: self.forces(FORCE, self.blow_n),
            lagged: self.forces(LAGGED, self.lagged_blow_n()),
        }
    }

    /// The states whose corrections adapt the process noise.
    fn adapting(&self) -> Adapting {
        Adapting {
            rates: self.estimates(RATE),
            forces: self.estimates(FORCE),
            torques: [0, 2].map(|part| self.estimates(TORQUE + part)),
            accels: self.estimates(ACCEL_BIAS),
            moments: self.estimates(MOMENT),
        }
    }

    /// Adapts the process noise to the corrections of the step, from the states before them.
    fn learn_noise(&mut self, before: &Adapting) {
        let after = self.adapting();
        let forces = corrections(&before.forces, &after.forces);
        self.force_noise.learn(
            corrections(&before.rates, &after.rates),
            self.length_measured,
            std::array::from_fn(|wheel| forces[3 * wheel + 2]),
        );
        for (part, torque) in self.torque.iter_mut().enumerate() {
            torque.learn(corrections(&before.torques[part], &after.torques[part]));
        }
        let moments = corrections(&before.moments, &after.moments);
        self.tipping
            .learn(std::array::from_fn(|wheel| moments[2 * wheel]));
        self.accel.learn(corrections(&before.accels, &after.accels));
    }

    /// The equations of the step, linear in the states.
    fn model(&self, input: &StepInput<'_>) -> StepModel {
        let speed_m_s = input.motion.velocity_m_s.x;
        let known =
            std::array::from_fn(|wheel| self.known_moment(wheel, &input.corners[wheel], speed_m_s));
        let mut forms =
            std::array::from_fn(|wheel| self.forms(input, wheel, &known[wheel].moment_n_m));
        let axle = self.axle_forms(input, &known, &forms);
        if let Some(axle) = &axle {
            axle.couple(&mut forms);
        }
        StepModel {
            balance: self.balance(input, &known, &forms),
            known,
            forms,
            axle,
        }
    }

    /// Sets the struts to where the linkages stand.
    fn place(&mut self, input: &StepInput<'_>) {
        for (wheel, corner) in input.corners.iter().enumerate() {
            self.state[LENGTH + wheel] = 1e3 * corner.pose.strut_length_m;
            self.state[SPEED + wheel] = 0.0;
        }
    }

    /// Length, m, and rate, m/s, of a strut `dt` ahead.
    fn strut_ahead(&self, model: &StepModel, wheel: usize, dt: f64) -> [f64; 2] {
        let acceleration = model.forms[wheel].acceleration_m_s2(wheel, &self.state);
        let [length, rate] = [LENGTH, SPEED].map(|at| 1e-3 * self.state[at + wheel]);
        [
            length + dt * (rate + 0.5 * dt * acceleration),
            rate + dt * acceleration,
        ]
    }

    /// Estimates of `N` states from `first` on.
    fn estimates<const N: usize>(&self, first: usize) -> [Gaussian; N] {
        std::array::from_fn(|i| {
            Gaussian::new(self.state[first + i], self.covariance.variance(first + i))
        })
    }

    fn settling(&self) -> bool {
        self.steps < self.tuning.settling_steps
    }

    /// Whether all numbers are finite, no variance is negative, and the angular rate is possible.
    fn sound(&self) -> bool {
        let finite = self.state.iter().all(|x| x.abs() < 1e8);
        let turn = &self.state[BODY_RATE..BODY_RATE + 3];
        finite
            && turn
                .iter()
                .all(|rate| rate.abs() < self.tuning.body_rate_max_rad_s)
            && self.covariance.sound()
    }

    /// Second difference of each tyre's F_x over the last three steps, N, without its sign. A larger one of
    /// the last tenth of a second counts in part: blows follow each other.
    fn learn_blows(&mut self) {
        for (wheel, blow_n) in self.blow_n.iter_mut().enumerate() {
            let [now, before, earlier] =
                [FORCE, BEFORE, LAGGED].map(|at| self.state[at + 3 * wheel]);
            let bend_n = (now - 2.0 * before + earlier).abs();
            *blow_n = bend_n.max(self.tuning.members.blow_keep * *blow_n);
        }
    }

    /// The larger of the second differences around the forces of two steps before and one step later, N.
    fn lagged_blow_n(&self) -> [f64; 4] {
        std::array::from_fn(|wheel| {
            let [now, before, lagged] =
                [FORCE, BEFORE, LAGGED].map(|at| self.state[at + 3 * wheel]);
            let later = now - 2.0 * before + lagged;
            let around = before - 2.0 * lagged + self.earlier_n[wheel];
            later.abs().max(around.abs())
        })
    }

    /// Forces of all tyres at a place of the state. A blow along the wheel that begins and ends within the time
    /// between two readings shows as a large second difference of F_x. The readings do not tell its course:
    /// its standard deviation grows.
    fn forces(&self, first: usize, blow_n: [f64; 4]) -> PerWheel<TyreForce> {
        let t = self.tuning.members;
        PerWheel(std::array::from_fn(|wheel| {
            let at = |axis: usize| first + 3 * wheel + axis;
            let resolved_n = t.blow_part * self.body.static_load[wheel];
            let unknown_n = t.blow_sigma * (blow_n[wheel] - resolved_n).max(0.0);
            TyreForce {
                force_n: std::array::from_fn(|axis| self.state[at(axis)]),
                sigma_n: std::array::from_fn(|axis| {
                    let variance = self.covariance.variance(at(axis)).max(0.0);
                    let of_matrix_n = self.matrix_sigma_n[wheel][axis];
                    (variance
                        + of_matrix_n * of_matrix_n
                        + self.latencies.state_variance(at(axis))
                        + if axis == 0 {
                            unknown_n * unknown_n
                        } else {
                            0.0
                        })
                    .sqrt()
                }),
                source: ForceSource::Fusion,
                ..TyreForce::default()
            }
        }))
    }

    /// Angular rate of the body, rad/s, from gyros and balance of moments.
    #[must_use]
    pub fn rate_rad_s(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.state[BODY_RATE + axis])
    }

    /// Expected reading of each axis of the inertial unit `ahead_s` after the last step, from the
    /// balances. Rates, rad/s: `None` before the filter has settled. Specific forces, m/s^2: also
    /// `None` for a vehicle that stands, since stands or a jack can carry it.
    #[must_use]
    pub fn expected_reading(
        &self,
        ahead_s: f64,
        imu_m: Vector3<f64>,
    ) -> Triads<Option<[Gaussian; 3]>> {
        let BodyMotionEstimate {
            specific_force_m_s2: force,
            rate_dot_rad_s2: turn_dot,
        } = self.ahead;
        let rate = std::array::from_fn(|axis| {
            let noise = self.tuning.moment_noise_n_m[axis] * self.body.inverse[(axis, axis)];
            Gaussian::new(
                self.state[BODY_RATE + axis] + ahead_s * turn_dot[axis],
                self.covariance.variance(BODY_RATE + axis) + noise * noise * ahead_s.abs(),
            )
        });
        let turn = Vector3::from(self.rate_rad_s());
        let swing = turn_dot.cross(&imu_m) + turn.cross(&turn.cross(&imu_m));
        let at_unit = force + swing;
        let force = std::array::from_fn(|axis| {
            let residue = self.state[ACCEL_BIAS + axis];
            Gaussian::new(at_unit[axis] + residue, self.accel_variance[axis])
        });
        Triads {
            rate: (!self.settling()).then_some(rate),
            force: (!self.settling() && self.rolling).then_some(force),
        }
    }

    /// Whether accelerometers and gyros agreed with the balances in the last step, with strain at
    /// all corners and without a sudden drive or brake force.
    #[must_use]
    pub fn imu_agrees(&self) -> bool {
        self.agreed && !self.blind
    }

    /// Estimate of a wheel's strut beside its potentiometer.
    #[must_use]
    pub fn strut(&self, wheel: usize) -> StrutEstimate {
        StrutEstimate {
            moved: (!self.settling()).then_some(self.moved[wheel]),
        }
    }

    /// Length of a wheel's strut, m; `None` before the filter has settled.
    #[must_use]
    pub fn strut_length_m(&self, wheel: usize) -> Option<f64> {
        (!self.settling()).then_some(1e-3 * self.state[LENGTH + wheel])
    }

    /// Acceleration of the body at the next step, from the sum of all tyre forces. `None` while the
    /// inertial unit is silent or contradicts the forces, as on jackstands.
    #[must_use]
    pub fn body_motion(&self) -> Option<BodyMotionEstimate> {
        self.body_motion
    }

    /// Angular acceleration of the body at the next step from the balances of moments of the last two steps, body
    /// axes, rad/s^2. `None` where the vehicle can be held, where a corner's strain is missing, and where the inertial unit
    /// did not agree with the balances.
    #[must_use]
    pub fn rate_dot_rad_s2(&self) -> Option<Vector3<f64>> {
        let is_known = self.rolling && self.imu_agrees() && !self.settling();
        let now = self.ahead.rate_dot_rad_s2;
        is_known.then(|| now + self.tuning.turn_ahead * (now - self.rate_dot_before_rad_s2))
    }

    /// Innovations since they were last reported.
    pub(crate) fn innovations(&mut self) -> &mut InnovationTally {
        &mut self.innovations
    }

    /// Density of the white noise of the loads at 10 m/s, mean of the wheels, N^2/s: how rough the ground is.
    #[must_use]
    pub fn roughness(&self) -> f64 {
        self.force_noise.roughness()
    }

    /// Takes a row's value unless its innovation is beyond the gate (standard deviations). Returns
    /// the normalised innovation.
    fn take(&self, joint: &mut Joint, m: usize, value: f64, variance: f64, gate: f64) -> f64 {
        let total = joint.variance(m) + variance;
        let innovation = value - joint.value(m);
        if self.settling() || within(gate, innovation, total) {
            joint.take(m, value, total);
        }
        innovation / total.sqrt()
    }

    /// Counts a normalised innovation after the filter has settled.
    fn count(&mut self, kind: InnovationKind, innovation: f64, gate: f64) {
        if self.settling() {
            return;
        }
        if within(gate, innovation, 1.0) {
            self.innovations.used(kind, innovation * innovation);
        } else {
            self.innovations.rejected(kind);
        }
    }
}

/// Normalised corrections by the measurements of one step. The variance of a correction is what the
/// measurements took from the state's variance, P- - P+.
fn corrections<const N: usize>(before: &[Gaussian; N], after: &[Gaussian; N]) -> [f64; N] {
    std::array::from_fn(|i| {
        let taken = before[i].variance - after[i].variance;
        (after[i].mean - before[i].mean) / taken.max(f64::MIN_POSITIVE).sqrt()
    })
}
