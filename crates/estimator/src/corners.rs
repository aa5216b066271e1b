//! Position of the four linkages from spring deflection, rack and body motion, and the linear map
//! between member forces and tyre forces.

mod length;
mod linkage;
mod live_axle;
mod moving;
mod steering_wheel;
mod tilt;
mod toe;
mod travel;

use model::steering::{SteeringGear, Toe};
use model::suspension::{
    BodyMotion, CornerPose, CornerStatics, GroundPlane, TyreFrame, ground_plane,
};
use model::vehicle::Vehicle;
use nalgebra::{Vector3, Vector6};
use sample::{LogTime, PerWheel, STANDARD_GRAVITY_M_S2, TyreForce, Wheel};

use crate::EstimatorError;
use crate::calibration::{CornerChannels, HubSensor, MatrixAxes};
use crate::feedback::{BodyMotionEstimate, EstimatorFeedback};
use crate::inputs::{Reading, Readings};
use crate::motion::MotionState;
use crate::tuning::{CornerTuning, Tuning};

use linkage::Linkage;
pub use linkage::corner_of;
use live_axle::AxleLinkage;
pub use live_axle::{BENDING, LiveAxleState, PANHARD, axle_channels, link_of};
use moving::{gear, is_described};
use steering_wheel::SteeringWheel;
use tilt::Tilt;
use toe::ToeFilter;
pub use travel::Travel;

/// One corner at one instant.
#[derive(Clone, Copy, Debug)]
pub struct CornerState {
    /// Pose of the linkage.
    pub pose: CornerPose,
    /// The tyre's contact frame.
    pub frame: TyreFrame,
    /// The map between members and tyre: in the wheel-carrier frame for the force filter, else in the
    /// contact frame.
    pub statics: CornerStatics,
    /// Force of spring, damper and stops, N.
    pub strut_n: f64,
    /// Its standard deviation, N; infinite while no deflection is measured.
    pub strut_sigma_n: f64,
    /// Compression of the strut from its design length, m.
    pub compression_m: f64,
    /// Standard deviations of the parts of F_x, F_y, F_z that the strut carries: zero with hard-points.
    pub strut_part_sigma: [f64; 3],
    /// Standard deviations of heading and inclination of the wheel against the body, rad: zero with hard-points.
    pub unknown_rad: [f64; 2],
    /// Axes of the matrix of its channels, if it has one.
    pub matrix_axes: Option<MatrixAxes>,
    /// A new reading of the potentiometer as a length of the strut by the hard-points, m.
    pub length_read: Option<Reading>,
    /// What the strut's acceleration changes, for the force filter; zero for the methods of flat ground.
    pub travel: Travel,
    /// Spin of the wheel, rad/s.
    pub spin_rad_s: f64,
    /// Its rate, rad/s^2, as rolling gives it.
    pub spin_dot_rad_s2: f64,
    /// Velocity of the wheel centre against the body, m/s.
    pub travel_m_s: Vector3<f64>,
    /// Angular rate of the upright against the body by steering and travel, rad/s.
    pub turn_rad_s: Vector3<f64>,
    /// What is known of the linkage.
    pub linkage: KnownLinkage,
}

/// What is known of the linkage of a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownLinkage {
    /// Nothing: its strain channels are not used.
    None,
    /// That of the corner: its strain channels measure the members.
    Corner,
    /// That of the live axle: the strain channels of both wheels measure the members of the axle.
    LiveAxle,
}

/// Standard deviations of the axes in which a wheel's forces are given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameErrors {
    /// Slope of the ground along and across the wheel by leaning tyres.
    pub slopes: [f64; 2],
    /// Heading of the wheel, rad.
    pub steer_rad: f64,
    /// The ground's normal about x and y, rad: unknown on rough ground.
    pub tilt_rad: f64,
    /// Inclination of the wheel's plane against the body, rad: unknown without hard-points. Of forces in the
    /// wheel-carrier frame, and of those in the contact frame.
    pub inclination_rad: [f64; 2],
}

impl FrameErrors {
    /// A force with the errors of the wheel's heading.
    #[must_use]
    pub fn turn(&self, force: &TyreForce) -> TyreForce {
        let [x, y, z] = known(force);
        let inclined = inclined(self.inclination_rad[0], [y, z]);
        with_errors(
            force,
            [[self.steer_rad * y, self.steer_rad * x, 0.0], inclined],
        )
    }

    /// A force of the contact frame with the errors of heading and slopes.
    #[must_use]
    pub fn widen(&self, force: &TyreForce) -> TyreForce {
        let [x, y, z] = known(force);
        let [along, across] = self.slopes;
        let tilted = [along * z, across * z, along * x + across * y];
        let turned = [self.steer_rad * y, self.steer_rad * x, 0.0];
        let inclined = inclined(self.inclination_rad[1], [y, z]);
        with_errors(force, [tilted, turned, inclined])
    }

    /// A force of the contact frame with the unknown normal in its standard deviations. On flat ground it
    /// adds nothing.
    #[must_use]
    pub fn tilt(&self, force: &TyreForce) -> TyreForce {
        let [x, y, z] = known(force);
        let tilted = [z, z, math::hypot(x, y)].map(|n| n * self.tilt_rad);
        with_errors(force, [tilted])
    }
}

/// Errors of a force with these parts across the wheel and up by an unknown inclination.
fn inclined(angle_rad: f64, [y, z]: [f64; 2]) -> [f64; 3] {
    [0.0, angle_rad * z, angle_rad * y]
}

/// The parts of a force, zero where unknown.
fn known(force: &TyreForce) -> [f64; 3] {
    force.force_n.map(|n| if n.is_finite() { n } else { 0.0 })
}

fn with_errors<const N: usize>(force: &TyreForce, errors: [[f64; 3]; N]) -> TyreForce {
    let sigma = |axis: usize| {
        let own = force.sigma_n[axis];
        let squares = errors.iter().map(|error| error[axis] * error[axis]);
        (own * own + squares.sum::<f64>()).sqrt()
    };
    TyreForce {
        sigma_n: std::array::from_fn(sigma),
        ..*force
    }
}

/// All four corners.
#[derive(Clone, Debug)]
pub struct Corners {
    tuning: CornerTuning,
    fresh_s: f64,
    linkages: [Linkage; 4],
    states: [CornerState; 4],
    before: [CornerStatics; 4],
    /// A live rear axle.
    axle: Option<AxleLinkage>,
    /// The live axle now and one step before.
    axle_states: Option<[LiveAxleState; 2]>,
    normal: Vector3<f64>,
    /// Ground normal from the wheels' contact points at the last step.
    seen: Option<Vector3<f64>>,
    turn_over_ground: Option<[f64; 2]>,
    /// Standard deviation of the ground's slopes along x and y by leaning tyres.
    leaning: [f64; 2],
    tilt: Tilt,
    /// Whether the unsprung masses are taken as standing still.
    static_unsprung: bool,
    cg_height_m: f64,
    rack_m_rad: f64,
    /// Steer angles of front wheels that are described by a matrix and have no hard-points.
    gear: Option<SteeringGear>,
    /// Filter of the steering wheel's angle.
    steering_wheel: SteeringWheel,
    /// Filter with a longer memory for its rate and acceleration.
    turning: SteeringWheel,
    toe: ToeFilter,
}

impl Corners {
    /// The corners of a vehicle; `None` if the vehicle file has no linkage, or an axle without strut or unsprung
    /// masses, or without hard-points and motion ratio. A matrix of a wheel's channels stands for its linkage.
    pub fn new(
        vehicle: &Vehicle,
        channels: &PerWheel<CornerChannels>,
        tuning: &Tuning,
    ) -> Result<Option<Self>, EstimatorError> {
        if !is_described(vehicle, channels)? {
            return Ok(None);
        }
        let mut linkages = Vec::with_capacity(4);
        for wheel in Wheel::ALL {
            match Linkage::new(vehicle, wheel, channels, tuning) {
                Ok(Some(linkage)) => linkages.push(linkage),
                Ok(None) => return Ok(None),
                Err(error) => return Err(EstimatorError::Suspension(error.to_string())),
            }
        }
        let Ok(linkages) = <[Linkage; 4]>::try_from(linkages) else {
            return Ok(None);
        };
        let rest = BodyMotion {
            specific_force_m_s2: Vector3::z() * STANDARD_GRAVITY_M_S2,
            ..BodyMotion::default()
        };
        let mut states = Vec::with_capacity(4);
        for linkage in &linkages {
            let state = linkage
                .state(
                    Vector3::z(),
                    &rest,
                    [0.0; 2],
                    [0.0; 3],
                    linkage.fallback_load_n,
                )
                .map_err(|error| EstimatorError::Suspension(error.to_string()))?;
            states.push(state);
        }
        let Ok(states) = <[CornerState; 4]>::try_from(states) else {
            return Ok(None);
        };
        let axle = AxleLinkage::new(vehicle)
            .map_err(|error| EstimatorError::Suspension(error.to_string()))?;
        let steered = &linkages[0].corner;
        let rack_m_rad = vehicle.steering.rack_m_rad.filter(|_| steered.is_known());
        let rack_m_rad = rack_m_rad.unwrap_or_else(|| {
            let per_rack = steered.rates(&linkages[0].pose).rack.rotation.z;
            1.0 / (vehicle.steering.ratio * per_rack)
        });
        Ok(Some(Self {
            tuning: tuning.corners,
            fresh_s: tuning.fresh_s,
            linkages,
            before: states.map(|state| state.statics),
            states,
            axle,
            axle_states: None,
            normal: Vector3::z(),
            seen: None,
            turn_over_ground: None,
            leaning: [0.0; 2],
            tilt: Tilt::default(),
            static_unsprung: false,
            cg_height_m: vehicle.body.cg_height_m,
            rack_m_rad,
            gear: gear(vehicle, channels)?,
            steering_wheel: SteeringWheel::default(),
            turning: SteeringWheel::default(),
            toe: ToeFilter::new(Toe::of(vehicle)),
        }))
    }

    /// The same corners under a vehicle whose mass properties have changed.
    pub fn load(&mut self, vehicle: &Vehicle) -> Result<(), EstimatorError> {
        for (linkage, wheel) in self.linkages.iter_mut().zip(Wheel::ALL) {
            linkage
                .load(vehicle, wheel)
                .map_err(|error| EstimatorError::Suspension(error.to_string()))?;
        }
        if let Some(axle) = &mut self.axle {
            axle.load(vehicle)
                .map_err(|error| EstimatorError::Suspension(error.to_string()))?;
        }
        self.cg_height_m = vehicle.body.cg_height_m;
        Ok(())
    }

    /// The same linkages on other tyres.
    pub fn load_tyres(&mut self, vehicle: &Vehicle) {
        for (linkage, wheel) in self.linkages.iter_mut().zip(Wheel::ALL) {
            linkage.load_tyre(&vehicle.axle(wheel).tyre);
        }
    }

    /// The corners after the last [`update`](Self::update).
    #[must_use]
    pub fn states(&self) -> &[CornerState; 4] {
        &self.states
    }

    /// Standard deviation of the ground's normal at a wheel about x and about y, rad.
    #[must_use]
    pub fn tilt_rad(&self) -> f64 {
        self.tilt.sigma_rad()
    }

    /// A live axle now and one step before.
    #[must_use]
    pub fn live_axle(&self) -> Option<&[LiveAxleState; 2]> {
        self.axle_states.as_ref()
    }

    /// The same corners on a vehicle on which a load pulls: force and moment about the centre of gravity, vehicle
    /// axes, N and N m. In the balances, the load is part of what accelerates the vehicle beside the tyres.
    #[must_use]
    pub fn states_with(&self, load: &Vector6<f64>) -> [CornerState; 4] {
        let mut states = self.states;
        for state in &mut states {
            state.travel.wrench[0] -= load * 0.25;
        }
        states
    }

    /// Whether the contact points gave the ground's normal in the last step.
    #[must_use]
    pub fn touches(&self) -> bool {
        self.seen.is_some()
    }

    /// Speed of the centre of wheel `i` along the ground's normal, m/s.
    #[must_use]
    pub fn wheel_rise(&self, i: usize, motion: &MotionState) -> f64 {
        let state = &self.states[i];
        let arm = self.seen_from_cg(state.pose.wheel_centre_m);
        let velocity = motion.velocity_m_s + motion.rate_rad_s.cross(&arm) + state.travel_m_s;
        self.normal.dot(&velocity)
    }

    /// Whether the lengths of all struts are measured.
    #[must_use]
    pub fn known(&self, now: LogTime) -> bool {
        self.linkages
            .iter()
            .all(|linkage| linkage.length.known(now))
    }

    /// Maps between members and tyres one step before.
    #[must_use]
    pub fn statics_before(&self) -> &[CornerStatics; 4] {
        &self.before
    }

    /// The ground's normal, body axes.
    #[must_use]
    pub fn normal(&self) -> Vector3<f64> {
        self.normal
    }

    /// Roll and pitch rate of the body over the ground, rad/s, from the change of struts and tyre
    /// compression in the last step. `None` where these are unknown or fewer than three wheels
    /// touch the ground.
    #[must_use]
    pub fn turn_over_ground(&self) -> Option<[f64; 2]> {
        self.turn_over_ground
    }

    /// Velocity of the centre of wheel `i` over the ground, along its heading and left of it, m/s.
    #[must_use]
    pub fn wheel_velocity(&self, i: usize, motion: &MotionState) -> [f64; 2] {
        let CornerState {
            pose,
            frame,
            travel_m_s,
            ..
        } = &self.states[i];
        let arm = self.seen_from_cg(pose.wheel_centre_m);
        let velocity = motion.velocity_m_s + motion.rate_rad_s.cross(&arm) + travel_m_s;
        [0, 1].map(|axis| frame.vehicle_from_tyre.column(axis).dot(&velocity))
    }

    /// The middle between the wheel centres of an axle: position from the centre of gravity, m, and
    /// velocity against the body, m/s.
    #[must_use]
    pub fn axle_middle(&self, axle: usize) -> [Vector3<f64>; 2] {
        let [left, right] = [2 * axle, 2 * axle + 1].map(|i| &self.states[i]);
        let middle = 0.5 * (left.pose.wheel_centre_m + right.pose.wheel_centre_m);
        let travel = 0.5 * (left.travel_m_s + right.travel_m_s);
        [self.seen_from_cg(middle), travel]
    }

    fn seen_from_cg(&self, point_m: Vector3<f64>) -> Vector3<f64> {
        point_m - Vector3::z() * self.cg_height_m
    }

    /// Places the corners at `now`, `dt` after the last call. `steering_offset_rad` is added to the
    /// steering wheel's angle.
    pub fn update(
        &mut self,
        now: LogTime,
        dt: f64,
        readings: &mut Readings,
        motion: &MotionState,
        feedback: &EstimatorFeedback,
        steering_offset_rad: f64,
    ) {
        let load_n = feedback.forces.0.map(|force| force.force_n[2]);
        let rack_motion = self.move_linkages(now, dt, readings, feedback, steering_offset_rad);
        self.place_axle();
        let load: [f64; 4] = std::array::from_fn(|i| {
            if load_n[i].is_finite() {
                load_n[i].clamp(0.0, self.tuning.load_max * self.linkages[i].fallback_load_n)
            } else {
                self.linkages[i].fallback_load_n
            }
        });
        self.tilt(now, dt, motion, load);
        let up = motion.earth_from_body.inverse() * Vector3::z();
        let body = self.body_motion(motion, feedback, up);
        let gravity = STANDARD_GRAVITY_M_S2 * self.normal.dot(&up).clamp(0.5, 1.0);
        // Rate of the velocity's components along the rotating body axes. The body's rotation does
        // not spin a wheel at rest.
        let gained = body.specific_force_m_s2
            - up * STANDARD_GRAVITY_M_S2
            - body.rate_rad_s.cross(&motion.velocity_m_s);
        let yaw_dot = body.rate_dot_rad_s2.z * motion.velocity_m_s.x.abs().min(1.0);
        for (i, linkage) in self.linkages.iter().enumerate() {
            let radius = linkage.radius_m - load[i] / linkage.tyre_stiffness_n_m;
            let spin = readings
                .wheel_speed(Wheel::ALL[i], now, self.fresh_s)
                .unwrap_or(motion.velocity_m_s.x / radius);
            let rack_motion = if i < 2 { rack_motion } else { [0.0; 2] };
            let pose = &linkage.pose;
            let along = along_heading(pose.wheel_centre_m, pose.spindle, gained, yaw_dot);
            let rolling = [spin, along / radius, gravity];
            self.before[i] = self.states[i].statics;
            // A linkage with a singular map keeps its last state.
            if let Ok(state) = linkage.state(self.normal, &body, rack_motion, rolling, load[i]) {
                self.states[i] = state;
            }
        }
        self.move_axle(&body);
        self.measure_tilt(now, dt, motion);
    }

    /// Places both wheels of a live axle by the lengths of its springs.
    fn place_axle(&mut self) {
        let Some(axle) = &mut self.axle else {
            return;
        };
        let rear = &mut self.linkages[2..];
        axle.place([0, 1].map(|side| rear[side].pose.strut_length_m));
        for (side, linkage) in rear.iter_mut().enumerate() {
            linkage.pose = axle.corner_pose(side, &linkage.pose);
        }
    }

    /// Moves a live axle with the body. An axle with a singular map keeps its last state.
    fn move_axle(&mut self, body: &BodyMotion) {
        let Some(axle) = &self.axle else {
            return;
        };
        let rates_m_s = [2, 3].map(|wheel| self.linkages[wheel].rate_m_s());
        if let Ok(state) = axle.state(body, rates_m_s, &mut self.states[2..]) {
            let before = self.axle_states.map_or(state, |[now, _]| now);
            self.axle_states = Some([state, before]);
        }
    }

    /// Motion of the body, with which the unsprung masses move; `up` is the vertical in vehicle axes.
    fn body_motion(
        &self,
        motion: &MotionState,
        feedback: &EstimatorFeedback,
        up: Vector3<f64>,
    ) -> BodyMotion {
        let BodyMotionEstimate {
            specific_force_m_s2,
            rate_dot_rad_s2,
        } = feedback.body_motion.unwrap_or(BodyMotionEstimate {
            specific_force_m_s2: motion.specific_force_m_s2,
            rate_dot_rad_s2: motion.rate_dot_rad_s2,
        });
        let body = BodyMotion {
            specific_force_m_s2,
            reference_m: Vector3::new(0.0, 0.0, self.cg_height_m),
            rate_rad_s: motion.rate_rad_s,
            rate_dot_rad_s2,
        };
        if self.static_unsprung {
            BodyMotion {
                specific_force_m_s2: up * STANDARD_GRAVITY_M_S2,
                reference_m: body.reference_m,
                ..BodyMotion::default()
            }
        } else {
            body
        }
    }

    /// Takes the speeds of the wheels along the normal for the standard deviation of the ground's normals.
    fn measure_tilt(&mut self, now: LogTime, dt: f64, motion: &MotionState) {
        let along_m_s = self.states.each_ref().map(|state| {
            let arm = state.pose.wheel_centre_m;
            (state.travel_m_s + motion.rate_rad_s.cross(&arm)).dot(&self.normal)
        });
        let speed_m_s = motion.velocity_m_s.x;
        // Without deflections the travel of the wheels is unknown.
        if self.known(now) {
            self.tilt.step(dt, along_m_s, speed_m_s, &self.tuning.tilt);
        }
    }

    /// Ground normal: from the contact points while at least three wheels carry load, else
    /// propagated with the body's rotation.
    fn tilt(&mut self, now: LogTime, dt: f64, motion: &MotionState, load_n: [f64; 4]) {
        self.normal -= motion.rate_rad_s.cross(&self.normal) * dt;
        let known = self.known(now);
        if !known {
            // Without deflections the ground is assumed level.
            self.normal = motion.earth_from_body.inverse() * Vector3::z();
        }
        let poses = PerWheel(std::array::from_fn(|i| self.linkages[i].pose));
        let radius = PerWheel(std::array::from_fn(|i| self.linkages[i].radius_m));
        let compression = PerWheel(std::array::from_fn(|i| {
            load_n[i] / self.linkages[i].tyre_stiffness_n_m
        }));
        // On twisted ground the plane through four contacts and that through three differ: a wheel that lifts
        // leaves it gradually.
        let [least_n, full_n] = self.tuning.contact_n;
        let part = |load: f64| ((load - least_n) / (full_n - least_n)).clamp(0.0, 1.0);
        let weight = PerWheel(load_n.map(part));
        let plane = known.then(|| ground_plane(&poses, &radius, &compression, &weight));
        let plane = plane.flatten();
        if let Some(plane) = &plane {
            self.leaning = leaning_slopes(plane, &poses, &radius);
        }
        let seen = plane.map(|plane| plane.normal);
        self.turn_over_ground = seen
            .zip(self.seen)
            .map(|(now, before)| turn_from_normals(before, now, motion.rate_rad_s.z, dt));
        // Without gyros nothing turns the normal between two planes.
        let kept = if self.seen.is_some() && motion.inertial {
            math::exp(-dt / self.tuning.normal_time_s)
        } else {
            0.0
        };
        self.seen = seen;
        self.normal = seen.map_or(self.normal, |seen| seen.lerp(&self.normal, kept));
        if self.normal.z < 0.3 || !self.normal.iter().all(|n| n.is_finite()) {
            self.normal = Vector3::z();
        }
        self.normal.normalize_mut();
    }

    /// Moves the unsprung parts along the wheels' paths from now on, and gives the maps in wheel-carrier
    /// frames, with these hub accelerometers.
    #[must_use]
    pub fn on_paths(mut self, hubs: &PerWheel<Option<HubSensor>>) -> Self {
        for (linkage, wheel) in self.linkages.iter_mut().zip(Wheel::ALL) {
            linkage.on_path = true;
            linkage.hub = hubs[wheel].filter(|_| linkage.known != KnownLinkage::LiveAxle);
        }
        self
    }

    /// Takes the unsprung masses as standing still from now on.
    pub fn neglect_unsprung_inertia(&mut self) {
        self.static_unsprung = true;
    }

    /// Errors of a wheel's frames: `steer_sigma_rad` is the standard deviation of the steering wheel's zero.
    #[must_use]
    pub fn frame_errors(&self, wheel: Wheel, steer_sigma_rad: f64) -> FrameErrors {
        let slopes = Vector3::new(self.leaning[0], self.leaning[1], 0.0);
        let state = &self.states[wheel.index()];
        let frame = state.frame.vehicle_from_tyre;
        let is_known = state.linkage != KnownLinkage::None;
        let [unknown_steer_rad, unknown_rad] = state.unknown_rad;
        // A force that was measured in some axes is not uncertain in them, whatever the wheel's are.
        let inclination_rad = match state.matrix_axes {
            None => [unknown_rad; 2],
            Some(MatrixAxes::Vehicle) => [unknown_rad, 0.0],
            Some(MatrixAxes::Wheel) => [0.0, unknown_rad],
        };
        let is_steered = wheel.is_front() && state.matrix_axes != Some(MatrixAxes::Wheel);
        let zero_rad = match is_steered {
            true => steer_sigma_rad.min(self.tuning.steer_sigma_max_rad),
            false => 0.0,
        };
        FrameErrors {
            slopes: [0, 1].map(|axis| frame.column(axis).dot(&slopes)),
            steer_rad: if is_known || state.matrix_axes == Some(MatrixAxes::Wheel) {
                zero_rad
            } else {
                math::hypot(zero_rad, unknown_steer_rad)
            },
            tilt_rad: self.tilt.sigma_rad(),
            inclination_rad,
        }
    }
}

/// Standard deviation of the ground's slopes along x and y by the tyres' shape. The height of a
/// leaning tyre's contact point below the wheel centre depends on its crown, which is not measured:
/// between a thin disc of radius R and a tyre whose crown removes the effect there are R (1 - cos
/// gamma). All tyres of a vehicle have the same crown, so the same lean of all gives no slope.
fn leaning_slopes(
    plane: &GroundPlane,
    poses: &PerWheel<CornerPose>,
    radius_m: &PerWheel<f64>,
) -> [f64; 2] {
    let unknown_m: [f64; 4] = std::array::from_fn(|i| {
        let lean = math::asin(poses.0[i].spindle.dot(&plane.normal).clamp(-1.0, 1.0));
        radius_m.0[i] * (1.0 - math::cos(lean))
    });
    [0, 1].map(|axis| {
        let heights = plane.slopes_per_height.iter().zip(unknown_m);
        heights.map(|(slopes, height)| slopes[axis] * height).sum()
    })
}

/// Roll and pitch rate, rad/s, of a body with the given yaw rate for which the ground normal n has
/// moved in body axes: n' = n x w.
fn turn_from_normals(
    before: Vector3<f64>,
    now: Vector3<f64>,
    yaw_rate_rad_s: f64,
    dt: f64,
) -> [f64; 2] {
    let moved = (now - before) / dt;
    let roll = (moved.y + now.x * yaw_rate_rad_s) / now.z;
    let pitch = (now.y * yaw_rate_rad_s - moved.x) / now.z;
    [roll, pitch]
}

/// Acceleration of a wheel at `at` (m) along its heading, m/s^2, from the body's velocity change
/// and yaw acceleration. The spindle points left.
fn along_heading(
    at: Vector3<f64>,
    spindle: Vector3<f64>,
    gained_m_s2: Vector3<f64>,
    yaw_dot_rad_s2: f64,
) -> f64 {
    let x = gained_m_s2.x - yaw_dot_rad_s2 * at.y;
    let y = gained_m_s2.y + yaw_dot_rad_s2 * at.x;
    x * spindle.y - y * spindle.x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Calibration, Resolved};
    use model::sensors::Sensors;

    #[test]
    fn a_body_turns_as_it_sees_the_ground_turn() {
        let rate = Vector3::new(0.4, -0.3, 0.7);
        let normal = Vector3::new(0.1, -0.05, 1.0).normalize();
        let dt = 1e-6;
        let later = nalgebra::Rotation3::new(-rate * dt) * normal;
        let [roll, pitch] = turn_from_normals(normal, later, rate.z, dt);
        assert!(
            (roll - rate.x).abs() < 1e-5 && (pitch - rate.y).abs() < 1e-5,
            "{roll} {pitch}"
        );
    }

    fn prowler() -> Corners {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let sensors = Sensors::builtin("thesis-10bit").unwrap();
        let nominal = Calibration::nominal(&vehicle.name);
        let channels = Resolved::new(&sensors, &nominal).unwrap().corners;
        Corners::new(&vehicle, &channels, &Tuning::default())
            .unwrap()
            .unwrap()
    }

    #[test]
    fn a_frame_that_may_be_turned_makes_forces_less_sure() {
        let mut corners = prowler();
        corners.leaning = [0.0, 1e-3];
        let force = TyreForce {
            force_n: [100.0, 500.0, 3000.0],
            sigma_n: [1.0; 3],
            ..TyreForce::default()
        };
        let widened = |wheel| corners.frame_errors(wheel, 2e-3).widen(&force);
        let near = |sigma: f64, error: f64| (sigma - math::hypot(1.0_f64, error)).abs() < 0.01;
        let [front, rear] = [Wheel::FrontLeft, Wheel::RearLeft].map(|wheel| widened(wheel).sigma_n);
        assert!(
            near(front[0], 2e-3 * 500.0) && near(rear[0], 0.0),
            "{front:?} {rear:?}"
        );
        assert!(
            near(front[1], math::hypot(3.0_f64, 0.2)) && near(rear[1], 3.0),
            "{front:?} {rear:?}"
        );
        assert!(near(rear[2], 0.5), "{rear:?}");
        // Where only the load is known, the other forces stay unknown.
        let load = TyreForce {
            force_n: [f64::NAN, f64::NAN, 3000.0],
            sigma_n: [f64::NAN, f64::NAN, 5.0],
            ..TyreForce::default()
        };
        let widened = corners.frame_errors(Wheel::FrontLeft, 1.0).widen(&load);
        assert_eq!(widened.sigma_n[2], 5.0);
    }

    /// On twisted ground the plane through three contact points is another one than that through four.
    #[test]
    fn a_wheel_that_lifts_on_twisted_ground_does_not_turn_the_normal_at_once() {
        let mut corners = prowler();
        let now = LogTime(1_000_000_000);
        for (linkage, up_m) in corners.linkages.iter_mut().zip([0.1, -0.1, -0.1, 0.1]) {
            linkage.pose.wheel_centre_m.z += up_m;
            let length_m = linkage.pose.strut_length_m;
            linkage.length.update(now, now, length_m);
        }
        let mut motion = MotionState {
            earth_from_body: nalgebra::Rotation3::identity(),
            velocity_m_s: Vector3::x(),
            rate_rad_s: Vector3::zeros(),
            rate_dot_rad_s2: Vector3::zeros(),
            specific_force_m_s2: Vector3::z() * STANDARD_GRAVITY_M_S2,
            accel_bias_m_s2: Vector3::zeros(),
            accel_bias_sigma_m_s2: Vector3::zeros(),
            specific_force_dot_m_s3: Vector3::zeros(),
            sideslip_rad: 0.0,
            sideslip_sigma_rad: 0.1,
            inertial: true,
            inertial_age_s: 0.0,
        };
        let on_all = [2000.0; 4];
        let lifted = [0.0, 2000.0, 2000.0, 2000.0];
        let turned_deg = |corners: &mut Corners, motion: &MotionState, load_n| {
            let before = corners.normal;
            corners.tilt(now, 0.01, motion, load_n);
            before.angle(&corners.normal).to_degrees()
        };
        corners.tilt(now, 0.01, &motion, on_all);
        let first = turned_deg(&mut corners, &motion, lifted);
        assert!((0.05..1.0).contains(&first), "{first} degrees in one step");
        let rest: f64 = (0..200)
            .map(|_| turned_deg(&mut corners, &motion, lifted))
            .sum();
        assert!(rest > 5.0, "{rest} degrees in 2 s");
        // Without gyros, nothing but the plane gives the normal.
        motion.inertial = false;
        let at_once = turned_deg(&mut corners, &motion, on_all);
        assert!(at_once > 5.0, "{at_once} degrees");
    }

    #[test]
    fn only_tyres_that_lean_unlike_each_other_feign_a_slope() {
        let corners = prowler();
        let poses = PerWheel(corners.states.map(|state| state.pose));
        let radius = PerWheel([0.32; 4]);
        let plane = |leans: [f64; 4]| {
            let mut poses = poses;
            for (pose, lean) in poses.0.iter_mut().zip(leans) {
                pose.spindle = Vector3::new(0.0, math::cos(lean), math::sin(lean));
            }
            let plane = GroundPlane {
                normal: Vector3::z(),
                height_m: 0.0,
                slopes_per_height: [[0.3, 0.5], [0.3, -0.5], [-0.3, 0.5], [-0.3, -0.5]],
            };
            leaning_slopes(&plane, &poses, &radius)
        };
        let [along, across] = plane([-0.1; 4]);
        assert!(
            along.abs() < 1e-12 && across.abs() < 1e-12,
            "{along} {across}"
        );
        let [_, across] = plane([0.0, 0.14, 0.0, 0.14]);
        let lower_m = 0.32 * (1.0 - math::cos(0.14_f64));
        assert!((across + lower_m).abs() < 1e-12, "{across}");
    }

    #[test]
    fn a_wheel_speeds_up_with_the_body_and_as_it_turns() {
        let at = Vector3::new(0.8, 0.5, 0.0);
        let gained = Vector3::new(1.0, 3.0, 0.0);
        // Body turning left ever faster: the left wheel falls behind.
        let straight = along_heading(at, Vector3::y(), gained, 2.0);
        assert!((straight - 0.0).abs() < 1e-12);
        // Steered left by delta: forward is (cos, sin), the spindle (-sin, cos).
        let (sin, cos) = math::sin_cos(0.3_f64);
        let steered = along_heading(at, Vector3::new(-sin, cos, 0.0), gained, 2.0);
        assert!((steered - (3.0 + 1.6) * sin).abs() < 1e-12);
    }
}
