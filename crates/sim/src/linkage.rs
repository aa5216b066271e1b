//! What the linkage carries, where a motion tells the tyre forces but not the link forces.

use model::suspension::{
    BodyMotion, ChannelKind, Coordinates, Corner, CornerMotion, CornerPose, CornerStatics,
    GroundPlane, MemberForces, SuspensionError, TyreFrame, Wrench, ground_plane,
};
use model::vehicle::{Strut, Tyre, Unsprung, Vehicle};
use nalgebra::{Matrix3, Vector3};
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use crate::driver::body_rates;
use crate::{SimError, TruthState, WheelGround, WheelTruth};

/// Pneumatic trail of an unslipping tyre, parts of its contact length.
const TRAIL_OF_CONTACT_LENGTH: f64 = 0.17;

/// Below this load a wheel counts as off the ground, N.
const OFF_GROUND_N: f64 = 1.0;

/// From this load on a wheel tells fully where the ground is, N; below, less and less, so that the
/// plane does not jump when a wheel leaves it.
const FULL_WEIGHT_N: f64 = 300.0;

/// Roll and pitch change the strut lengths that they follow from, by a hundredth of themselves.
pub(crate) const ATTITUDE_ROUNDS: usize = 2;

/// The linkage of all four corners.
pub(crate) struct Linkage {
    corners: PerWheel<LinkedCorner>,
    cg_height_m: f64,
}

/// One corner, with what its statics need.
struct LinkedCorner {
    corner: Corner,
    unsprung: Unsprung,
    strut: Strut,
    tyre: Tyre,
    /// Rack travel per steering-wheel angle; 0 at the rear.
    rack_m_rad: f64,
    /// Whether a half-shaft that drives reacts on the chassis.
    drive_on_chassis: bool,
    /// Whether the brake sits on the upright.
    brake_on_upright: bool,
}

/// Strut lengths that are missing, for a vehicle without hard-points: with i metres of spring travel
/// for one of wheel travel, the strut carries (F_z - weight of the corner's unsprung parts)/i.
pub(crate) fn struts_alone(vehicle: &Vehicle, states: &mut [TruthState]) {
    for wheel in Wheel::ALL {
        let axle = vehicle.axle(wheel);
        let Some((strut, ratio)) = axle
            .strut
            .as_ref()
            .and_then(|strut| Some((strut, strut.motion_ratio?)))
        else {
            continue;
        };
        let hanging_n = axle.unsprung_mass_kg() / 2.0 * STANDARD_GRAVITY_M_S2;
        let mut previous: Option<(f64, f64)> = None;
        for state in states.iter_mut() {
            let time_s = state.time_s;
            let truth = &mut state.wheels[wheel];
            if truth.strut_length_m.is_nan() {
                let force_n = (truth.force_n[2] - hanging_n) / ratio;
                let (k, c) = (strut.stiffness_n_m, strut.damping_n_s_m);
                // F = k (l_0 - l) - c (l - l_before)/dt.
                let length_m = match previous {
                    None => strut.free_length_m - force_n / k,
                    Some((before_s, before_m)) => {
                        let damping = c / (time_s - before_s);
                        (k * strut.free_length_m + damping * before_m - force_n) / (k + damping)
                    }
                };
                truth.strut_length_m =
                    length_m.clamp(strut.bump_stop_length_m, strut.droop_stop_length_m);
            }
            previous = Some((time_s, truth.strut_length_m));
        }
    }
}

/// How one corner stands and moves.
struct Stance {
    pose: CornerPose,
    frame: TyreFrame,
    statics: CornerStatics,
    wrench: Wrench,
}

/// What of a corner's motion takes two instants to tell.
#[derive(Clone, Copy)]
struct Turning {
    /// Rate of the wheel's spin.
    spin_rad_s2: f64,
    /// Rate of the steering wheel, rad/s, which turns the spinning wheel about, and its acceleration,
    /// rad/s^2.
    steering_wheel: [f64; 2],
}

impl Turning {
    fn at(states: &[TruthState], row: usize, wheel: Wheel) -> Self {
        Self {
            spin_rad_s2: slope(states, row, |s| s.wheels[wheel].angular_speed_rad_s),
            steering_wheel: [
                slope(states, row, |s| s.steering_wheel_rad),
                bend(states, row, |s| s.steering_wheel_rad),
            ],
        }
    }
}

impl Stance {
    fn members(&self) -> MemberForces {
        self.statics.members(&self.wrench)
    }

    /// The wheel on its ground.
    fn ground(&self) -> WheelGround {
        let turn = self.frame.vehicle_from_tyre;
        let force = turn * self.wrench.force_n;
        let arm = self.frame.contact_m - self.pose.wheel_centre_m;
        let moment = turn * self.wrench.moment_n_m + arm.cross(&force);
        WheelGround {
            normal_body: self.frame.normal().into(),
            force_body_n: force.into(),
            moment_body_n_m: Some(moment.into()),
            spindle_body: self.pose.spindle.into(),
            centre_acceleration_m_s2: None,
            unsprung_inertia_n: None,
            ground_height_m: None,
        }
    }
}

impl Linkage {
    /// The linkage of a vehicle; `None` where its file has no hard-points, struts or unsprung
    /// masses.
    pub(crate) fn new(vehicle: &Vehicle) -> Result<Option<Self>, SimError> {
        let mut corners = Vec::with_capacity(Wheel::ALL.len());
        for wheel in Wheel::ALL {
            match LinkedCorner::new(vehicle, wheel)? {
                Some(corner) => corners.push(corner),
                None => return Ok(None),
            }
        }
        let corners = <[LinkedCorner; 4]>::try_from(corners).ok();
        Ok(corners.map(|corners| Self {
            corners: PerWheel(corners),
            cg_height_m: vehicle.body.cg_height_m,
        }))
    }

    /// Fills in what the states do not tell: strut lengths, link forces, ball-joint forces, steer
    /// angles, the wheels on their ground. Where strut lengths are missing at all wheels, roll and pitch become those at which
    /// the wheels stand on the ground, since springs and linkage then carry the body.
    pub(crate) fn complete(&self, states: &mut [TruthState]) -> Result<(), SimError> {
        let told = |state: &TruthState| {
            let known = |wheel: &WheelTruth| !wheel.strut_length_m.is_nan();
            state.wheels.0.iter().any(known)
        };
        if !states.iter().any(told) {
            for _ in 0..ATTITUDE_ROUNDS {
                self.balance(states)?;
                self.settle_attitude(states)?;
            }
            forget_strut_lengths(states);
        }
        self.find_all_strut_lengths(states)?;
        for wheel in Wheel::ALL {
            for row in 0..states.len() {
                self.resolve_ball_force(&mut states[row], wheel);
                let truth = &states[row].wheels[wheel];
                let known = truth.link_force_n.iter().all(|f| f.is_finite());
                if known
                    && truth.ground.is_some()
                    && truth.ball_normal_n.is_finite()
                    && truth.steer_rad.is_finite()
                {
                    continue;
                }
                let rate_m_s = slope(states, row, |s| s.wheels[wheel].strut_length_m);
                let turning = Turning::at(states, row, wheel);
                let state = &states[row];
                let length_m = state.wheels[wheel].strut_length_m;
                let kind = ChannelKind::BallNormal;
                let stance = self
                    .stance(state, wheel, length_m, rate_m_s, turning, kind)
                    .map_err(|cause| linkage_error(state, wheel, cause))?;
                fill(&mut states[row].wheels[wheel], &stance);
            }
        }
        Ok(())
    }

    /// How an upright stands in a state: rotation from its axes, which are the vehicle's in the design
    /// position, into body axes, and the wheel centre from the centre of gravity, m.
    pub(crate) fn carrier(
        &self,
        state: &TruthState,
        wheel: Wheel,
    ) -> Result<(Matrix3<f64>, Vector3<f64>), SimError> {
        let corner = &self.corners[wheel];
        let length_m = state.wheels[wheel].strut_length_m;
        let rack_m = corner.rack_m(state, wheel);
        let pose = (corner.corner.pose(length_m, rack_m))
            .map_err(|cause| linkage_error(state, wheel, cause))?;
        let up_m = Vector3::new(0.0, 0.0, self.cg_height_m);
        Ok((pose.vehicle_from_upright, pose.wheel_centre_m - up_m))
    }

    /// Finds all strut lengths anew.
    pub(crate) fn balance(&self, states: &mut [TruthState]) -> Result<(), SimError> {
        forget_strut_lengths(states);
        self.find_all_strut_lengths(states)
    }

    fn find_all_strut_lengths(&self, states: &mut [TruthState]) -> Result<(), SimError> {
        Wheel::ALL
            .into_iter()
            .try_for_each(|wheel| self.find_strut_lengths(states, wheel))
    }

    /// Turns the body to the roll and pitch at which its wheels stand on level ground, with the
    /// rates that follow, and carries velocity and specific force over into the new body axes.
    fn settle_attitude(&self, states: &mut [TruthState]) -> Result<(), SimError> {
        // On two wheels the body stands as the model has it, without a jump.
        let mut turned = [0.0; 2];
        for state in states.iter_mut() {
            let before = state.earth_from_body();
            let own = [state.roll_rad, state.pitch_rad];
            if let Some(plane) = self.ground(state, |_| None)? {
                let settled = plane.body_roll_pitch_rad();
                turned = std::array::from_fn(|axis| settled[axis] - own[axis]);
            }
            [state.roll_rad, state.pitch_rad] =
                std::array::from_fn(|axis| own[axis] + turned[axis]);
            let after = state.earth_from_body().inverse();
            let carry = |v: [f64; 3]| (after * (before * Vector3::from(v))).into();
            state.velocity_body_m_s = carry(state.velocity_body_m_s);
            state.specific_force_m_s2 = carry(state.specific_force_m_s2);
            state.acceleration_m_s2 = carry(state.acceleration_m_s2);
        }
        for row in 0..states.len() {
            let rates = [
                slope(states, row, |s| s.roll_rad),
                slope(states, row, |s| s.pitch_rad),
                slope(states, row, |s| s.yaw_rad),
            ];
            let state = &mut states[row];
            state.rate_rad_s = body_rates([state.roll_rad, state.pitch_rad], rates);
        }
        for row in 0..states.len() {
            let derivative = std::array::from_fn(|axis| slope(states, row, |s| s.rate_rad_s[axis]));
            states[row].rate_derivative_rad_s2 = derivative;
        }
        Ok(())
    }

    /// The ground below the wheels, seen from the body; none with fewer than three wheels whose
    /// distance from the ground is known. A wheel without load counts where `clearance_m` tells
    /// how high it hangs.
    pub(crate) fn ground(
        &self,
        state: &TruthState,
        clearance_m: impl Fn(Wheel) -> Option<f64>,
    ) -> Result<Option<GroundPlane>, SimError> {
        let mut poses = Vec::with_capacity(Wheel::ALL.len());
        for wheel in Wheel::ALL {
            let corner = &self.corners[wheel];
            let rack_m = corner.rack_m(state, wheel);
            let length_m = state.wheels[wheel].strut_length_m;
            let pose = corner.corner.pose(length_m, rack_m);
            poses.push(pose.map_err(|cause| linkage_error(state, wheel, cause))?);
        }
        let tyre = |wheel: Wheel| &self.corners[wheel].tyre;
        let pressed_m = |wheel: Wheel| {
            let load_n = state.wheels[wheel].force_n[2];
            if load_n > OFF_GROUND_N {
                Some(load_n / tyre(wheel).vertical_stiffness_n_m)
            } else {
                clearance_m(wheel).map(|clearance_m| -clearance_m)
            }
        };
        Ok(ground_plane(
            &PerWheel::from_fn(|wheel| poses[wheel.index()]),
            &PerWheel::from_fn(|wheel| tyre(wheel).unloaded_radius_m),
            &PerWheel::from_fn(|wheel| pressed_m(wheel).unwrap_or(0.0)),
            &PerWheel::from_fn(|wheel| {
                let load_n = state.wheels[wheel].force_n[2];
                match (clearance_m(wheel), pressed_m(wheel)) {
                    (Some(_), _) => 1.0,
                    (None, Some(_)) => (load_n / FULL_WEIGHT_N).min(1.0),
                    (None, None) => 0.0,
                }
            }),
        ))
    }

    /// The ball-joint force's part normal to the lower arm, where the state tells force and place.
    fn resolve_ball_force(&self, state: &mut TruthState, wheel: Wheel) {
        let points = &self.corners[wheel].corner.points;
        let truth = &mut state.wheels[wheel];
        let ball = Vector3::from(truth.lower_ball_m);
        let across = (points.lower_front - ball).cross(&(points.lower_rear - ball));
        let normal_n = Vector3::from(truth.lower_ball_force_n).dot(&across.normalize());
        if truth.ball_normal_n.is_nan() {
            truth.ball_normal_n = normal_n * across.z.signum();
        }
    }

    /// Strut lengths at which spring, damper and stops carry what the tyre force calls for.
    fn find_strut_lengths(&self, states: &mut [TruthState], wheel: Wheel) -> Result<(), SimError> {
        let corner = &self.corners[wheel];
        let mut previous: Option<(f64, f64)> = None;
        for row in 0..states.len() {
            if states[row].wheels[wheel].strut_length_m.is_nan() {
                let turning = Turning::at(states, row, wheel);
                let state = &states[row];
                let length_m = self
                    .balanced_length(corner, state, wheel, previous, turning)
                    .map_err(|cause| linkage_error(state, wheel, cause))?;
                states[row].wheels[wheel].strut_length_m = length_m;
            }
            let state = &states[row];
            previous = Some((state.time_s, state.wheels[wheel].strut_length_m));
        }
        Ok(())
    }

    /// Newton's method on one strut's length; its rate is the step from the instant before, and
    /// zero at the first.
    fn balanced_length(
        &self,
        corner: &LinkedCorner,
        state: &TruthState,
        wheel: Wheel,
        previous: Option<(f64, f64)>,
        turning: Turning,
    ) -> Result<f64, SuspensionError> {
        let strut = &corner.strut;
        let mut length_m = previous.map_or(strut.design_length_m, |(_, length)| length);
        for _ in 0..50 {
            let rate_m_s = previous.map_or(0.0, |(time_s, last_m)| {
                (length_m - last_m) / (state.time_s - time_s)
            });
            let kind = ChannelKind::Strut;
            let stance = self.stance(state, wheel, length_m, rate_m_s, turning, kind)?;
            let missing_n = stance.members().sixth_n - strut.force(length_m, rate_m_s).total_n();
            let damping = previous.map_or(0.0, |(time_s, _)| {
                strut.damping_n_s_m / (state.time_s - time_s)
            });
            let step_m = -missing_n / (strut.stiffness_at(length_m) + damping);
            // A stop's edge makes the slope jump: no step longer than a centimetre.
            length_m += step_m.clamp(-0.01, 0.01);
            if step_m.abs() < 1e-9 {
                break;
            }
        }
        Ok(length_m)
    }

    fn stance(
        &self,
        state: &TruthState,
        wheel: Wheel,
        length_m: f64,
        rate_m_s: f64,
        turning: Turning,
        kind: ChannelKind,
    ) -> Result<Stance, SuspensionError> {
        let corner = &self.corners[wheel];
        let truth = &state.wheels[wheel];
        let pose = corner.corner.pose(length_m, corner.rack_m(state, wheel))?;
        // The ground is level where the motion does not tell its normal.
        let normal = truth
            .ground
            .map_or_else(|| state.up_body(), |ground| ground.normal_body.into());
        let load_n = truth.force_n[2];
        let compression_m = load_n / corner.tyre.vertical_stiffness_n_m;
        let radius_m = corner.tyre.unloaded_radius_m;
        let frame = TyreFrame::new(&pose, normal, radius_m, compression_m);
        let body = BodyMotion {
            specific_force_m_s2: state.specific_force_m_s2.into(),
            reference_m: Vector3::new(0.0, 0.0, self.cg_height_m),
            rate_rad_s: state.rate_rad_s.into(),
            rate_dot_rad_s2: state.rate_derivative_rad_s2.into(),
        };
        let mut motion = corner.motion(state, &body, &pose, normal, rate_m_s, turning);
        let wrench = wrench_on_ground(truth, &pose, &frame)
            .unwrap_or_else(|| corner.wrench(truth, math::asin(pose.spindle.dot(&normal))));
        motion.spin_rad_s = truth.angular_speed_rad_s;
        motion.spin_dot_rad_s2 = turning.spin_rad_s2;
        motion.axle_torque_n_m =
            corner.axle_torque_n_m(&wrench, compression_m, turning.spin_rad_s2);
        let statics = CornerStatics::new(
            &corner.corner,
            &pose,
            &frame,
            &corner.unsprung,
            &motion,
            kind,
        )?;
        Ok(Stance {
            pose,
            frame,
            statics,
            wrench,
        })
    }
}

impl LinkedCorner {
    fn new(vehicle: &Vehicle, wheel: Wheel) -> Result<Option<Self>, SimError> {
        let axle = vehicle.axle(wheel);
        let (true, Some(unsprung), Some(strut)) =
            (axle.has_hard_points(), &axle.unsprung, &axle.strut)
        else {
            return Ok(None);
        };
        let rack_m_rad = match vehicle.steering.rack_m_rad {
            _ if !wheel.is_front() => 0.0,
            Some(rack_m_rad) => rack_m_rad,
            None => return Ok(None),
        };
        let drivetrain = &vehicle.drivetrain;
        Ok(Some(Self {
            corner: Corner::of(vehicle, wheel).map_err(|cause| SimError::Linkage {
                wheel,
                time_s: 0.0,
                cause,
            })?,
            unsprung: unsprung.clone(),
            strut: strut.clone(),
            tyre: axle.tyre.clone(),
            rack_m_rad,
            drive_on_chassis: drivetrain.drive_reacted_by_chassis,
            brake_on_upright: if wheel.is_front() {
                drivetrain.front_brake_outboard
            } else {
                drivetrain.rear_brake_outboard
            },
        }))
    }

    /// The tyre's force with its moments as told; those that are not told go with the force: the
    /// tread's at this inclination, rolling resistance M_y = -f R_0 F_z, and the aligning moment of a
    /// trail that vanishes as the tyre begins to slide, M_z = -n F_y, n = n_0 (1 - |F_y|/(mu F_z)).
    fn wrench(&self, truth: &WheelTruth, inclination_rad: f64) -> Wrench {
        let [_, lateral_n, load_n] = truth.force_n;
        let load_n = load_n.max(0.0);
        let pressed_m = load_n / self.tyre.vertical_stiffness_n_m;
        let contact_length_m = 2.0 * (2.0 * self.tyre.unloaded_radius_m * pressed_m).sqrt();
        let sliding = lateral_n.abs() / (self.tyre.friction * load_n).max(1.0);
        let trail_m = TRAIL_OF_CONTACT_LENGTH * contact_length_m * (1.0 - sliding).max(0.0);
        let rolling = self.tyre.rolling_resistance
            * self.tyre.unloaded_radius_m
            * load_n
            * math::tanh(truth.angular_speed_rad_s);
        let tipping = -self.tyre.tread_moment_n_m(load_n, inclination_rad);
        let own = [tipping, -rolling, -trail_m * lateral_n];
        let moment = |axis: usize| match truth.moment_n_m[axis] {
            told if told.is_finite() => told,
            _ => own[axis],
        };
        Wrench {
            force_n: truth.force_n.into(),
            moment_n_m: Vector3::new(moment(0), moment(1), moment(2)),
        }
    }

    /// How the corner's parts move: with the wheel's acceleration where the motion tells it, otherwise
    /// as on flat ground.
    fn motion(
        &self,
        state: &TruthState,
        body: &BodyMotion,
        pose: &CornerPose,
        normal: Vector3<f64>,
        rate_m_s: f64,
        turning: Turning,
    ) -> CornerMotion {
        let truth = &state.wheels[self.corner.wheel];
        let load_n = truth.force_n[2];
        let rack = turning
            .steering_wheel
            .map(|of_angle| self.rack_m_rad * of_angle);
        match self.wheel_acceleration_m_s2(truth) {
            Some(own) => {
                let rate = Coordinates {
                    strut: rate_m_s,
                    rack: rack[0],
                };
                let force = own + state.up_body() * STANDARD_GRAVITY_M_S2;
                let path = self.corner.path(pose).wheel;
                let acceleration = Coordinates {
                    strut: path.strut_acceleration_m_s2(body, rate, rack[1], force),
                    rack: rack[1],
                };
                CornerMotion::on_path(&self.corner, pose, body, rate, acceleration)
            }
            None => {
                let on_body = CornerMotion::on_body(&self.corner, pose, body, rate_m_s, rack);
                if load_n > OFF_GROUND_N {
                    let along_normal = math::cos(state.bank_rad) * math::cos(state.grade_rad);
                    let gravity_m_s2 = STANDARD_GRAVITY_M_S2 * along_normal;
                    on_body.on_ground(&self.corner, pose, normal, gravity_m_s2)
                } else {
                    on_body
                }
            }
        }
    }

    /// Travel of the inner end of the tie rod, m.
    fn rack_m(&self, state: &TruthState, wheel: Wheel) -> f64 {
        self.rack_m_rad * state.steering_wheel_rad + state.wheels[wheel].rod_shift_m
    }

    /// Acceleration of the wheel centre without gravity, vehicle axes, where the motion tells it or
    /// the inertia of wheel and upright; otherwise the wheel rolls on flat ground.
    fn wheel_acceleration_m_s2(&self, truth: &WheelTruth) -> Option<Vector3<f64>> {
        let ground = truth.ground?;
        let outboard_kg = self.unsprung.wheel_mass_kg + self.unsprung.upright_mass_kg;
        (ground.centre_acceleration_m_s2.map(Vector3::from))
            .or_else(|| Some(Vector3::from(ground.unsprung_inertia_n?) / outboard_kg))
    }

    /// Torque of the half-shaft: what spins the wheel up against force and rolling resistance,
    /// where it is not a brake on the upright.
    fn axle_torque_n_m(&self, wrench: &Wrench, compression_m: f64, spin_dot: f64) -> f64 {
        let lever_m = self.tyre.unloaded_radius_m - compression_m;
        let torque = self.unsprung.wheel_spin_inertia_kg_m2 * spin_dot + lever_m * wrench.force_n.x
            - wrench.moment_n_m.y;
        let by_shaft = if torque > 0.0 {
            self.drive_on_chassis
        } else {
            !self.brake_on_upright
        };
        if by_shaft { torque } else { 0.0 }
    }
}

/// The tyre's wrench from its force and its moment about the wheel centre in vehicle axes, where the
/// motion tells both.
fn wrench_on_ground(truth: &WheelTruth, pose: &CornerPose, frame: &TyreFrame) -> Option<Wrench> {
    let ground = truth.ground?;
    let force = Vector3::from(ground.force_body_n);
    let moment = Vector3::from(ground.moment_body_n_m?);
    let arm = frame.contact_m - pose.wheel_centre_m;
    let tyre_from_vehicle = frame.vehicle_from_tyre.transpose();
    Some(Wrench {
        force_n: tyre_from_vehicle * force,
        moment_n_m: tyre_from_vehicle * (moment - arm.cross(&force)),
    })
}

fn forget_strut_lengths(states: &mut [TruthState]) {
    for wheel in states.iter_mut().flat_map(|state| &mut state.wheels.0) {
        wheel.strut_length_m = f64::NAN;
    }
}

/// Puts member forces, steer angle and ground where the wheel has none.
fn fill(truth: &mut WheelTruth, stance: &Stance) {
    let members = stance.members();
    let forces = [
        members.upper_front_n,
        members.upper_rear_n,
        members.lower_front_n,
        members.lower_rear_n,
        members.tie_rod_n,
    ];
    if truth.link_force_n.iter().any(|f| f.is_nan()) {
        truth.link_force_n = forces;
    }
    if truth.ball_normal_n.is_nan() {
        truth.ball_normal_n = stance.statics.ball_normal_n(&members);
    }
    if truth.steer_rad.is_nan() {
        truth.steer_rad = stance.pose.steer_rad();
    }
    truth.ground.get_or_insert_with(|| stance.ground());
}

/// Slope at a row, central where it can be.
pub(crate) fn slope(states: &[TruthState], row: usize, value: impl Fn(&TruthState) -> f64) -> f64 {
    let before = &states[row.saturating_sub(1)];
    let after = &states[(row + 1).min(states.len() - 1)];
    let span_s = after.time_s - before.time_s;
    let rise = value(after) - value(before);
    if span_s > 0.0 && rise.is_finite() {
        rise / span_s
    } else {
        0.0
    }
}

/// Second derivative of a state at one instant from those beside it; zero at the ends.
fn bend(states: &[TruthState], row: usize, value: impl Fn(&TruthState) -> f64) -> f64 {
    let Some([before, at, after]) = (row.checked_sub(1))
        .and_then(|first| states.get(first..=row + 1))
        .and_then(|three| <&[TruthState; 3]>::try_from(three).ok())
    else {
        return 0.0;
    };
    let to = (value(after) - value(at)) / (after.time_s - at.time_s);
    let from = (value(at) - value(before)) / (at.time_s - before.time_s);
    let bend = 2.0 * (to - from) / (after.time_s - before.time_s);
    if bend.is_finite() { bend } else { 0.0 }
}

fn linkage_error(state: &TruthState, wheel: Wheel, cause: SuspensionError) -> SimError {
    SimError::Linkage {
        wheel,
        time_s: state.time_s,
        cause,
    }
}
