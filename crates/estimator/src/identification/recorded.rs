//! What an estimator gave for a drive, as identification takes it.

use model::steering::SteeringGear;
use model::vehicle::{Vehicle, pressures_of_axles};
use sample::{PerWheel, Wheel};

use super::inclination::{Inclinations, WheelRow};
use super::signals::spread;
use super::{Drive, aligning, camber, slip, toe, tyre};

/// Interval of the rows of tyre data that are used.
const TYRE_STRIDE: usize = 10;
/// Smallest speed at which slip angles are used, m/s.
const SLIP_SPEED_MIN_M_S: f64 = 3.0;

/// Estimates of the motion on an even time grid, `NaN` where unknown; all columns have the same
/// length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Interval of the grid, s.
    pub dt_s: f64,
    /// Velocity of the centre of gravity along and across the heading, m/s.
    pub velocity_m_s: [Vec<f64>; 2],
    /// Acceleration of the centre of gravity less gravity, body axes, m/s^2.
    pub acceleration_m_s2: [Vec<f64>; 3],
    /// Sideslip angle at the centre of gravity, rad.
    pub sideslip_rad: Vec<f64>,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: Vec<f64>,
    /// Roll angle, rad.
    pub roll_rad: Vec<f64>,
    /// Pitch angle, rad.
    pub pitch_rad: Vec<f64>,
    /// Bank and grade of the ground, right side down and nose down positive, rad.
    pub slope_rad: [Vec<f64>; 2],
    /// Steer angle of each road wheel, rad.
    pub steer_rad: PerWheel<Vec<f64>>,
    /// Slip angle of each tyre, rad.
    pub slip_angle_rad: PerWheel<Vec<f64>>,
    /// Longitudinal slip of each wheel.
    pub longitudinal_slip: PerWheel<Vec<f64>>,
    /// What the estimator has learnt of the steering encoder's zero: how much further left the front
    /// wheels stand than the encoder says, rad.
    pub steer_offset_rad: Vec<f64>,
}

/// Estimates of the tyre forces on the grid of the motion, wheel axes; empty where unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TyreForces {
    /// Forces along the wheel, across it and upwards, N.
    pub force_n: PerWheel<[Vec<f64>; 3]>,
    /// Moment about the upward axis through the wheel centre, N m.
    pub aligning_n_m: PerWheel<Vec<f64>>,
    /// Whether the fusion filter gave them, which knows the vehicle file.
    pub fused: bool,
}

/// A drive with the vehicle that made it.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The vehicle, with its tyres at the pressures of the drive.
    pub vehicle: Vehicle,
    /// The vehicle of the file, whose tyres are at their nominal pressures.
    pub(super) nominal: Vehicle,
    /// Mean inflation pressure of each axle's tyres, Pa; `NaN` where it is unknown.
    pub(super) pressures_pa: [f64; 2],
    /// Its motion and the wheels' loads.
    pub drive: Drive,
    /// Whether the forces are from the fusion filter.
    pub fused: bool,
    /// Standard deviation of the vertical acceleration, m/s^2; NaN if it is unknown.
    pub vertical_m_s2: f64,
    /// Forces along the wheel and across it, N.
    forces_n: PerWheel<[Vec<f64>; 2]>,
    slip_angle_rad: PerWheel<Vec<f64>>,
    longitudinal_slip: PerWheel<Vec<f64>>,
    steer_rad: PerWheel<Vec<f64>>,
    slope_rad: [Vec<f64>; 2],
    aligning_n_m: PerWheel<Vec<f64>>,
    toe_rad: [Vec<f64>; 2],
}

impl Recorded {
    /// The same drive with the measured steer angles of the front wheels less those of rack and linkage, left and
    /// right, rad.
    #[must_use]
    pub fn with_toe(mut self, toe_rad: [Vec<f64>; 2]) -> Self {
        self.toe_rad = toe_rad;
        self
    }

    /// The same drive on tyres with mean inflation pressures, Pa; `NaN` where a pressure is unknown.
    #[must_use]
    pub fn with_pressures(mut self, pressures_pa: &PerWheel<f64>) -> Self {
        self.vehicle = self.nominal.at_pressures(pressures_pa);
        self.pressures_pa = pressures_of_axles(pressures_pa);
        self
    }

    /// Difference of the steer angle, and force of a front wheel (0 left, 1 right).
    #[must_use]
    pub fn toe(&self, side: usize) -> toe::Data {
        let [_, lateral_n] = &self.forces_n.0[side];
        toe::Data {
            difference_rad: self.toe_rad[side].clone(),
            lateral_n: lateral_n.clone(),
            load_n: self.drive.loads_n.0[side].clone(),
        }
    }

    /// The drive that these estimates describe.
    #[must_use]
    pub fn new(vehicle: Vehicle, motion: Motion, forces: TyreForces) -> Self {
        let [forward, left] = &motion.velocity_m_s;
        let [along, across, up] = &motion.acceleration_m_s2;
        let vertical_m_s2 = spread(up);
        // The axes lean with the body, but the accelerations of interest are horizontal. The motion of
        // a vehicle without hard-points has no attitude, and its accelerations are horizontal.
        let horizontal = |along: &[f64], lean: &[f64], sign: f64| -> Vec<f64> {
            let rows = along.iter().zip(up).zip(lean);
            rows.map(|((a, z), angle)| {
                if z.is_nan() && angle.is_nan() {
                    return *a;
                }
                a * math::cos(*angle) + sign * z * math::sin(*angle)
            })
            .collect()
        };
        let speed = forward.iter().zip(left).map(|(x, y)| math::hypot(*x, *y));
        let TyreForces {
            force_n,
            aligning_n_m,
            fused,
        } = forces;
        let (mut loads_n, mut forces_n) = (PerWheel::default(), PerWheel::default());
        for (wheel, [x, y, z]) in Wheel::ALL.into_iter().zip(force_n.0) {
            loads_n[wheel] = z;
            forces_n[wheel] = [x, y];
        }
        let drive = Drive {
            dt_s: motion.dt_s,
            speed_m_s: speed.collect(),
            lateral_m_s2: horizontal(across, &motion.roll_rad, -1.0),
            longitudinal_m_s2: horizontal(along, &motion.pitch_rad, 1.0),
            steer_rad: as_read(&vehicle, &motion.steer_rad, &motion.steer_offset_rad),
            sideslip_rad: motion.sideslip_rad,
            yaw_rate_rad_s: motion.yaw_rate_rad_s,
            roll_rad: motion.roll_rad,
            pitch_rad: motion.pitch_rad,
            loads_n,
        };
        Self {
            nominal: vehicle.clone(),
            pressures_pa: [f64::NAN; 2],
            vehicle,
            drive,
            fused,
            vertical_m_s2,
            forces_n,
            slip_angle_rad: motion.slip_angle_rad,
            longitudinal_slip: motion.longitudinal_slip,
            steer_rad: motion.steer_rad,
            slope_rad: motion.slope_rad,
            aligning_n_m,
            toe_rad: <[Vec<f64>; 2]>::default(),
        }
    }

    /// Force and slip of an axle's two tyres, one after the other; 0 is the front axle.
    #[must_use]
    pub fn tyre(&self, axle: usize) -> tyre::Data {
        let mut data = tyre::Data {
            dt_s: self.drive.dt_s * TYRE_STRIDE as f64,
            ..tyre::Data::default()
        };
        for wheel in [2 * axle, 2 * axle + 1] {
            let [_, lateral] = &self.forces_n.0[wheel];
            for row in (0..lateral.len()).step_by(TYRE_STRIDE) {
                if self.drive.speed_m_s[row] > SLIP_SPEED_MIN_M_S {
                    data.load_n.push(self.drive.loads_n.0[wheel][row]);
                    data.slip_angle_rad.push(self.slip_angle_rad.0[wheel][row]);
                    data.lateral_n.push(lateral[row]);
                }
            }
        }
        data
    }

    /// Longitudinal slip and force of an axle's two wheels; 0 is the front axle. Rows below 3 m/s are unknown.
    #[must_use]
    pub fn rolling(&self, axle: usize) -> [slip::Data; 2] {
        [2 * axle, 2 * axle + 1].map(|wheel| {
            let [along, across] = &self.forces_n.0[wheel];
            slip::Data {
                slip: self.rolling_values(&self.longitudinal_slip.0[wheel]),
                longitudinal_n: along.clone(),
                lateral_n: across.clone(),
                load_n: self.drive.loads_n.0[wheel].clone(),
            }
        })
    }

    /// A column, with rows below 3 m/s unknown.
    fn rolling_values(&self, column: &[f64]) -> Vec<f64> {
        let rows = column.iter().zip(&self.drive.speed_m_s);
        rows.map(|(value, speed)| while_rolling(*value, *speed))
            .collect()
    }

    /// Aligning moment and force of an axle's two wheels; 0 is the front axle. Rows below 3 m/s are unknown.
    #[must_use]
    pub fn aligning(&self, axle: usize) -> [aligning::Data; 2] {
        let wheels = wheels_of(axle);
        let inclinations = self.inclinations(axle);
        std::array::from_fn(|side| {
            let wheel = wheels[side];
            let [along, across] = &self.forces_n[wheel];
            let moment = |row: usize| {
                let moment = self.about_contact(wheel, row, inclinations[side][row]);
                while_rolling(moment, self.drive.speed_m_s[row])
            };
            aligning::Data {
                aligning_n_m: (0..across.len()).map(moment).collect(),
                longitudinal_n: along.clone(),
                lateral_n: across.clone(),
                load_n: self.drive.loads_n[wheel].clone(),
            }
        })
    }

    /// Slip angle, inclination and force of an axle's two wheels; 0 is the front axle. Rows below 3 m/s are unknown.
    #[must_use]
    pub fn cambered(&self, axle: usize) -> [camber::Data; 2] {
        let wheels = wheels_of(axle);
        let mut inclinations = self.inclinations(axle);
        std::array::from_fn(|side| {
            let wheel = wheels[side];
            let [along, across] = &self.forces_n[wheel];
            let inclination_rad = std::mem::take(&mut inclinations[side]);
            let length_m = self.vehicle.axle(wheel).tyre.relaxation_length_m;
            let [contact, centre] =
                [1.0, 0.0].map(|part| self.slip_tangent(wheel, &inclination_rad, part));
            camber::Data {
                slip_tangent: self.relaxed(&contact, length_m),
                moved_slip_tangent: [
                    self.relaxed(&contact, camber::LONGER * length_m),
                    self.relaxed(&centre, length_m),
                ],
                inclination_rad,
                longitudinal_n: along.clone(),
                lateral_n: across.clone(),
                load_n: self.drive.loads_n[wheel].clone(),
            }
        })
    }

    /// Inclination of the wheels of an axle to the ground, rad.
    fn inclinations(&self, axle: usize) -> [Vec<f64>; 2] {
        let model = Inclinations::new(&self.vehicle);
        let wheels = wheels_of(axle);
        let mut both = [Vec::new(), Vec::new()];
        for row in 0..self.drive.rows() {
            let rows = wheels.map(|wheel| {
                let [along, across] = &self.forces_n[wheel];
                WheelRow {
                    force_n: [along, across, &self.drive.loads_n[wheel]]
                        .map(|column| at(column, row)),
                    steer_rad: at(&self.steer_rad[wheel], row),
                }
            });
            let lean_rad = at(&self.drive.roll_rad, row) - at(&self.slope_rad[0], row);
            let found = model.of_axle(wheels, rows, lean_rad);
            for (column, inclination) in both.iter_mut().zip(found) {
                column.push(inclination);
            }
        }
        both
    }

    /// Aligning moment about the contact point and the normal of the ground, N m. The estimate M_c is about the wheel
    /// centre and the z axis of the wheel-carrier frame. The contact point lies in the plane of the wheel, so that it is at
    /// (-R n_x, 0, -R) in this frame, and the force across the wheel has a part of the load:
    ///
    /// M_z = M_c + R n_x (F_y + gamma F_z) - gamma f R_0 F_z
    ///
    /// | symbol | name | unit |
    /// |---|---|---|
    /// | R | unloaded radius R_0 less the compression of the tyre | m |
    /// | n_x | normal of the ground along the x axis of the frame | - |
    /// | gamma | inclination of the wheel to the normal | rad |
    /// | F_y, F_z | lateral force and load, contact frame | N |
    /// | f | rolling resistance, whose moment is about the lateral axis of the contact frame | - |
    fn about_contact(&self, wheel: Wheel, row: usize, inclination_rad: f64) -> f64 {
        let tyre = &self.vehicle.axle(wheel).tyre;
        let [_, across] = &self.forces_n[wheel];
        let load_n = at(&self.drive.loads_n[wheel], row);
        let radius_m = tyre.unloaded_radius_m - load_n / tyre.vertical_stiffness_n_m;
        let over_ground =
            |angle: &[f64], slope: usize| at(angle, row) - at(&self.slope_rad[slope], row);
        let roll = over_ground(&self.drive.roll_rad, 0);
        let pitch = over_ground(&self.drive.pitch_rad, 1);
        let (sin, cos) = math::sin_cos(at(&self.steer_rad[wheel], row));
        // Nose down, the wheel's x axis points into the ground.
        let normal_x = roll * sin - pitch * cos;
        let across_n = at(across, row) + inclination_rad * load_n;
        let rolling_n_m = tyre.rolling_resistance * tyre.unloaded_radius_m * load_n;
        at(&self.aligning_n_m[wheel], row) + radius_m * normal_x * across_n
            - inclination_rad * rolling_n_m
    }

    /// Tangent of the slip angle of a wheel: that of the velocity of the wheel centre, with `part` of what the rate of the
    /// inclination moves the contact point sideways, tan alpha + part R gamma'/V.
    fn slip_tangent(&self, wheel: Wheel, inclination_rad: &[f64], part: f64) -> Vec<f64> {
        let tyre = &self.vehicle.axle(wheel).tyre;
        let tangent = |(row, angle): (usize, &f64)| {
            let sides = [row.wrapping_sub(1), row + 1].map(|row| at(inclination_rad, row));
            let rate_rad_s = (sides[1] - sides[0]) / (2.0 * self.drive.dt_s);
            let load_n = at(&self.drive.loads_n[wheel], row);
            let radius_m = tyre.unloaded_radius_m - load_n / tyre.vertical_stiffness_n_m;
            math::tan(*angle) + part * radius_m * rate_rad_s / self.drive.speed_m_s[row]
        };
        let angles = self.slip_angle_rad[wheel].iter().enumerate();
        angles.map(tangent).collect()
    }

    /// Tangents of slip angles, delayed by a relaxation length sigma, m: sigma s' = V (tan alpha - s).
    fn relaxed(&self, tangents: &[f64], length_m: f64) -> Vec<f64> {
        let mut slip = f64::NAN;
        let rows = tangents.iter().zip(&self.drive.speed_m_s);
        rows.map(|(tangent, speed)| {
            let part = 1.0 - math::exp(-speed * self.drive.dt_s / length_m.max(1e-6));
            slip = match slip.is_finite() && part.is_finite() {
                true if tangent.is_finite() => slip + part * (tangent - slip),
                _ => *tangent,
            };
            while_rolling(slip, *speed)
        })
        .collect()
    }

    /// Moment of the tyre forces about the centre of gravity, sum of x F_y - y F_x, N m; NaN without
    /// forces.
    #[must_use]
    pub fn yaw_moment_n_m(&self) -> Vec<f64> {
        let body = &self.vehicle.body;
        (0..self.drive.rows())
            .map(|row| {
                let moment = |wheel: Wheel| {
                    let [along, across] = &self.forces_n[wheel];
                    let (Some(along), Some(across)) = (along.get(row), across.get(row)) else {
                        return f64::NAN;
                    };
                    let (sin, cos) = math::sin_cos(self.steer_rad[wheel][row]);
                    let force = [along * cos - across * sin, along * sin + across * cos];
                    let (ahead_m, track_m) = if wheel.is_front() {
                        (body.front_axle_to_cg_m, self.vehicle.front.track_m)
                    } else {
                        (-body.cg_to_rear_axle_m, self.vehicle.rear.track_m)
                    };
                    ahead_m * force[1] - 0.5 * wheel.side() * track_m * force[0]
                };
                Wheel::ALL.into_iter().map(moment).sum()
            })
            .collect()
    }
}

/// Wheels of an axle, left first; 0 is the front axle.
fn wheels_of(axle: usize) -> [Wheel; 2] {
    if axle == 0 {
        [Wheel::FrontLeft, Wheel::FrontRight]
    } else {
        [Wheel::RearLeft, Wheel::RearRight]
    }
}

/// A value of a column; NaN where the column was not recorded.
fn at(column: &[f64], row: usize) -> f64 {
    column.get(row).copied().unwrap_or(f64::NAN)
}

/// A value of a wheel that rolls; NaN below the smallest speed.
fn while_rolling(value: f64, speed_m_s: f64) -> f64 {
    if speed_m_s > SLIP_SPEED_MIN_M_S {
        value
    } else {
        f64::NAN
    }
}

/// Mean steer angle of the front wheels by the encoder alone. The estimator's zero of it wanders
/// while it is learnt, and what tyres differ from the vehicle file's in a bend goes into it too.
fn as_read(vehicle: &Vehicle, steer_rad: &PerWheel<Vec<f64>>, learnt_rad: &[f64]) -> Vec<f64> {
    let gear = SteeringGear::from_vehicle(vehicle).ok();
    let ratio = vehicle.steering.ratio;
    let rows = steer_rad.0[0].iter().zip(&steer_rad.0[1]).zip(learnt_rad);
    rows.map(|((left, right), learnt)| {
        let mean = 0.5 * (left + right);
        let Some(gear) = gear.as_ref().filter(|_| mean.is_finite()) else {
            return mean - learnt;
        };
        let wheel_rad = gear.steering_wheel_rad(mean);
        mean + mean_road_rad(gear, wheel_rad - learnt * ratio) - mean_road_rad(gear, wheel_rad)
    })
    .collect()
}

/// Mean steer angle of the front wheels at an angle of the steering wheel, rad.
pub(super) fn mean_road_rad(gear: &SteeringGear, steering_wheel_rad: f64) -> f64 {
    let [left, right, ..] = gear.road_wheels(steering_wheel_rad, 0.0);
    0.5 * (left + right)
}

#[cfg(test)]
mod tests;
