//! A driver and a car: from a plan of speed and steering to a motion.

mod car;
mod four_wheel;
mod fourteen_dof;
mod pedals;
pub(crate) mod rough;

use model::steering::Toe;
use model::suspension::Corner;
use model::vehicle::{Steering, Vehicle};
use sample::Wheel;

use crate::slope::Slope;
use crate::truth::fill_missing;
use crate::{SimError, TruthState};
use car::{Car, Commands};
use pedals::Pedals;

/// Step of the integration, s; every fifth state is kept.
const STEP_S: f64 = 0.001;
const STEPS_A_ROW: usize = 5;
/// States of a motion a second.
pub(crate) const STATES_PER_S: u32 = 200;
/// Greatest steering-wheel angle and how fast a driver turns it.
const STEERING_WHEEL_MAX_RAD: f64 = 3.5;
const STEERING_WHEEL_RATE_RAD_S: f64 = 8.0;
/// Path control: steering-wheel rate for an error of curvature, rad/s per 1/m.
const CURVATURE_INTEGRAL: f64 = 100.0;
/// How fast a front wheel follows the force that bends its steering links, rad/s.
const YIELD_RAD_S: f64 = 100.0;
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
    /// The slope that it is driven on; none for level ground.
    pub(crate) slope: Option<Slope>,
}

/// What the driver does with the steering wheel.
pub(crate) enum Intent {
    /// Turns it so: rad over s.
    SteeringWheel(fn(f64) -> f64),
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
    car: Car,
    gear: SteeringGear,
    toe: Toe,
    /// Steer angle of the front wheels by toe compliance and play, rad.
    yielded_rad: [f64; 2],
    steering_wheel_rad: f64,
    pedals: Pedals,
}

/// Drives a plan and tells its states in the ground's axes, 200 a second, to its end or until the
/// vehicle tips over, and whether it did.
///
/// # Errors
/// Springs that cannot carry the vehicle.
pub(crate) fn drive(vehicle: &Vehicle, plan: &Plan) -> Result<(Vec<TruthState>, bool), SimError> {
    let mut drive = Drive {
        plan,
        vehicle,
        car: Car::new(vehicle, plan.start_speed_m_s)?,
        gear: SteeringGear::new(vehicle),
        toe: Toe::of(vehicle),
        yielded_rad: [0.0; 2],
        steering_wheel_rad: 0.0,
        pedals: Pedals::default(),
    };
    let rows = (plan.duration_s / STEP_S / STEPS_A_ROW as f64).round() as usize;
    let mut states = Vec::with_capacity(rows + 1);
    let tipping_rad = vehicle.tipping_angle_rad();
    let mut tips_over = false;
    for count in 0..=rows * STEPS_A_ROW {
        let time_s = count as f64 * STEP_S;
        let commands = drive.commands(time_s);
        if count.is_multiple_of(STEPS_A_ROW) {
            let state = TruthState {
                time_s,
                steering_wheel_rad: drive.steering_wheel_rad,
                bank_rad: commands.bank_rad,
                grade_rad: commands.grade_rad,
                ..drive.car.truth(&commands)
            };
            tips_over = state.roll_rad.abs() > tipping_rad;
            if tips_over {
                break;
            }
            states.push(state);
        }
        drive.car.advance(&commands, STEP_S);
        drive.give_way(&commands);
    }
    fill_missing(&mut states);
    Ok((states, tips_over))
}

impl Drive<'_> {
    /// What the driver does now.
    fn commands(&mut self, time_s: f64) -> Commands {
        let mut commands = Commands::coasting();
        if let Some(slope) = &self.plan.slope {
            let yaw_rad = self.car.place().yaw_rad;
            [commands.bank_rad, commands.grade_rad] = slope.bank_grade_rad(yaw_rad);
        }
        self.steer(time_s);
        let struts = self.car.strut_lengths_m();
        commands.steer_rad = self.gear.road_wheels_rad(self.steering_wheel_rad, struts);
        if !self.toe.is_rigid() {
            let turned = (self.gear).turned(self.steering_wheel_rad, struts, self.yielded_rad);
            (commands.steer_rad, commands.rod_shift_m) = turned;
        }
        let wanted = [time_s, time_s + STEP_S].map(self.plan.speed_m_s);
        [commands.drive_n_m, commands.brake_n_m] = self.pedals.torques(
            self.vehicle,
            wanted,
            self.car.speed_m_s(),
            self.car.rolling_radius_m(),
        );
        for wheel in Wheel::ALL {
            if let Some(line) = self.beyond_the_line(wheel) {
                commands.friction_scale[wheel.index()] = line.friction_scale;
                commands.stiffness_scale[wheel.index()] = line.stiffness_scale;
            }
        }
        commands
    }

    /// Lets the front wheels follow their lateral forces.
    fn give_way(&mut self, commands: &Commands) {
        if self.toe.is_rigid() {
            return;
        }
        let wheels = self.car.truth(commands).wheels.0;
        for (side, yielded) in self.yielded_rad.iter_mut().enumerate() {
            let target = self.toe.angle_rad(side, wheels[side].force_n[1]);
            *yielded += (1.0 - math::exp(-YIELD_RAD_S * STEP_S)) * (target - *yielded);
        }
    }

    fn steer(&mut self, time_s: f64) {
        let wanted_rad = match self.plan.steering {
            Intent::SteeringWheel(angle) => angle(time_s),
            Intent::Curvature(path) => {
                // Steady-state geometry first, the rest by watching the path.
                let wanted = path(time_s);
                let speed_m_s = self.car.speed_m_s().max(1.0);
                let driven = self.car.yaw_rate_rad_s() / speed_m_s;
                self.steering_wheel_rad + CURVATURE_INTEGRAL * (wanted - driven) * STEP_S
            }
        };
        let most = STEERING_WHEEL_RATE_RAD_S * STEP_S;
        let turn = (wanted_rad - self.steering_wheel_rad).clamp(-most, most);
        self.steering_wheel_rad =
            (self.steering_wheel_rad + turn).clamp(-STEERING_WHEEL_MAX_RAD, STEERING_WHEEL_MAX_RAD);
    }

    fn beyond_the_line(&self, wheel: Wheel) -> Option<SurfaceLine> {
        let line = self.plan.surface_line?;
        let [x, y] = self.vehicle.wheel_place_m(wheel);
        let place = self.car.place();
        let (sin, cos) = math::sin_cos(place.yaw_rad);
        (place.east_m + x * cos - y * sin > line.east_m).then_some(line)
    }
}

/// Body rates from roll and pitch and the rates of roll, pitch and yaw.
pub(crate) fn body_rates(
    [roll_rad, pitch_rad]: [f64; 2],
    [roll_rate, pitch_rate, yaw_rate]: [f64; 3],
) -> [f64; 3] {
    let (sin_roll, cos_roll) = math::sin_cos(roll_rad);
    let (sin_pitch, cos_pitch) = math::sin_cos(pitch_rad);
    [
        roll_rate - yaw_rate * sin_pitch,
        pitch_rate * cos_roll + yaw_rate * sin_roll * cos_pitch,
        -pitch_rate * sin_roll + yaw_rate * cos_roll * cos_pitch,
    ]
}

/// From the steering wheel to the road wheels: by rack and hard-points, by maps, or by a ratio.
enum SteeringGear {
    Rack {
        corners: Box<[Corner; 4]>,
        rack_m_rad: f64,
    },
    File(Steering),
}

impl SteeringGear {
    fn new(vehicle: &Vehicle) -> Self {
        let corners: Vec<Corner> = Wheel::ALL
            .into_iter()
            .filter_map(|wheel| Corner::of(vehicle, wheel).ok())
            .collect();
        match (corners.try_into(), vehicle.steering.rack_m_rad) {
            (Ok(corners), Some(rack_m_rad)) => Self::Rack {
                corners: Box::new(corners),
                rack_m_rad,
            },
            _ => Self::File(vehicle.steering.clone()),
        }
    }

    /// Steer angle of each road wheel, rad, whose front wheels have yielded by an angle, and the displacement of the
    /// inner ends of the tie rods beside the rack that has the same effect, m.
    fn turned(
        &self,
        steering_wheel_rad: f64,
        strut_lengths_m: Option<[f64; 4]>,
        yielded_rad: [f64; 2],
    ) -> ([f64; 4], [f64; 4]) {
        let mut steer_rad = self.road_wheels_rad(steering_wheel_rad, strut_lengths_m);
        let mut shift_m = [0.0; 4];
        for (side, angle) in yielded_rad.into_iter().enumerate() {
            let Self::Rack {
                corners,
                rack_m_rad,
            } = self
            else {
                steer_rad[side] += angle;
                continue;
            };
            let corner = &corners[side];
            let length_m = strut_lengths_m
                .map_or_else(|| corner.design_strut_length_m(), |lengths| lengths[side]);
            let rack_m = rack_m_rad * steering_wheel_rad;
            let Some(shift) = rod_shift_m(corner, length_m, rack_m, angle) else {
                continue;
            };
            if let Ok(pose) = corner.pose(length_m, rack_m + shift) {
                steer_rad[side] = pose.steer_rad();
                shift_m[side] = shift;
            }
        }
        (steer_rad, shift_m)
    }

    /// Steer angle of each road wheel, with what springing in adds where strut lengths are known;
    /// else, or where a strut is out of the linkage's reach, in the design position.
    fn road_wheels_rad(
        &self,
        steering_wheel_rad: f64,
        strut_lengths_m: Option<[f64; 4]>,
    ) -> [f64; 4] {
        match self {
            Self::Rack {
                corners,
                rack_m_rad,
            } => Wheel::ALL.map(|wheel| {
                let corner = &corners[wheel.index()];
                let rack_m = if wheel.is_front() {
                    rack_m_rad * steering_wheel_rad
                } else {
                    0.0
                };
                let design_m = corner.design_strut_length_m();
                strut_lengths_m
                    .and_then(|lengths_m| corner.pose(lengths_m[wheel.index()], rack_m).ok())
                    .or_else(|| corner.pose(design_m, rack_m).ok())
                    .map_or(0.0, |pose| pose.steer_rad())
            }),
            Self::File(gear) => {
                let mapped = |map: &[[f64; 2]]| {
                    between(map, steering_wheel_rad).unwrap_or(steering_wheel_rad / gear.ratio)
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

/// Displacement of the inner end of a tie rod beside the rack that turns a wheel by an angle, m; `None` where the
/// linkage does not reach.
pub(crate) fn rod_shift_m(
    corner: &Corner,
    length_m: f64,
    rack_m: f64,
    angle_rad: f64,
) -> Option<f64> {
    let pose = corner.pose(length_m, rack_m).ok()?;
    let per_rack = corner.rates(&pose).rack.rotation.z;
    (per_rack != 0.0).then(|| angle_rad / per_rack)
}

/// Linear interpolation in an ascending map, straight on beyond its ends; `None` if it has fewer
/// than two points.
fn between(map: &[[f64; 2]], x: f64) -> Option<f64> {
    let after = map.partition_point(|point| point[0] <= x);
    let upper = after.clamp(1, map.len().checked_sub(1).filter(|last| *last > 0)?);
    let ([x0, y0], [x1, y1]) = (map[upper - 1], map[upper]);
    Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0))
}
