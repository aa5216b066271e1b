//! The estimator: samples in, estimates out.

mod aiding;
mod balances;
mod choice;
mod events;
mod lagged;
mod latency;
mod limits;
mod mistakes;
mod monitors;
mod payload;
mod placement;
mod pressure;
mod road;
mod sensors;
mod stages;
mod temperature;
mod terrain;

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{
    Estimate, Event, Limits, LogTime, Measurement, NANOS_PER_SECOND, Parameters, PerWheel, Road,
    Sample, SourceId, Terrain,
};

use crate::calibration::Resolved;
use crate::corners::Corners;
use crate::expected::ExpectedForces;
use crate::feedback::EstimatorFeedback;
use crate::fusion::Fusion;
use crate::grid::grid;
use crate::grip::Grip;
use crate::inertial_forces::InertialForces;
use crate::innovation::InnovationTally;
use crate::inputs::{Readings, Stamp};
use crate::lift::LiftDetector;
use crate::limits::LimitsEstimator;
use crate::motion::{ACCEL_BIAS, GYRO_BIAS, MotionFilter, MotionSettings, VelocityReceiver};
use crate::planar::Planar;
use crate::road::{RoadEstimator, SlopeFilter};
use crate::smoother::Step;
use crate::steering_column::SteeringColumn;
use crate::terrain::TerrainEstimator;
use crate::tuning::Tuning;
use crate::waiting::{Held, Waiting};
use crate::{Calibration, EstimatorError, Input, Method, Settings};

pub(crate) use lagged::LAG_STEPS;
pub use latency::{LATENCIES_MAX, LatencyEstimate, LatencyPrior};
pub use mistakes::{CalibrationChanges, FoundMistake, MistakeReport, ParameterErrors};
pub use placement::WheelPlacement;

use choice::MotionChoice;
use events::Divergence;
use lagged::Past;
use mistakes::MistakeWatch;
use monitors::ConsistencyMonitors;
use pressure::TyrePressures;
use stages::MeasuredForces;
use temperature::BridgeTemperatures;

/// Spacing of the instants that have parameters, ns.
const PARAMETERS_NANOS: u64 = NANOS_PER_SECOND as u64;

/// Output of the estimator.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// The estimate of one instant of the grid.
    Estimate(Estimate),
    /// The estimate of two steps before, with what was measured since, after the estimate of an
    /// instant.
    Lagged(Estimate),
    /// The road at one instant, before the estimate of the instant.
    Road(Road),
    /// The road two steps before, with the loads that were measured since.
    LaggedRoad(Road),
    /// What the vehicle can still do, at each tenth of a second of the log clock, before the estimate of the instant, for
    /// vehicles with the force filter.
    Limits(Limits),
    /// The kind of ground, at each tenth of a second of the log clock, after the limits.
    Terrain(Terrain),
    /// Estimated parameters, at each full second of the log clock, after the estimate.
    Parameters(Parameters),
    /// An event.
    Event(Event),
    /// The same instant for a [`Smoother`](crate::smoother::Smoother); only after
    /// [`Estimator::traced`].
    Step(Box<Step>),
}

/// Forces and motion of one vehicle from its samples.
///
/// For each arrival, call [`advance`](Self::advance) with its log time, then
/// [`push`](Self::push) with each sample that was decoded from it. Clock ticks call `advance` too,
/// so that estimates continue while sensors are silent.
#[derive(Clone, Debug)]
pub struct Estimator {
    vehicle: Vehicle,
    calibration: Resolved,
    /// Vehicle and calibration without payload.
    unloaded: Vehicle,
    unloaded_calibration: Resolved,
    temperatures: BridgeTemperatures,
    pressures: TyrePressures,
    /// Payloads on the vehicle.
    payload: Vec<String>,
    sensors: Sensors,
    settings: Settings,
    next_grid: Option<LogTime>,
    waiting: Waiting,
    /// Messages whose latencies are not known.
    latencies: Vec<LatencyPrior>,
    /// That of the last inertial reading.
    imu_stream: Option<u8>,
    /// The source of GNSS attitude, after its first value.
    attitude_source: Option<SourceId>,
    column: SteeringColumn,
    readings: Readings,
    motion: MotionFilter,
    monitors: ConsistencyMonitors,
    corners: Option<Corners>,
    fusion: Option<Fusion>,
    mistakes: Option<MistakeWatch>,
    expected: ExpectedForces,
    lift: LiftDetector,
    grip: Grip,
    road: Option<RoadEstimator>,
    slope: SlopeFilter,
    limits: Option<LimitsEstimator>,
    terrain: TerrainEstimator,
    /// Longitudinal slips of the last step.
    slip_before: [f64; 4],
    planar: Option<Planar>,
    /// Forces without sensors on the suspension.
    inertial_forces: InertialForces,
    /// Time of the first step.
    started: Option<LogTime>,
    /// Results of the last step for the next.
    feedback: EstimatorFeedback,
    /// Time of the last start of the motion filter.
    moving_since: Option<LogTime>,
    /// Since when tyre slip gives the sideslip.
    blind_since: Option<LogTime>,
    /// Choice between the inertial navigation and the single-track filter.
    choice: MotionChoice,
    /// Divergence of motion, forces and sideslip.
    divergences: [Divergence; 3],
    /// Standard deviations of gyros, rad/s, and accelerometers, m/s².
    imu_sigma: [f64; 2],
    /// Estimates of the last steps.
    past: Past,
    traced: bool,
}

impl Estimator {
    /// An estimator without any sample.
    ///
    /// # Errors
    /// The calibration belongs to another vehicle, or contains a value that cannot be used.
    pub fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        calibration: &Calibration,
        settings: Settings,
    ) -> Result<Self, EstimatorError> {
        if calibration.vehicle != vehicle.name {
            return Err(EstimatorError::OtherVehicle {
                expected: vehicle.name.clone(),
                found: calibration.vehicle.clone(),
            });
        }
        let mut unloaded = calibration.applied(vehicle);
        if sensors.steer_potentiometers.is_some() {
            // The play is between the steering wheel and the rack, and the rods are behind the rack.
            unloaded.steering.lash_rad = 0.0;
        }
        let loaded = unloaded.loaded(&settings.payload)?;
        let vehicle = &loaded.vehicle;
        let unloaded_calibration = Resolved::new(sensors, calibration)?;
        let calibration = unloaded_calibration.with_cg_moved(loaded.cg_shift_m);
        let t = &settings.tuning;
        let mut corners = Corners::new(vehicle, &calibration.corners, t)?;
        let fuses = settings.method == Method::Fusion;
        if fuses {
            corners = corners.map(|corners| corners.on_paths(&calibration.hubs));
        }
        let fusion = (fuses && corners.is_some()).then(|| {
            let (channels, hubs) = (&calibration.corners, &calibration.hubs);
            Fusion::new(vehicle, &sensors.strain, channels, hubs, t)
        });
        Ok(Self {
            mistakes: fusion
                .as_ref()
                .map(|fusion| MistakeWatch::new(fusion, vehicle, sensors, &calibration, t)),
            motion: MotionFilter::new(motion_settings(sensors, &calibration, t), &t.motion),
            planar: corners
                .is_none()
                .then(|| Planar::new(vehicle, sensors, &calibration, t))
                .transpose()?,
            inertial_forces: {
                let sigma = sensors.imu.gyro_noise_rad_s;
                InertialForces::new(vehicle, &calibration, sigma, &t.inertial_forces)
            },
            started: None,
            divergences: ["motion", "force", "sideslip"]
                .map(|name| Divergence::new(name, t.recovery_s)),
            monitors: ConsistencyMonitors::new(&t.watch),
            corners,
            expected: ExpectedForces::new(vehicle, &t.expected),
            grip: Grip::new(vehicle, &t.grip),
            road: fusion
                .is_some()
                .then(|| RoadEstimator::new(vehicle, &t.road)),
            slope: SlopeFilter::default(),
            limits: fusion
                .is_some()
                .then(|| LimitsEstimator::new(vehicle, settings.curve_radius_m, &t.limits)),
            slip_before: [f64::NAN; 4],
            terrain: TerrainEstimator::new(vehicle, &t.terrain),
            fusion,
            feedback: EstimatorFeedback::default(),
            moving_since: None,
            blind_since: None,
            choice: MotionChoice::default(),
            lift: LiftDetector::new(
                PerWheel::from_fn(|wheel| vehicle.static_load_n(wheel)),
                &t.lift,
            ),
            imu_sigma: [
                sensors.imu.gyro_noise_rad_s.max(t.gyro_sigma_min_rad_s),
                sensors.imu.accel_noise_m_s2.max(t.accel_sigma_min_m_s2),
            ],
            vehicle: vehicle.clone(),
            unloaded,
            unloaded_calibration,
            temperatures: BridgeTemperatures::default(),
            pressures: TyrePressures::new(&t.pressure),
            payload: {
                let mut names = settings.payload.clone();
                names.sort();
                names
            },
            sensors: sensors.clone(),
            calibration,
            settings,
            next_grid: None,
            waiting: Waiting::new(),
            latencies: Vec::new(),
            imu_stream: None,
            attitude_source: None,
            column: SteeringColumn::new(vehicle)?,
            readings: Readings::default(),
            past: Past::default(),
            traced: false,
        })
    }

    /// Hands out [`Output::Step`] with each estimate from now on.
    #[must_use]
    pub fn traced(mut self) -> Self {
        self.traced = true;
        self.motion.switch_trace_on();
        if let Some(fusion) = &mut self.fusion {
            fusion.switch_trace_on();
        }
        if let Some(planar) = &mut self.planar {
            planar.switch_trace_on();
        }
        self
    }

    /// Moves time to `now` and hands out the estimate of every grid instant up to 5 ms before it:
    /// measurements of an instant have arrived by then. Instants are multiples of
    /// [`GRID_NANOS`](crate::GRID_NANOS) on the log clock, the first at or after the first call's
    /// time.
    pub fn advance(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        for time in grid(&mut self.next_grid, now) {
            let (estimate, lagged) = self.step(time, out);
            out(Output::Estimate(estimate));
            if let Some(lagged) = lagged {
                out(Output::Lagged(lagged));
            }
            if time.0.is_multiple_of(PARAMETERS_NANOS) {
                out(Output::Parameters(self.parameters(time)));
            }
        }
    }

    /// Leaves out all instants before `now`: time has passed in which nothing was measured.
    pub fn skip_to(&mut self, now: LogTime) {
        let spacing = crate::GRID_NANOS;
        self.next_grid = Some(LogTime(now.0.div_ceil(spacing) * spacing));
    }

    /// Takes one sample. Samples that do not concern the estimator and values that no vehicle can
    /// have are ignored.
    pub fn push(&mut self, sample: &Sample) {
        self.push_of(sample, None);
    }

    /// As [`push`](Self::push) with a sample of a message whose latency is not known: its place among those of
    /// [`set_latencies`](Self::set_latencies).
    pub fn push_of(&mut self, sample: &Sample, message: Option<usize>) {
        if let Some(planar) = &mut self.planar {
            planar.push(sample, &self.calibration, &self.settings);
        }
        let message = message.filter(|at| *at < self.latencies.len());
        let valid = message.map_or(sample.valid_time, |at| {
            sample.valid_time.offset_seconds(-self.learnt(at).0)
        });
        let time = valid.min(sample.log_time);
        let stamp = |time| Stamp {
            time,
            // There are at most `LATENCIES_MAX`.
            stream: message.and_then(|at| u8::try_from(at).ok()),
        };
        let uses = |input| self.settings.uses(input);
        match &sample.measurement {
            Measurement::Imu(imu) if uses(Input::Imu) => self.push_imu(stamp(time), imu),
            Measurement::GnssVelocity(gnss) if uses(Input::GnssVelocity) => {
                let time = match self.velocity_receiver(sample.source) {
                    VelocityReceiver::Own => {
                        time.offset_seconds(-self.calibration.velocity_latency_s)
                    }
                    VelocityReceiver::OfAttitude => time,
                };
                self.waiting
                    .push(stamp(time), Held::Velocity(sample.source, *gnss));
            }
            Measurement::GnssAttitude(gnss) if uses(Input::GnssAttitude) => {
                let source = self.attitude_source.get_or_insert(sample.source);
                *source = (*source).min(sample.source);
                let time = time.offset_seconds(-self.calibration.attitude_latency_s);
                self.waiting.push(stamp(time), Held::Attitude(*gnss));
            }
            Measurement::Corner(corner) => self.waiting.push(stamp(time), Held::Corner(*corner)),
            Measurement::Steer(steer) if uses(Input::Steer) => {
                let angle = steer.steering_wheel_rad - self.calibration.steer_offset_rad;
                self.waiting.push(stamp(time), Held::SteeringWheel(angle));
            }
            Measurement::WheelSpeed(speeds) if uses(Input::WheelSpeed) => {
                let speeds = speeds.angular_speed_rad_s;
                self.waiting.push(stamp(time), Held::WheelSpeed(speeds));
            }
            Measurement::Control(control) => self.push_control(stamp(time), control),
            Measurement::HubAcceleration(hub) if uses(Input::HubAcceleration) => {
                self.waiting.push(stamp(time), Held::HubAcceleration(*hub));
            }
            _ => {}
        }
    }

    /// The same estimator without the inertia of the unsprung masses, see [`crate::simple`].
    pub(crate) fn without_unsprung_inertia(mut self) -> Self {
        if let Some(corners) = &mut self.corners {
            corners.neglect_unsprung_inertia();
        }
        self
    }

    /// One step of the grid, as a sequence of stages.
    fn step(
        &mut self,
        time: LogTime,
        out: &mut impl FnMut(Output),
    ) -> (Estimate, Option<Estimate>) {
        let settled = self.collect(time, out);
        let mut state = self.propagate(time);
        let planar = self.correct_planar(time, &mut state, out);
        let navigated = planar.is_none() && self.is_navigated(time);
        let steer_rad = self.place_corners(time, &state);
        let mut motion = self.describe_motion(&state, planar.as_ref(), navigated);
        let expected = self.expect_forces(time, &state, &motion, steer_rad);
        let MeasuredForces {
            contact: measured,
            reported,
            carrier,
            lagged,
            frames,
        } = self.find_forces(time, &state, planar.as_ref(), &expected, steer_rad, out);
        self.estimate_road(time, &state, &carrier, lagged.as_ref(), out);
        let steering_wheel = self.monitor(time, &state, &measured, settled, out);
        let rollover = self.detect_lift(time, &state, &measured, lagged.as_ref(), out);
        self.complete_motion(
            time,
            &mut motion,
            &state,
            &carrier,
            planar.as_ref(),
            steer_rad,
        );
        self.complete_wheels(time, &mut motion, &state, &carrier);
        if navigated && settled {
            self.learn_grip(time, &state, &motion, &measured, &reported, out);
        }
        self.watch_mistakes(time, out);
        self.find_limits(time, &motion, &measured, &rollover, settled, out);
        self.classify_terrain(time, &motion, &measured, settled, out);
        self.feedback = self.feed_back(measured, steering_wheel);
        let estimate = Estimate {
            time,
            motion,
            carrier,
            measured: reported,
            expected,
            rollover,
        };
        let lagged = self.past.pass(&estimate, frames.as_ref(), lagged.as_ref());
        self.trace(
            &estimate,
            frames,
            state.rate_dot_rad_s2,
            planar.is_none(),
            out,
        );
        (estimate, lagged)
    }

    fn parameters(&mut self, time: LogTime) -> Parameters {
        let mut none = InnovationTally::default();
        let beside = match (&mut self.fusion, &mut self.planar) {
            (Some(fusion), _) => fusion.innovations(),
            (None, Some(planar)) => &mut planar.innovations,
            (None, None) => &mut none,
        };
        let innovations = self.motion.innovations.report(beside);
        let (steer_offset_rad, steer_offset_sigma_rad) = self.grip.steer_offset();
        let mut parameters = Parameters {
            time,
            accel_bias_m_s2: self.motion.accel_bias().into(),
            accel_bias_sigma_m_s2: self.motion.sigma(ACCEL_BIAS),
            gyro_bias_rad_s: self.motion.gyro_bias().into(),
            gyro_bias_sigma_rad_s: self.motion.sigma(GYRO_BIAS),
            steer_offset_rad,
            steer_offset_sigma_rad,
            front: self.grip.axle(0, time),
            rear: self.grip.axle(1, time),
            innovations,
        };
        if let Some(planar) = self.planar.as_ref().filter(|_| !self.choice.navigates) {
            planar.write_offsets(&mut parameters);
        }
        parameters
    }

    /// Whether GNSS velocity and attitude are recent enough for the inertial navigation.
    fn is_navigated(&self, time: LogTime) -> bool {
        let t = &self.settings.tuning;
        self.motion.velocity_age_s(time) < t.gnss_silent_s
            && self.motion.attitude_age_s(time) < t.heading_silent_s
    }

    /// Steer angle of each wheel: from the linkages, else from sensors at the front wheels, else the steering
    /// wheel's angle over the steering ratio.
    fn steer_angles(&self, now: LogTime) -> [f64; 4] {
        if let Some(corners) = &self.corners {
            return std::array::from_fn(|i| corners.states()[i].pose.steer_rad());
        }
        let steering_wheel = self.readings.steering_wheel_rad.map_or(0.0, |r| r.value);
        let front = steering_wheel / self.vehicle.steering.ratio + self.feedback.steer_offset_rad;
        let fresh_s = self.settings.tuning.fresh_s;
        let [left, right] = self.readings.wheel_angle_rad.map(|held| {
            let measured = held.and_then(|reading| reading.fresh(now, fresh_s));
            measured.map_or(front, |angle| angle + self.feedback.steer_offset_rad)
        });
        [left, right, 0.0, 0.0]
    }
}

fn motion_settings(sensors: &Sensors, calibration: &Resolved, t: &Tuning) -> MotionSettings {
    let imu = &sensors.imu;
    MotionSettings {
        interval_s: 1.0 / imu.rate_hz.max(1.0),
        accel_sigma_m_s2: imu.accel_noise_m_s2.max(t.accel_sigma_min_m_s2),
        gyro_sigma_rad_s: imu.gyro_noise_rad_s.max(t.gyro_sigma_min_rad_s),
        accel_bias_sigma_m_s2: imu.accel_bias_m_s2,
        gyro_bias_sigma_rad_s: imu.gyro_bias_rad_s,
        imu_m: calibration.imu_m,
        antenna_m: [
            calibration.velocity_antenna_m,
            calibration.attitude_antenna_m,
        ],
        velocity_sigma_m_s: (sensors.gnss_velocity.velocity_noise_m_s)
            .max(t.velocity_sigma_min_m_s),
        heading_sigma_rad: (sensors.gnss_attitude.heading_noise_rad).max(t.attitude_sigma_min_rad),
        tilt_sigma_rad: (sensors.gnss_attitude.roll_pitch_noise_rad).max(t.attitude_sigma_min_rad),
    }
}
