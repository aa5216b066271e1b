//! How much further the vehicle can go: the largest lateral force over load that the ground and the centre of
//! gravity allow, and what follows from it for lateral acceleration, speed, side slope and grade.
//!
//! y is the specific force of the vehicle along the ground to the left over that along the normal of the ground:
//! the lateral acceleration over g on level ground, the tangent of a side slope at rest. r is the lateral force of
//! an axle over its load in the contact frame. In a steady turn
//!
//! y = c r - d r |r|
//!
//! c is near 1. It differs between the axles because aligning moments resist the turn. d is the effect of the steer
//! angle of the front wheels, whose lateral force is then also drag: its moment about the centre of gravity, the
//! smaller load of the front axle, and the cosine. The steer angle grows with the slip angle, so that
//! d = `bend` F_z/C of the front axle with the cornering stiffness C that `grip.rs` estimates, and 0 of the rear one.
//! The friction coefficient mu of the axle (`grip.rs`) ends the turn at r = mu:
//!
//! Y_axle = c mu - d mu^2
//!
//! The load-transfer ratio is e + k y, with e of a centre of gravity beside the middle plane. The inner wheels are
//! off the ground at Y_roll = (1 - s e)/k for a force to the side s. The vehicle file gives
//! k = 2 (h + h_roll)/t with the height h of the centre of gravity, its lateral shift h_roll by the body's roll and
//! the track t. Measured ratios correct c and k by scalar Kalman filters. The limit Y is the smallest of the three.
//!
//! Each limit has a standard deviation from those of mu, c, d and k; the lower bound is `bound_sigma` of them below
//! the limit, but not below what the lower bound of the friction (`friction_min`) allows. Without a friction there
//! is that bound alone.

mod grade;
mod ratio;

use model::vehicle::Vehicle;
use sample::{
    AxleGrip, Limit, LimitedBy, Limits, LimitsUnknown, LogTime, Motion, PerWheel,
    STANDARD_GRAVITY_M_S2, TyreForce,
};

use crate::tuning::LimitsTuning;

use grade::Climb;
use ratio::RatioFilter;

/// Input of one step.
#[derive(Clone, Copy, Debug)]
pub struct LimitsInput<'a> {
    /// Since the last one, s.
    pub dt: f64,
    /// Motion with bank and grade.
    pub motion: &'a Motion,
    /// Load-transfer ratio.
    pub load_transfer_ratio: f64,
    /// Tyre forces, contact frame.
    pub forces: &'a PerWheel<TyreForce>,
}

/// Fading means. All but the present force have one time constant, so that their ratios are of the same instants.
#[derive(Clone, Copy, Debug, Default)]
struct Means {
    /// Lateral force and load of each axle, N.
    axles_n: [[f64; 2]; 2],
    /// Specific force along the ground to the left and along its normal, m/s^2.
    specific: [f64; 2],
    /// Specific force along the ground to the left with a short memory, m/s^2.
    present: f64,
    load_transfer_ratio: f64,
    speed_m_s: f64,
    yaw_rate_rad_s: f64,
    bank_rad: f64,
}

/// Limits of a vehicle with the force filter.
#[derive(Clone, Debug)]
pub struct LimitsEstimator {
    tuning: LimitsTuning,
    curve_radius_m: Option<f64>,
    means: Option<Means>,
    /// c of both axles.
    axles: [RatioFilter; 2],
    /// Slip angle of the front axle for a lateral force as large as its load by the vehicle file, rad.
    slip_rad: f64,
    /// d of both axles.
    bend: [f64; 2],
    /// k.
    roll: RatioFilter,
    /// k by the vehicle file.
    roll_file: f64,
    /// e: load-transfer ratio of the standing vehicle.
    standing_ratio: f64,
    climb: Climb,
}

/// A limit of y with its lower bound.
#[derive(Clone, Copy, Debug)]
struct End {
    by: LimitedBy,
    limit: Limit,
}

impl LimitsEstimator {
    /// Limits by the vehicle file. `curve_radius_m`: the curve whose speed is wanted.
    #[must_use]
    pub fn new(vehicle: &Vehicle, curve_radius_m: Option<f64>, tuning: &LimitsTuning) -> Self {
        let mut new = Self {
            tuning: *tuning,
            curve_radius_m,
            means: None,
            axles: [0, 1].map(|axle| {
                RatioFilter::new(tuning.axle_ratio[axle], tuning.axle_ratio_sigma[axle])
            }),
            slip_rad: 0.0,
            bend: [0.0; 2],
            roll: RatioFilter::new(1.0, 1.0),
            roll_file: 1.0,
            standing_ratio: 0.0,
            climb: Climb::new(vehicle),
        };
        new.load(vehicle);
        new
    }

    /// The same of a vehicle whose mass properties have changed: what is known of the load transfer is forgotten.
    pub fn load(&mut self, vehicle: &Vehicle) {
        let body = &vehicle.body;
        let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
        let track_m = (b * vehicle.front.track_m + a * vehicle.rear.track_m) / (a + b);
        let sprung = vehicle.sprung();
        let stiffness = vehicle.front.roll_stiffness_n_m_rad + vehicle.rear.roll_stiffness_n_m_rad;
        let moment = sprung.mass_kg * STANDARD_GRAVITY_M_S2 * vehicle.roll_arm_m().max(0.0);
        // A body without roll stiffness does not roll in the model.
        let roll_rad = if stiffness > moment {
            moment / (stiffness - moment)
        } else {
            0.0
        };
        let shift_m = sprung.mass_kg / body.mass_kg * vehicle.roll_arm_m().max(0.0) * roll_rad;
        let part = self.tuning.height_part[usize::from(vehicle.is_guessed("body.cg_height_m"))];
        self.roll_file = 2.0 * (body.cg_height_m + shift_m) / track_m;
        self.roll = RatioFilter::new(self.roll_file, part * self.roll_file);
        self.standing_ratio = -2.0 * body.cg_y_m / track_m;
        self.climb = Climb::new(vehicle);
        self.load_tyres(vehicle);
    }

    /// The same on other tyres.
    pub fn load_tyres(&mut self, vehicle: &Vehicle) {
        let tyre = &vehicle.front.tyre;
        let load_n = vehicle.static_load_n(sample::Wheel::FrontLeft);
        let at_load = math::powf(load_n / tyre.reference_load_n, tyre.load_exponent);
        self.slip_rad = load_n / (tyre.cornering_stiffness_n_rad * at_load);
        self.bend[0] = self.tuning.bend * self.slip_rad;
    }

    /// Takes one instant.
    pub fn step(&mut self, input: &LimitsInput<'_>) {
        let Some(now) = Means::of(input) else {
            self.means = None;
            return;
        };
        let t = self.tuning;
        let parts = [t.mean_s, t.present_s].map(|time_s| (input.dt / time_s).min(1.0));
        let means = match self.means {
            Some(before) => before.toward(&now, parts),
            None => now,
        };
        self.means = Some(means);
        let turns = means.lateral_ratio();
        for (axle, filter) in self.axles.iter_mut().enumerate() {
            let [force_n, load_n] = means.axles_n[axle];
            if load_n > t.load_min_n && means.speed_m_s > t.speed_min_m_s {
                let ratio = force_n / load_n;
                filter.take(
                    ratio,
                    turns + self.bend[axle] * ratio * ratio.abs(),
                    t.ratio_sigma,
                    t.axle_walk * input.dt.sqrt(),
                );
            }
        }
        let moved = means.load_transfer_ratio - self.standing_ratio;
        let walk = t.roll_walk * input.dt.sqrt();
        self.roll.take(turns, moved, t.ratio_sigma, walk);
    }

    /// The limits at `now` by the grip of both axles.
    #[must_use]
    pub fn limits(&mut self, now: LogTime, grip: [&AxleGrip; 2]) -> Limits {
        self.bend[0] = self.tuning.bend * self.slip_rad / grip[0].stiffness_factor;
        let Some(means) = &self.means else {
            return Limits::unknown(now, LimitsUnknown::NoForces);
        };
        let side = means.present.signum();
        let grips = [0, 1].map(|axle| self.grip_end(axle, grip[axle]));
        let unknown =
            (grips.iter().all(|end| end.limit.value.is_nan())).then_some(LimitsUnknown::Grip);
        let present = smallest([grips[0], grips[1], self.roll_end(side)]);
        let either = smallest([
            grips[0],
            grips[1],
            self.roll_end(self.standing_ratio.signum()),
        ]);
        let mut limits = Limits {
            unknown,
            grip_used: grip[0].utilisation.max(grip[1].utilisation),
            limited_by: present.by,
            ..Limits::unknown(now, LimitsUnknown::Grip)
        };
        let g = STANDARD_GRAVITY_M_S2;
        let (sine, cosine) = math::sin_cos(means.bank_rad);
        let used = means.present.abs();
        limits.lateral_m_s2 = (present.limit).map(|y| not_negative(y * cosine * g - used));
        // Largest horizontal acceleration to a side on the present bank.
        let turning = |y: f64, toward: f64| not_negative((y * cosine - toward * sine) * g / cosine);
        let curvature = means.yaw_rate_rad_s / means.speed_m_s;
        if means.speed_m_s > self.tuning.speed_min_m_s
            && curvature.abs() > self.tuning.curvature_min_1_m
        {
            let toward = curvature.signum();
            limits.speed_m_s = smallest([grips[0], grips[1], self.roll_end(toward)])
                .limit
                .map(|y| (turning(y, toward) / curvature.abs()).sqrt());
        }
        if let Some(radius_m) = self.curve_radius_m {
            limits.curve_radius_m = radius_m;
            let worse = sine.signum();
            limits.curve_speed_m_s = (either.limit).map(|y| (turning(y, worse) * radius_m).sqrt());
        }
        limits.side_slope_rad = either.limit.map(math::atan);
        limits.grade_rad = self.grade(grip);
        limits
    }

    /// Where the grip of an axle ends.
    fn grip_end(&self, axle: usize, grip: &AxleGrip) -> End {
        let t = &self.tuning;
        let (filter, bend) = (&self.axles[axle], self.bend[axle]);
        // Beyond its vertex the parabola is no model.
        let at = |friction: f64| {
            let friction = if bend > 0.0 {
                friction.min(filter.value() / (2.0 * bend))
            } else {
                friction
            };
            friction * (filter.value() - bend * friction)
        };
        let mut limit = Limit {
            value: f64::NAN,
            at_least: at(grip.friction_min) - t.bound_sigma * grip.friction_min * filter.sigma(),
        };
        if let (Some(friction), Some(sigma)) = (grip.friction, grip.friction_sigma) {
            let sigma = t.friction_sigma * sigma;
            limit.value = at(friction);
            let unused = friction * (1.0 - grip.utilisation).max(0.0);
            let parts = [
                (filter.value() - 2.0 * bend * friction).max(0.0) * sigma,
                friction * filter.sigma(),
                friction * unused * t.bend_part * bend,
                friction * t.friction_part,
            ];
            let square: f64 = parts.iter().map(|part| part * part).sum();
            let bound = limit.value - t.bound_sigma * square.sqrt();
            limit.at_least = limit.at_least.max(bound);
        }
        limit.at_least = limit.at_least.max(0.0);
        End {
            by: [LimitedBy::FrontGrip, LimitedBy::RearGrip][axle],
            limit,
        }
    }

    /// Where the inner wheels of a force to a side lift.
    fn roll_end(&self, side: f64) -> End {
        let [k, sigma] = [self.roll.value(), self.roll.sigma()];
        let reach = (1.0 - side * self.standing_ratio).max(0.0);
        End {
            by: LimitedBy::Rollover,
            limit: Limit {
                value: reach / k,
                at_least: reach / (k + self.tuning.bound_sigma * sigma),
            },
        }
    }

    /// Steepest grade. The height of the centre of gravity is that of the vehicle file, corrected as k is.
    fn grade(&self, grip: [&AxleGrip; 2]) -> Limit {
        let t = &self.tuning;
        let part = self.roll.value() / self.roll_file;
        let spread = t.bound_sigma * self.roll.sigma() / self.roll_file;
        let friction = grip.map(|axle| axle.friction.unwrap_or(f64::NAN));
        let least = grip.map(|axle| match (axle.friction, axle.friction_sigma) {
            (Some(friction), Some(sigma)) => {
                let sigma = math::hypot(t.friction_sigma * sigma, t.friction_part * friction);
                (friction - t.bound_sigma * sigma).max(axle.friction_min)
            }
            _ => axle.friction_min,
        });
        Limit {
            value: self.climb.steepest_rad(friction, part),
            at_least: [part - spread, part + spread]
                .map(|part| self.climb.steepest_rad(least, part))
                .into_iter()
                .fold(f64::INFINITY, f64::min),
        }
    }
}

/// The value, or zero where it is negative; `NaN` stays.
fn not_negative(value: f64) -> f64 {
    if value < 0.0 { 0.0 } else { value }
}

/// The smallest limit; unknown where the grip of both axles is: an axle whose grip is unknown uses less of it than the
/// other one. Its bound is the smallest bound.
fn smallest(ends: [End; 3]) -> End {
    let known = ends[..2].iter().any(|end| !end.limit.value.is_nan());
    let least = |of: fn(&End) -> f64| ends.iter().map(of).fold(f64::INFINITY, f64::min);
    let value = least(|end| end.limit.value);
    let first = ends.iter().find(|end| known && end.limit.value <= value);
    End {
        by: first.map_or(LimitedBy::Unknown, |end| end.by),
        limit: Limit {
            value: if known { value } else { f64::NAN },
            at_least: least(|end| end.limit.at_least),
        },
    }
}

impl Means {
    /// The values of one instant; `None` where one is unknown.
    fn of(input: &LimitsInput<'_>) -> Option<Self> {
        let motion = input.motion;
        let axle = |left: usize| {
            let [left, right] = [left, left + 1].map(|wheel| &input.forces.0[wheel].force_n);
            [left[1] + right[1], left[2] + right[2]]
        };
        let specific = specific_force(motion);
        let now = Self {
            axles_n: [axle(0), axle(2)],
            specific,
            present: specific[0],
            load_transfer_ratio: input.load_transfer_ratio,
            speed_m_s: motion.velocity_x_m_s,
            yaw_rate_rad_s: motion.rate_rad_s[2],
            bank_rad: motion.bank_rad,
        };
        let all = now.axles_n.as_flattened().iter().chain(&now.specific);
        let rest = [
            now.load_transfer_ratio,
            now.speed_m_s,
            now.yaw_rate_rad_s,
            now.bank_rad,
        ];
        all.chain(&rest)
            .all(|value| value.is_finite())
            .then_some(now)
    }

    /// These means after an instant with these weights.
    fn toward(&self, now: &Self, [part, present]: [f64; 2]) -> Self {
        let mean = |before: f64, now: f64| before + part * (now - before);
        Self {
            axles_n: [0, 1].map(|i| [0, 1].map(|k| mean(self.axles_n[i][k], now.axles_n[i][k]))),
            specific: [0, 1].map(|i| mean(self.specific[i], now.specific[i])),
            present: self.present + present * (now.present - self.present),
            load_transfer_ratio: mean(self.load_transfer_ratio, now.load_transfer_ratio),
            speed_m_s: mean(self.speed_m_s, now.speed_m_s),
            yaw_rate_rad_s: mean(self.yaw_rate_rad_s, now.yaw_rate_rad_s),
            bank_rad: mean(self.bank_rad, now.bank_rad),
        }
    }

    /// y.
    fn lateral_ratio(&self) -> f64 {
        self.specific[0] / self.specific[1].max(1.0)
    }
}

/// Specific force of the centre of gravity along the ground to the left and along the normal of the ground, m/s^2.
fn specific_force(motion: &Motion) -> [f64; 2] {
    let [_, y, z] = motion.acceleration_m_s2;
    let (sin_roll, cos_roll) = math::sin_cos(motion.roll_rad);
    let cos_pitch = math::cos(motion.pitch_rad);
    let g = STANDARD_GRAVITY_M_S2 * cos_pitch;
    let (left, up) = (y + g * sin_roll, z + g * cos_roll);
    let (sine, cosine) = math::sin_cos(motion.roll_rad - motion.bank_rad);
    [left * cosine - up * sine, left * sine + up * cosine]
}

#[cfg(test)]
mod tests;
