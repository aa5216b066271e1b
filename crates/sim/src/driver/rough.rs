//! Driving on any ground, with the 14-degree-of-freedom vehicle on its linkages.

use model::chassis::linked::{
    Inputs, Outputs, Parameters, State, Suspension, at_rest, carried, outputs, step,
};
use model::nalgebra::{Matrix3, Vector3};
use model::road::Ground;
use model::steering::Toe;
use model::suspension::Corner;
use model::vehicle::Vehicle;
use sample::{PerWheel, Wheel};

use super::car::{DECAY_A_STEP, decay_1_s};
use super::pedals::Pedals;
use super::{
    CURVATURE_INTEGRAL, STEERING_WHEEL_MAX_RAD, STEERING_WHEEL_RATE_RAD_S, STEP_S, SteeringGear,
    YIELD_RAD_S, rod_shift_m,
};
use crate::truth::fill_missing;
use crate::{Motion, SimError, TruthState, WheelGround, WheelMotion, WheelTruth};

/// How fast hands and steering gear follow, rad/s: critically damped, so that rack and wheels have
/// an acceleration.
const HANDS_RAD_S: f64 = 40.0;
/// How far ahead a driver looks who follows a line: at least, m, and seconds of driving.
const LOOK_AHEAD_M: f64 = 2.5;
const LOOK_AHEAD_S: f64 = 0.6;
/// Rows a second that a motion must have, and the steps.
const ROWS_PER_S: [u32; 2] = [200, 1000];

/// A number over time, s, or over a place, m.
pub type Profile = Box<dyn Fn(f64) -> f64>;

/// What a driver does with the steering wheel.
pub enum Course {
    /// Turns it so: rad, left positive, over s.
    SteeringWheel(Profile),
    /// Keeps a path of this curvature: 1/m, left positive, over s.
    Curvature(Profile),
    /// Follows a line from west to east: north over east, m.
    Line(Profile),
}

/// A force on the body from outside, such as that of a tow rope.
pub struct Hitch {
    /// Where it acts, vehicle axes, m: origin on the design ground below the centre of gravity.
    pub point_m: [f64; 3],
    /// The force, vehicle axes, N, over time, s.
    pub force_n: Box<dyn Fn(f64) -> [f64; 3]>,
}

/// What a driver intends on rough ground.
pub struct RoughPlan {
    /// How long, s.
    pub duration_s: f64,
    /// States a second, 200 to 1000; a divisor of 1000.
    pub rows_per_s: u32,
    /// Start: east and north, m.
    pub start_m: [f64; 2],
    /// Heading at the start from east, left positive, rad.
    pub start_yaw_rad: f64,
    /// Speed at the start, m/s; negative drives backwards.
    pub start_speed_m_s: f64,
    /// Speed over time, m/s; negative is the reverse gear, which is engaged at any speed.
    pub speed_m_s: Profile,
    /// Steering.
    pub course: Course,
    /// A force from outside.
    pub hitch: Option<Hitch>,
}

/// A drive under way.
struct Drive<'a, G: ?Sized> {
    vehicle: &'a Vehicle,
    ground: &'a G,
    plan: &'a RoughPlan,
    parameters: Parameters,
    gear: SteeringGear,
    toe: Toe,
    pedals: Pedals,
    backwards: bool,
    /// Steering wheel as the driver wants it, and as it is with its rate.
    wanted_rad: f64,
    steering_wheel: [f64; 2],
    /// Steering-wheel angle for one of the front wheels.
    ratio: f64,
    state: State,
}

/// Drives a plan over a ground and tells its motion, with the forces in the linkage, to the plan's
/// end or until the vehicle tips over.
///
/// # Errors
/// A plan without 200 to 1000 rows a second, a vehicle file without springs or unsprung masses, or a
/// ground on which the vehicle cannot stand or that drives a linkage out of its reach.
pub fn drive_rough<G: Ground + ?Sized>(
    name: &str,
    vehicle: &Vehicle,
    ground: &G,
    plan: &RoughPlan,
) -> Result<Motion, SimError> {
    let [least, most] = ROWS_PER_S;
    let rows_per_s = plan.rows_per_s;
    if !(least..=most).contains(&rows_per_s) || !most.is_multiple_of(rows_per_s) {
        return Err(SimError::BadParameter {
            name: "rows_per_s".to_owned(),
            value: f64::from(rows_per_s),
            expected: "200, 250, 500 or 1000",
        });
    }
    let mut drive = Drive::new(vehicle, ground, plan)?;
    let steps_a_row = (most / rows_per_s) as usize;
    let rows = (plan.duration_s * f64::from(rows_per_s)).round() as usize;
    let mut states = Vec::with_capacity(rows + 1);
    let tipping_rad = vehicle.tipping_angle_rad();
    let mut tips_over = false;
    for count in 0..=rows * steps_a_row {
        let time_s = count as f64 * STEP_S;
        let inputs = drive.inputs(time_s);
        let at_this_time = |cause| SimError::Rough { time_s, cause };
        if count.is_multiple_of(steps_a_row) {
            let state = drive.truth(time_s, &inputs).map_err(at_this_time)?;
            tips_over = state.roll_rad.abs() > tipping_rad;
            if tips_over {
                break;
            }
            states.push(state);
        }
        drive.advance(&inputs).map_err(at_this_time)?;
    }
    fill_missing(&mut states);
    let mut motion = Motion::new(name, states)?.with_end(tips_over);
    motion.complete(vehicle)?;
    Ok(motion)
}

impl<'a, G: Ground + ?Sized> Drive<'a, G> {
    fn new(vehicle: &'a Vehicle, ground: &'a G, plan: &'a RoughPlan) -> Result<Self, SimError> {
        const TURN_RAD: f64 = 0.1;
        let parameters = Parameters::from_vehicle(vehicle)?;
        let gear = SteeringGear::new(vehicle);
        let [left, right, ..] = gear.road_wheels_rad(TURN_RAD, None);
        let [east_m, north_m] = plan.start_m;
        let rest = at_rest(&parameters, ground, [east_m, north_m, plan.start_yaw_rad])?;
        Ok(Self {
            vehicle,
            ground,
            plan,
            gear,
            toe: Toe::of(vehicle),
            pedals: Pedals::default(),
            backwards: plan.start_speed_m_s < 0.0,
            wanted_rad: 0.0,
            steering_wheel: [0.0; 2],
            ratio: 2.0 * TURN_RAD / (left + right),
            state: rest.rolling(plan.start_speed_m_s, &parameters),
            parameters,
        })
    }

    /// What the driver does now. Steering wheel and rack accelerate with it until the next step.
    fn inputs(&mut self, time_s: f64) -> Inputs {
        self.steer(time_s);
        let [angle, rate] = self.steering_wheel;
        let follow = |wanted: f64, angle: f64, rate: f64| {
            HANDS_RAD_S * (HANDS_RAD_S * (wanted - angle) - 2.0 * rate)
        };
        let turned = follow(self.wanted_rad, angle, rate);
        let road_wheels = self.gear.road_wheels_rad(angle, None);
        let rack_m_rad = self.vehicle.steering.rack_m_rad.unwrap_or(0.0);
        let yielded_rad = self.yielded_rad();
        let rack_acceleration = std::array::from_fn(|i| {
            let corner = &self.parameters.corners[i];
            match &corner.suspension {
                Suspension::Wishbone(linkage) if corner.wheel.is_front() => {
                    let bent = yielded_rad.map_or(0.0, |angles| {
                        let rod = [self.state.strut_m[i], rack_m_rad * angle, rack_m_rad * rate];
                        self.rod_acceleration_m_s2(i, linkage, rod, angles[i])
                    });
                    rack_m_rad * turned + bent
                }
                Suspension::Wishbone(_) => 0.0,
                Suspension::Straight(_) => {
                    let yielded = yielded_rad.filter(|_| corner.wheel.is_front());
                    let wanted = road_wheels[i] + yielded.map_or(0.0, |angles| angles[i]);
                    follow(wanted, self.state.rack[i], self.state.rack_rate[i])
                }
            }
        });
        self.steering_wheel = [
            angle + (rate + 0.5 * turned * STEP_S) * STEP_S,
            rate + turned * STEP_S,
        ];
        let [drive_n_m, brake_n_m] = self.torques(time_s);
        let hitch = self.plan.hitch.as_ref();
        Inputs {
            rack_acceleration,
            drive_n_m,
            brake_n_m,
            hitch_force_n: hitch.map_or(Vector3::zeros(), |hitch| (hitch.force_n)(time_s).into()),
            hitch_m: hitch.map_or(Vector3::zeros(), |hitch| hitch.point_m.into()),
        }
    }

    /// Angles by which the front wheels yield to their lateral forces, rad; `None` on rigid links.
    fn yielded_rad(&self) -> Option<[f64; 2]> {
        if self.toe.is_rigid() {
            return None;
        }
        let free = Inputs {
            rack_acceleration: [0.0; 4],
            drive_n_m: [0.0; 4],
            brake_n_m: [0.0; 4],
            hitch_force_n: Vector3::zeros(),
            hitch_m: Vector3::zeros(),
        };
        let found = outputs(&self.parameters, &self.state, &free, self.ground).ok()?;
        Some([0, 1].map(|side| self.toe.angle_rad(side, found.wheels[side].force_n.y)))
    }

    /// Acceleration of the inner end of a tie rod beside the rack, which goes, critically damped, where the wheel has
    /// yielded by an angle, m/s^2. `rod`: length of the strut, travel and speed of the rack.
    fn rod_acceleration_m_s2(
        &self,
        i: usize,
        linkage: &Corner,
        [strut_m, rack_m, rack_m_s]: [f64; 3],
        angle_rad: f64,
    ) -> f64 {
        let wanted_m = rod_shift_m(linkage, strut_m, rack_m, angle_rad).unwrap_or(0.0);
        let shift_m = self.state.rack[i] - rack_m;
        let rate_m_s = self.state.rack_rate[i] - rack_m_s;
        YIELD_RAD_S * (YIELD_RAD_S * (wanted_m - shift_m) - 2.0 * rate_m_s)
    }

    /// Speed, at least a walking pace in the direction of the gear.
    fn course_speed_m_s(&self) -> f64 {
        let speed_m_s = self.state.velocity_m_s.x;
        if self.backwards {
            speed_m_s.min(-1.0)
        } else {
            speed_m_s.max(1.0)
        }
    }

    fn steer(&mut self, time_s: f64) {
        let speed_m_s = self.course_speed_m_s();
        let wanted_rad = match &self.plan.course {
            Course::SteeringWheel(angle) => angle(time_s),
            Course::Curvature(path) => {
                let driven = self.state.rate_rad_s.z / speed_m_s;
                self.wanted_rad + CURVATURE_INTEGRAL * (path(time_s) - driven) * STEP_S
            }
            Course::Line(line) => {
                let [east, north, _] = self.state.position_m.into();
                let ahead_m = LOOK_AHEAD_M.max(LOOK_AHEAD_S * speed_m_s.abs());
                let (sin, cos) = math::sin_cos(self.state.attitude_rad.z);
                let way = ahead_m * speed_m_s.signum() * cos.signum();
                let to = [way, line(east + way) - north];
                let aside_m = cos * to[1] - sin * to[0];
                let curvature = 2.0 * aside_m / (to[0] * to[0] + to[1] * to[1]);
                curvature * self.steer_of_curvature_rad_m(speed_m_s) * self.ratio
            }
        };
        let most = STEERING_WHEEL_RATE_RAD_S * STEP_S;
        let turn = (wanted_rad - self.wanted_rad).clamp(-most, most);
        self.wanted_rad =
            (self.wanted_rad + turn).clamp(-STEERING_WHEEL_MAX_RAD, STEERING_WHEEL_MAX_RAD);
    }

    /// Steer angle for one unit of curvature: L + v^2 m (b/C_f - a/C_r)/L, with the cornering
    /// stiffnesses of the axles.
    fn steer_of_curvature_rad_m(&self, speed_m_s: f64) -> f64 {
        let body = &self.vehicle.body;
        let wheelbase_m = self.vehicle.wheelbase_m();
        let stiffness = |axle: &model::vehicle::Axle| 2.0 * axle.tyre.cornering_stiffness_n_rad;
        let balance = body.cg_to_rear_axle_m / stiffness(&self.vehicle.front)
            - body.front_axle_to_cg_m / stiffness(&self.vehicle.rear);
        let drift = body.mass_kg * balance * speed_m_s * speed_m_s / wheelbase_m;
        (wheelbase_m + drift).max(0.3 * wheelbase_m)
    }

    /// Drive and brake torque; the reverse gear turns the direction of the drive.
    fn torques(&mut self, time_s: f64) -> [[f64; 4]; 2] {
        let wanted = [time_s, time_s + STEP_S].map(|time_s| (self.plan.speed_m_s)(time_s));
        let backwards = match wanted {
            [0.0, next] => next < 0.0 || (next == 0.0 && self.backwards),
            [now, _] => now < 0.0,
        };
        if backwards != self.backwards {
            self.backwards = backwards;
            self.pedals = Pedals::default();
        }
        let gear = if backwards { -1.0 } else { 1.0 };
        let radius_m = self.parameters.corners[Wheel::RearLeft.index()].rolling_radius_m;
        let speed_m_s = gear * self.state.velocity_m_s.x;
        let wanted = wanted.map(|speed| gear * speed);
        let torques = self
            .pedals
            .torques(self.vehicle, wanted, speed_m_s, radius_m);
        [torques[0].map(|drive| gear * drive), torques[1]]
    }

    /// Moves on, in as many steps as the wheels' slip asks for.
    fn advance(&mut self, inputs: &Inputs) -> Result<(), model::Error> {
        let parts = (STEP_S * decay_1_s(self.vehicle) / DECAY_A_STEP)
            .ceil()
            .max(1.0);
        for _ in 0..parts as u32 {
            let part_s = STEP_S / parts;
            self.state = step(&self.parameters, &self.state, inputs, self.ground, part_s)?;
        }
        Ok(())
    }

    /// What is true now, at the whole vehicle's centre of gravity.
    fn truth(&self, time_s: f64, inputs: &Inputs) -> Result<TruthState, model::Error> {
        let (p, state) = (&self.parameters, &self.state);
        let found = outputs(p, state, inputs, self.ground)?;
        let arm = Vector3::new(0.0, 0.0, self.vehicle.body.cg_height_m) - p.sprung_cg_m;
        let (rate, turning) = (state.rate_rad_s, found.rate.rate_rad_s);
        let [roll_rad, pitch_rad, yaw_rad] = state.attitude_rad.into();
        let mut truth = TruthState {
            time_s,
            roll_rad,
            pitch_rad,
            yaw_rad,
            velocity_body_m_s: (state.velocity_m_s + rate.cross(&arm)).into(),
            rate_rad_s: rate.into(),
            rate_derivative_rad_s2: turning.into(),
            specific_force_m_s2: (found.specific_force_m_s2
                + turning.cross(&arm)
                + rate.cross(&rate.cross(&arm)))
            .into(),
            acceleration_m_s2: [f64::NAN; 3],
            steering_wheel_rad: self.steering_wheel[0],
            hitch_force_n: (self.plan.hitch.as_ref()).map(|hitch| (hitch.force_n)(time_s)),
            ..TruthState::default()
        };
        let earth_from_body = truth.earth_from_body().into_inner();
        truth.position_m = (state.position_m + earth_from_body * arm).into();
        [truth.bank_rad, truth.grade_rad] = self.bank_grade_rad(&found, &earth_from_body);
        let mut wheels = [WheelTruth::default(); 4];
        for (i, wheel) in wheels.iter_mut().enumerate() {
            *wheel = self.wheel_truth(inputs, &found, &earth_from_body, i)?;
        }
        truth.wheels = PerWheel(wheels);
        Ok(truth)
    }

    fn wheel_truth(
        &self,
        inputs: &Inputs,
        found: &Outputs,
        earth_from_body: &Matrix3<f64>,
        i: usize,
    ) -> Result<WheelTruth, model::Error> {
        let (state, wheel, corner) = (&self.state, &found.wheels[i], &self.parameters.corners[i]);
        let earth = |v: Vector3<f64>| (earth_from_body * v).into();
        let from_cg = wheel.centre_m - self.parameters.sprung_cg_m;
        let links = carried(&self.parameters, state, inputs, found, i)?;
        let steer_rad = math::atan2(-wheel.spindle.x, wheel.spindle.y);
        Ok(WheelTruth {
            force_n: wheel.force_n.into(),
            moment_n_m: wheel.moment_n_m.into(),
            angular_speed_rad_s: wheel.spin_rad_s,
            steer_rad,
            rod_shift_m: match (&corner.suspension, corner.wheel.is_front()) {
                (Suspension::Wishbone(_), true) if !self.toe.is_rigid() => {
                    let rack_m_rad = self.vehicle.steering.rack_m_rad.unwrap_or(0.0);
                    state.rack[i] - rack_m_rad * self.steering_wheel[0]
                }
                _ => 0.0,
            },
            slip_angle_rad: math::atan(wheel.slip_tangent),
            longitudinal_slip: f64::NAN,
            friction: corner.tyre_file.friction * wheel.contact.friction,
            strut_length_m: state.strut_m[i],
            link_force_n: links.map_or([f64::NAN; 5], |links| {
                let [a, b, c, d, rod, _] = links.members.to_vector().into();
                [a, b, c, d, rod]
            }),
            lower_ball_m: links.map_or([f64::NAN; 3], |links| links.pose.lower_ball_m.into()),
            ball_normal_n: links.map_or(f64::NAN, |links| links.ball_normal_n),
            ground: Some(WheelGround {
                normal_body: wheel.vehicle_from_contact.column(2).into_owned().into(),
                force_body_n: (wheel.vehicle_from_contact * wheel.force_n).into(),
                moment_body_n_m: Some(wheel.centre_moment_n_m.into()),
                spindle_body: wheel.spindle.into(),
                centre_acceleration_m_s2: Some(wheel.acceleration_m_s2.into()),
                unsprung_inertia_n: Some(wheel.inertia_n.into()),
                ground_height_m: Some(wheel.contact.ground_height_m),
            }),
            motion: Some(WheelMotion {
                centre_m: (state.position_m + earth_from_body * from_cg).into(),
                velocity_m_s: earth(wheel.velocity_m_s),
                acceleration_m_s2: earth(wheel.acceleration_m_s2),
                contact_m: wheel.contact.point_m.into(),
                strut_rate_m_s: state.strut_rate_m_s[i],
                strut_acceleration_m_s2: found.rate.strut_rate_m_s[i],
                strut_force_n: wheel.strut.total_n(),
            }),
            ..WheelTruth::default()
        })
    }

    /// Bank and grade, seen along the heading, of the plane through the ground below the wheels, rad.
    fn bank_grade_rad(&self, found: &Outputs, earth_from_body: &Matrix3<f64>) -> [f64; 2] {
        let (sin, cos) = math::sin_cos(self.state.attitude_rad.z);
        let (mut ahead, mut left) = ([0.0; 2], [0.0; 2]);
        for (i, wheel) in found.wheels.iter().enumerate() {
            let place = earth_from_body * (wheel.centre_m - self.parameters.sprung_cg_m);
            let height = wheel.contact.ground_height_m;
            let along = if i < 2 { 1.0 } else { -1.0 };
            let side = Wheel::ALL[i].side();
            ahead[0] += along * height;
            ahead[1] += along * (cos * place.x + sin * place.y);
            left[0] += side * height;
            left[1] += side * (cos * place.y - sin * place.x);
        }
        let (uphill, rising) = (ahead[0] / ahead[1], left[0] / left[1]);
        [
            math::atan2(rising, math::hypot(1.0, uphill)),
            -math::atan(uphill),
        ]
    }
}
