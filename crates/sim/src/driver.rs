//! A driver and the four-wheel model: from a plan of speed and steering to a motion.

use model::chassis::four_wheel::{Inputs, Outputs, Parameters, Pose, State, outputs, step};
use model::suspension::Corner;
use model::vehicle::{Steering, Vehicle};
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use crate::imu::{rotate, transpose};
use crate::truth::fill_missing;
use crate::{TruthState, WheelTruth};

/// Step of the integration, s; every fifth state is kept.
const STEP_S: f64 = 0.001;
const STEPS_A_ROW: usize = 5;
/// Greatest hand-wheel angle and how fast a driver turns it.
const HAND_WHEEL_MAX_RAD: f64 = 3.5;
const HAND_WHEEL_RATE_RAD_S: f64 = 8.0;
/// Speed control: acceleration for a speed error, 1/s, and for its integral, 1/s^2.
const SPEED_GAIN: f64 = 1.5;
const SPEED_INTEGRAL: f64 = 0.4;
/// How fast a foot follows, s.
const FOOT_S: f64 = 0.12;
/// Path control: hand-wheel rate for an error of curvature, rad/s per 1/m.
const CURVATURE_INTEGRAL: f64 = 100.0;
/// Below this speed a driver who wants to stand holds the brake, m/s.
const STANDING_M_S: f64 = 0.05;

/// What the driver intends.
pub(crate) struct Plan {
    /// How long, s.
    pub(crate) duration_s: f64,
    /// Speed at the start, m/s.
    pub(crate) start_speed_m_s: f64,
    /// Speed over time, m/s.
    pub(crate) speed_m_s: fn(f64) -> f64,
    /// Steering.
    pub(crate) steering: Intent,
    /// East coordinate from which the surface is another, with its friction and stiffness as
    /// parts of the tyre's.
    pub(crate) surface_line: Option<SurfaceLine>,
}

/// What the driver does with the hand wheel.
pub(crate) enum Intent {
    /// Turns it so: rad over s.
    HandWheel(fn(f64) -> f64),
    /// Keeps a path of this curvature, 1/m over s.
    Curvature(fn(f64) -> f64),
}

/// Where the surface changes.
#[derive(Clone, Copy)]
pub(crate) struct SurfaceLine {
    pub(crate) east_m: f64,
    pub(crate) friction_scale: f64,
    pub(crate) stiffness_scale: f64,
}

/// A drive under way.
struct Drive<'a> {
    plan: &'a Plan,
    vehicle: &'a Vehicle,
    parameters: Parameters,
    gear: SteeringGear,
    state: State<f64>,
    pose: Pose,
    hand_wheel_rad: f64,
    speed_integral_m: f64,
    /// Acceleration that the pedals stand for now, m/s^2.
    pedal_m_s2: f64,
}

/// Drives a plan and tells its states, 200 a second.
pub(crate) fn drive(vehicle: &Vehicle, plan: &Plan) -> Vec<TruthState> {
    let parameters = Parameters::from_vehicle(vehicle);
    let mut drive = Drive {
        plan,
        vehicle,
        state: State::rolling(plan.start_speed_m_s, &parameters),
        parameters,
        gear: SteeringGear::new(vehicle),
        pose: Pose::default(),
        hand_wheel_rad: 0.0,
        speed_integral_m: 0.0,
        pedal_m_s2: 0.0,
    };
    let rows = (plan.duration_s / STEP_S / STEPS_A_ROW as f64).round() as usize;
    let mut states = Vec::with_capacity(rows + 1);
    for count in 0..=rows * STEPS_A_ROW {
        let time_s = count as f64 * STEP_S;
        let inputs = drive.inputs(time_s);
        if count.is_multiple_of(STEPS_A_ROW) {
            states.push(drive.truth(time_s, &inputs));
        }
        let next = step(&drive.parameters, &drive.state, &inputs, STEP_S);
        drive.pose = drive.pose.advanced(&drive.state, &next, STEP_S);
        drive.state = next;
    }
    fill_missing(&mut states);
    states
}

impl Drive<'_> {
    /// What the driver does now.
    fn inputs(&mut self, time_s: f64) -> Inputs<f64> {
        let mut inputs = Inputs::coasting();
        self.steer(time_s);
        inputs.steer_rad = self.gear.road_wheels_rad(self.hand_wheel_rad);
        self.pedals(time_s, &mut inputs);
        for wheel in 0..4 {
            if let Some(line) = self.beyond_the_line(wheel) {
                inputs.friction_scale[wheel] = line.friction_scale;
                inputs.stiffness_scale[wheel] = line.stiffness_scale;
            }
        }
        inputs
    }

    fn steer(&mut self, time_s: f64) {
        let wanted_rad = match self.plan.steering {
            Intent::HandWheel(angle) => angle(time_s),
            Intent::Curvature(path) => {
                // Steady-state geometry first, the rest by watching the path.
                let wanted = path(time_s);
                let speed_m_s = self.state.longitudinal_m_s.max(1.0);
                let driven = self.state.yaw_rate_rad_s / speed_m_s;
                self.hand_wheel_rad + CURVATURE_INTEGRAL * (wanted - driven) * STEP_S
            }
        };
        let most = HAND_WHEEL_RATE_RAD_S * STEP_S;
        let turn = (wanted_rad - self.hand_wheel_rad).clamp(-most, most);
        self.hand_wheel_rad =
            (self.hand_wheel_rad + turn).clamp(-HAND_WHEEL_MAX_RAD, HAND_WHEEL_MAX_RAD);
    }

    fn pedals(&mut self, time_s: f64, inputs: &mut Inputs<f64>) {
        let wanted = self.plan.speed_m_s;
        let speed_m_s = self.state.longitudinal_m_s;
        let error_m_s = wanted(time_s) - speed_m_s;
        let planned_m_s2 = (wanted(time_s + STEP_S) - wanted(time_s)) / STEP_S;
        // The integral learns resistance while cruising, not the lag of a launch.
        if planned_m_s2.abs() < 1.0 {
            self.speed_integral_m += error_m_s * STEP_S;
        }
        let mass_kg = self.parameters.mass_kg;
        let demand_m_s2 = planned_m_s2
            + SPEED_GAIN * error_m_s
            + SPEED_INTEGRAL * self.speed_integral_m
            + self.parameters.front.rolling_resistance * STANDARD_GRAVITY_M_S2;
        self.pedal_m_s2 += (demand_m_s2 - self.pedal_m_s2) * STEP_S / FOOT_S;
        let torque_n_m = mass_kg * self.pedal_m_s2 * self.parameters.rear.rolling_radius_m;
        let drivetrain = &self.vehicle.drivetrain;
        let standing = wanted(time_s) == 0.0 && speed_m_s.abs() < STANDING_M_S;
        let (drive_n_m, brake_n_m) = if standing {
            (0.0, 0.5 * mass_kg * self.parameters.rear.rolling_radius_m)
        } else {
            (torque_n_m.max(0.0), (-torque_n_m).max(0.0))
        };
        for wheel in 0..4 {
            let part = |front: f64| 0.5 * if wheel < 2 { front } else { 1.0 - front };
            inputs.drive_n_m[wheel] = drive_n_m * part(drivetrain.drive_split_front);
            inputs.brake_n_m[wheel] = brake_n_m * part(drivetrain.brake_split_front);
        }
    }

    fn beyond_the_line(&self, wheel: usize) -> Option<SurfaceLine> {
        let line = self.plan.surface_line?;
        let [x, y] = self.parameters.wheel_position_m(wheel);
        let (sin, cos) = self.pose.yaw_rad.sin_cos();
        (self.pose.east_m + x * cos - y * sin > line.east_m).then_some(line)
    }

    /// What is true now. The model's velocity is that of a point on the roll axis; the centre of
    /// gravity sways against it.
    fn truth(&self, time_s: f64, inputs: &Inputs<f64>) -> TruthState {
        let (state, p) = (&self.state, &self.parameters);
        let told = outputs(p, state, inputs);
        let sway_m = p.sprung_mass_kg / p.mass_kg * p.roll_arm_m;
        let (roll, pitch) = (state.roll_rad, state.pitch_rad);
        let level = TruthState {
            roll_rad: roll,
            pitch_rad: pitch,
            ..TruthState::default()
        };
        let lateral_m_s = state.lateral_m_s - sway_m * state.roll_rate_rad_s;
        let lateral_m_s2 = told.lateral_m_s2 - sway_m * told.rate.roll_rate_rad_s;
        let body_from_heading = transpose(&level.earth_from_body());
        let turn = |x, y, z| rotate(&body_from_heading, [x, y, z]);
        TruthState {
            time_s,
            position_m: [
                self.pose.east_m,
                self.pose.north_m,
                self.vehicle.body.cg_height_m,
            ],
            yaw_rad: self.pose.yaw_rad,
            velocity_body_m_s: turn(state.longitudinal_m_s, lateral_m_s, 0.0),
            rate_rad_s: body_rates(
                [roll, pitch],
                [
                    state.roll_rate_rad_s,
                    state.pitch_rate_rad_s,
                    state.yaw_rate_rad_s,
                ],
            ),
            rate_derivative_rad_s2: [f64::NAN; 3],
            specific_force_m_s2: turn(told.longitudinal_m_s2, lateral_m_s2, p.gravity_m_s2),
            acceleration_m_s2: turn(told.longitudinal_m_s2, lateral_m_s2, 0.0),
            hand_wheel_rad: self.hand_wheel_rad,
            wheels: PerWheel::from_fn(|wheel| self.wheel_truth(wheel, inputs, &told)),
            ..level
        }
    }

    fn wheel_truth(&self, wheel: Wheel, inputs: &Inputs<f64>, told: &Outputs<f64>) -> WheelTruth {
        let i = wheel.index();
        let axle = self.parameters.axle(i);
        let spin = self.state.wheel_speed_rad_s[i];
        let file = if wheel.is_front() {
            &self.vehicle.front.tyre
        } else {
            &self.vehicle.rear.tyre
        };
        let rolling = axle.rolling_resistance * axle.rolling_radius_m * told.load_n[i];
        WheelTruth {
            force_n: [told.longitudinal_n[i], told.lateral_n[i], told.load_n[i]],
            moment_n_m: [0.0, -rolling * spin.tanh(), told.aligning_n_m[i]],
            angular_speed_rad_s: spin,
            steer_rad: inputs.steer_rad[i] + axle.roll_steer * self.state.roll_rad,
            slip_angle_rad: told.slip_angle_rad[i],
            friction: file.friction * inputs.friction_scale[i],
            ..WheelTruth::default()
        }
    }
}

/// Body rates from roll and pitch and the rates of roll, pitch and yaw.
pub(crate) fn body_rates(
    [roll_rad, pitch_rad]: [f64; 2],
    [roll_rate, pitch_rate, yaw_rate]: [f64; 3],
) -> [f64; 3] {
    let (sin_roll, cos_roll) = roll_rad.sin_cos();
    let (sin_pitch, cos_pitch) = pitch_rad.sin_cos();
    [
        roll_rate - yaw_rate * sin_pitch,
        pitch_rate * cos_roll + yaw_rate * sin_roll * cos_pitch,
        -pitch_rate * sin_roll + yaw_rate * cos_roll * cos_pitch,
    ]
}

/// From the hand wheel to the road wheels: by rack and hard-points, by maps, or by a ratio.
enum SteeringGear {
    Rack {
        corners: Box<[Corner; 2]>,
        rack_m_rad: f64,
    },
    File(Steering),
}

impl SteeringGear {
    fn new(vehicle: &Vehicle) -> Self {
        let corner = |wheel| Corner::of(vehicle, wheel).ok();
        match (
            corner(Wheel::FrontLeft),
            corner(Wheel::FrontRight),
            vehicle.steering.rack_m_rad,
        ) {
            (Some(left), Some(right), Some(rack_m_rad)) => Self::Rack {
                corners: Box::new([left, right]),
                rack_m_rad,
            },
            _ => Self::File(vehicle.steering.clone()),
        }
    }

    /// Steer angle of each road wheel, in the design position of the suspension.
    fn road_wheels_rad(&self, hand_wheel_rad: f64) -> [f64; 4] {
        match self {
            Self::Rack {
                corners,
                rack_m_rad,
            } => {
                let angle = |corner: &Corner| {
                    corner
                        .pose(corner.design_strut_length_m(), rack_m_rad * hand_wheel_rad)
                        .map_or(0.0, |pose| pose.steer_rad())
                };
                let [left, right] = &**corners;
                [angle(left), angle(right), 0.0, 0.0]
            }
            Self::File(gear) => {
                let mapped = |map: &[[f64; 2]]| {
                    between(map, hand_wheel_rad).unwrap_or(hand_wheel_rad / gear.ratio)
                };
                [
                    mapped(&gear.left_map_rad),
                    mapped(&gear.right_map_rad),
                    0.0,
                    0.0,
                ]
            }
        }
    }
}

/// Linear interpolation in an ascending map, straight on beyond its ends; `None` if it has fewer
/// than two points.
fn between(map: &[[f64; 2]], x: f64) -> Option<f64> {
    let after = map.partition_point(|point| point[0] <= x);
    let upper = after.clamp(1, map.len().checked_sub(1).filter(|last| *last > 0)?);
    let ([x0, y0], [x1, y1]) = (map[upper - 1], map[upper]);
    Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0))
}
