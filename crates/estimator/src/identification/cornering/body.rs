//! What the regression knows of the vehicle: forces of the axles from the motion, and how the load
//! bends the tyres' characteristic.

use model::chassis::four_wheel::Parameters;
use model::tyre::brush_over_linear;
use model::vehicle::{Axle, Vehicle};
use sample::STANDARD_GRAVITY_M_S2;

/// Part of an axle's grip up to which its slip angle says anything.
const GRIP_PART_MAX: f64 = 0.98;
/// A wheel's load is taken to be at least this part of its load at rest.
const LOAD_PART_MIN: f64 = 0.02;
/// Rounds in which the aligning moments follow from the forces that they change.
const ROUNDS: usize = 3;

/// How far a vehicle file may be off, parts of the value: the tyres' trail, the load's transfer, the
/// sway and the yaw inertia.
const TRAIL_DOUBT: f64 = 0.2;
const TRANSFER_DOUBT: f64 = 0.05;
const SWAY_DOUBT: f64 = 0.1;
const INERTIA_DOUBT: f64 = 0.03;

/// What must be known of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass m, kg.
    pub mass_kg: f64,
    /// Front axle to centre of gravity a, m.
    pub front_axle_to_cg_m: f64,
    /// Centre of gravity to rear axle b, m.
    pub cg_to_rear_axle_m: f64,
    /// Yaw inertia I_z, kg m^2.
    pub yaw_inertia_kg_m2: f64,
    /// Height h of the centre of gravity, m.
    pub cg_height_m: f64,
    /// Sway of the body's point at the centre of gravity against the axles: its height over the
    /// roll axis, m per rad of roll.
    pub sway_m: f64,
    /// Rolling resistance coefficient f of the tyres.
    pub rolling_resistance: f64,
    /// Spin inertia over rolling radius, all wheels, kg m: times the speed, their spin momentum.
    pub spin_kg_m: f64,
    /// Grip mu F_z of the front and the rear axle at rest, N; infinite for tyres taken as linear.
    pub grip_n: [f64; 2],
    /// Power n with which a tyre's stiffness grows with its load, front and rear.
    pub load_exponent: [f64; 2],
    /// Pneumatic trail n_0 of an unslipping tyre under the load at rest, front and rear, m.
    pub trail_m: [f64; 2],
    /// Track t, front and rear, m.
    pub track_m: [f64; 2],
    /// Lateral acceleration at which each axle's inner wheel would lift, m/s^2; infinite where
    /// the load's transfer is not to count. Only used where the wheels' loads are unknown.
    pub lift_m_s2: [f64; 2],
}

/// The motion of one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    pub speed_m_s: f64,
    pub lateral_m_s2: f64,
    pub yaw_acceleration_rad_s2: f64,
    pub roll_rad: f64,
    pub roll_rate_rad_s: f64,
    pub steer_rad: f64,
    /// What is known of the wheels' loads.
    pub loads: Loads,
}

/// What is known of the wheels' loads at an instant.
#[derive(Clone, Copy, Debug)]
pub(super) enum Loads {
    /// Loads of the wheels, N.
    Known([f64; 4]),
    /// The roll angle, from which the loads' transfer follows with the vehicle file.
    ByTransfer,
    /// Neither: the vehicle is taken as a two-wheel model.
    TwoWheel,
}

impl Body {
    /// What the vehicle file says. The trail is the brush model's, a sixth of the contact's length
    /// 2 sqrt(2 R_0 d), pressed in by d.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
        let weight_n = body.mass_kg * STANDARD_GRAVITY_M_S2;
        let axles = [(&vehicle.front, b / (a + b)), (&vehicle.rear, a / (a + b))];
        let spin = |axle: &Axle| {
            let unsprung = axle.unsprung.as_ref();
            let inertia = unsprung.map_or(0.0, |parts| parts.wheel_spin_inertia_kg_m2);
            2.0 * inertia / axle.tyre.unloaded_radius_m
        };
        Self {
            mass_kg: body.mass_kg,
            front_axle_to_cg_m: a,
            cg_to_rear_axle_m: b,
            yaw_inertia_kg_m2: body.inertia_kg_m2[2],
            cg_height_m: body.cg_height_m,
            sway_m: body.cg_height_m - vehicle.roll_axis_height_m(),
            rolling_resistance: vehicle.front.tyre.rolling_resistance,
            spin_kg_m: axles.iter().map(|(axle, _)| spin(axle)).sum(),
            grip_n: axles.map(|(axle, share)| axle.tyre.friction * weight_n * share),
            load_exponent: axles.map(|(axle, _)| axle.tyre.load_exponent),
            trail_m: axles.map(|(axle, share)| {
                let tyre = &axle.tyre;
                let pressed_m = 0.5 * weight_n * share / tyre.vertical_stiffness_n_m;
                (2.0 * tyre.unloaded_radius_m * pressed_m).sqrt() / 3.0
            }),
            track_m: axles.map(|(axle, _)| axle.track_m),
            lift_m_s2: Parameters::from_vehicle(vehicle).lift_m_s2(),
        }
    }

    /// The same vehicle with one of its values off, for each value that the axles' forces and slips
    /// hang on and that a drive does not tell.
    pub(super) fn varied(&self) -> [Self; 4] {
        let grown = |pair: [f64; 2], doubt: f64| pair.map(|value| value * (1.0 + doubt));
        [
            Self {
                trail_m: grown(self.trail_m, TRAIL_DOUBT),
                ..*self
            },
            Self {
                lift_m_s2: grown(self.lift_m_s2, TRANSFER_DOUBT),
                ..*self
            },
            Self {
                sway_m: self.sway_m * (1.0 + SWAY_DOUBT),
                ..*self
            },
            Self {
                yaw_inertia_kg_m2: self.yaw_inertia_kg_m2 * (1.0 + INERTIA_DOUBT),
                ..*self
            },
        ]
    }

    fn wheelbase_m(&self) -> f64 {
        self.front_axle_to_cg_m + self.cg_to_rear_axle_m
    }

    /// Load at rest of one of an axle's wheels, N.
    fn rest_n(&self, axle: usize) -> f64 {
        let arm = [self.cg_to_rear_axle_m, self.front_axle_to_cg_m][axle];
        0.5 * self.mass_kg * STANDARD_GRAVITY_M_S2 * arm / self.wheelbase_m()
    }

    /// An axle's slip angle times its stiffness in a steady turn, over the mass that it carries: as
    /// the tyres' trail and rolling resistance, the load's transfer and the grip have it.
    pub(in crate::identification) fn steady_pull_m_s2(
        &self,
        axle: usize,
        lateral_m_s2: f64,
        steer_rad: f64,
    ) -> f64 {
        let now = Instant {
            speed_m_s: 0.0,
            lateral_m_s2,
            yaw_acceleration_rad_s2: 0.0,
            roll_rad: 0.0,
            roll_rate_rad_s: 0.0,
            steer_rad,
            loads: Loads::Known(self.loads_by_transfer_n(lateral_m_s2)),
        };
        let force_n = self.axle_forces_n(&now)[axle];
        let carried_kg = 2.0 * self.rest_n(axle) / STANDARD_GRAVITY_M_S2;
        let parts = self.parts_by_transfer(axle, lateral_m_s2);
        let pull = self.pull(axle, force_n, parts, self.grip_n[axle].recip());
        pull.n / carried_kg
    }

    /// -M_z: what rolling resistance under the roll moment on the ground, and the steered front
    /// tyres' side forces, turn against the bend, N m.
    fn between_sides_n_m(&self, lateral_m_s2: f64, roll_n_m: f64, sin_steer: f64) -> f64 {
        let transfer = (lateral_m_s2 / self.lift_m_s2[0]).clamp(-1.0, 1.0);
        let carried = self.cg_to_rear_axle_m / self.wheelbase_m();
        let outer_n = carried * self.mass_kg * lateral_m_s2 * self.load_exponent[0] * transfer;
        self.rolling_resistance * roll_n_m + outer_n * sin_steer * 0.5 * self.track_m[0]
    }

    /// Lateral forces of the axles' tyres, contact frame, front and rear, N.
    pub(super) fn axle_forces_n(&self, now: &Instant) -> [f64; 2] {
        match now.loads {
            Loads::Known(loads_n) => self.forces_under_n(now, loads_n),
            Loads::ByTransfer => self.forces_in_plane_n(now),
            Loads::TwoWheel => self.split_n(now, 0.0, 0.0),
        }
    }

    /// The forces of a vehicle whose wheels' loads are unknown, its tyres without moments of their
    /// own: the trail's effect is then part of the stiffness, as in a two-wheel model.
    fn forces_in_plane_n(&self, now: &Instant) -> [f64; 2] {
        let weight_n = self.mass_kg * STANDARD_GRAVITY_M_S2;
        let lateral_n = self.mass_kg * now.lateral_m_s2;
        let roll_n_m = lateral_n * self.cg_height_m + weight_n * self.sway_m * now.roll_rad;
        let sin = math::sin(now.steer_rad);
        let turning = self.between_sides_n_m(now.lateral_m_s2, roll_n_m, sin);
        let carried = self.cg_to_rear_axle_m / self.wheelbase_m();
        let resistance_n = self.rolling_resistance * weight_n * carried;
        self.split_n(now, turning, resistance_n)
    }

    /// The forces under known loads, each tyre with its trail and rolling resistance, the wheels
    /// with their spin momentum.
    fn forces_under_n(&self, now: &Instant, loads_n: [f64; 4]) -> [f64; 2] {
        let f = self.rolling_resistance;
        let (sin, cos) = math::sin_cos(now.steer_rad);
        let spin_n_m = self.spin_kg_m * now.speed_m_s * now.roll_rate_rad_s;
        let resistance_n = f * (loads_n[0] + loads_n[1]);
        let rear_n_m = 0.5 * self.track_m[1] * f * (loads_n[3] - loads_n[2]);
        let mut forces_n = self.split_n(now, 0.0, resistance_n);
        for _ in 0..ROUNDS {
            let mut turning = spin_n_m + rear_n_m;
            for (axle, force_n) in forces_n.into_iter().enumerate() {
                let loads_n = [loads_n[2 * axle], loads_n[2 * axle + 1]];
                let parts = loads_n.map(|load_n| load_n / self.rest_n(axle));
                let [left_n, right_n] = self.by_tyre_n(axle, force_n, parts);
                turning += self.trailing_n_m(axle, left_n, parts[0]);
                turning += self.trailing_n_m(axle, right_n, parts[1]);
                if axle == 0 {
                    let ahead_n = f * (loads_n[1] - loads_n[0]) * cos + (right_n - left_n) * sin;
                    turning += 0.5 * self.track_m[0] * ahead_n;
                }
            }
            forces_n = self.split_n(now, turning, resistance_n);
        }
        forces_n
    }

    /// An axle's force by its tyres, whose stiffness grows with the load.
    fn by_tyre_n(&self, axle: usize, force_n: f64, parts: [f64; 2]) -> [f64; 2] {
        let grown = parts.map(|part| math::powf(part.max(LOAD_PART_MIN), self.load_exponent[axle]));
        grown.map(|own| force_n * own / (grown[0] + grown[1]))
    }

    /// n F_y of one tyre: the trail grows with the contact's length and vanishes as the tyre
    /// begins to slide.
    fn trailing_n_m(&self, axle: usize, force_n: f64, part: f64) -> f64 {
        let part = part.max(LOAD_PART_MIN);
        let sliding = force_n.abs() / (0.5 * self.grip_n[axle] * part);
        self.trail_m[axle] * part.sqrt() * (1.0 - sliding).max(0.0) * force_n
    }

    /// Forces of the axles that turn the vehicle as it turns, against a moment `turning` and the
    /// front wheels' rolling resistance.
    fn split_n(&self, now: &Instant, turning_n_m: f64, resistance_n: f64) -> [f64; 2] {
        let (a, b) = (self.front_axle_to_cg_m, self.cg_to_rear_axle_m);
        let lateral_n = self.mass_kg * now.lateral_m_s2;
        let yaw_n_m = self.yaw_inertia_kg_m2 * now.yaw_acceleration_rad_s2 + turning_n_m;
        let (sin, cos) = math::sin_cos(now.steer_rad);
        let front_n = (b * lateral_n + yaw_n_m) / (a + b);
        let rear_n = (a * lateral_n - yaw_n_m) / (a + b);
        [(front_n + resistance_n * sin) / cos, rear_n]
    }

    /// Loads of an axle's wheels, left and right, as parts of those at rest.
    pub(super) fn load_parts(&self, axle: usize, now: &Instant) -> [f64; 2] {
        match now.loads {
            Loads::Known(loads_n) => {
                [0, 1].map(|side| (loads_n[2 * axle + side] / self.rest_n(axle)).max(LOAD_PART_MIN))
            }
            Loads::ByTransfer => self.parts_by_transfer(axle, now.lateral_m_s2),
            Loads::TwoWheel => [1.0; 2],
        }
    }

    /// Loads of the wheels as the vehicle file's load transfer makes them, N.
    fn loads_by_transfer_n(&self, lateral_m_s2: f64) -> [f64; 4] {
        let [front, rear] = [0, 1].map(|axle| {
            let parts = self.parts_by_transfer(axle, lateral_m_s2);
            parts.map(|part| part * self.rest_n(axle))
        });
        [front[0], front[1], rear[0], rear[1]]
    }

    fn parts_by_transfer(&self, axle: usize, lateral_m_s2: f64) -> [f64; 2] {
        let transfer = lateral_m_s2 / self.lift_m_s2[axle];
        [-transfer, transfer].map(|more| (1.0 + more).clamp(LOAD_PART_MIN, 2.0 - LOAD_PART_MIN))
    }

    /// g(F): the axle's stiffness at rest times the tangent of the slip angle under which its two
    /// brush tyres, at these parts of their loads at rest, hold the force F. Zero as the grip's
    /// reciprocal is a linear tyre, and one below zero a tyre that stiffens with slip.
    pub(super) fn pull(
        &self,
        axle: usize,
        force_n: f64,
        parts: [f64; 2],
        grip_inverse: f64,
    ) -> Pull {
        let tyres = parts.map(|part| Tyre {
            stiffness: 0.5 * math::powf(part, self.load_exponent[axle]),
            grip_inverse: 2.0 * grip_inverse / part,
        });
        let wanted_n = if grip_inverse > 0.0 {
            let most_n: f64 = parts.iter().map(|part| 0.5 * part / grip_inverse).sum();
            force_n.abs().min(GRIP_PART_MAX * most_n)
        } else {
            force_n.abs()
        };
        // Newton's method, from below where the tyres' force is concave and from above elsewhere.
        let mut pull_n = wanted_n / tyres.iter().map(|tyre| tyre.stiffness).sum::<f64>();
        let mut per_force = 1.0;
        for _ in 0..30 {
            let [held_n, slope] = tyres
                .map(|tyre| tyre.holds(pull_n))
                .into_iter()
                .fold([0.0; 2], |sum, tyre| [sum[0] + tyre[0], sum[1] + tyre[1]]);
            per_force = slope.max(1e-6).recip();
            let step_n = (wanted_n - held_n) * per_force;
            pull_n += step_n;
            if step_n.abs() <= 1e-9 * pull_n {
                break;
            }
        }
        Pull {
            n: pull_n.copysign(force_n),
            per_force,
        }
    }
}

/// g(F) of one axle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    /// g(F), N.
    pub n: f64,
    /// Its derivative g'(F).
    pub per_force: f64,
}

/// One brush tyre, its stiffness as a part of the axle's.
#[derive(Clone, Copy)]
struct Tyre {
    stiffness: f64,
    grip_inverse: f64,
}

impl Tyre {
    /// Force at a pull, N, and its slope: G (1 - (1 - u/(3 G))^3) = u - u^2/(3 G) + u^3/(27 G^2) with
    /// u = c s, at most G.
    fn holds(self, pull_n: f64) -> [f64; 2] {
        let linear_n = self.stiffness * pull_n;
        let slid = linear_n * self.grip_inverse / 3.0;
        if slid >= 1.0 {
            return [self.grip_inverse.recip(), 0.0];
        }
        [
            linear_n * brush_over_linear(slid),
            self.stiffness * (1.0 - slid).powi(2),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pull_is_the_slip_under_which_both_tyres_hold_the_force() {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let body = Body::of(&vehicle);
        let parts = [0.6, 1.4];
        for pull_n in [1.0, 300.0, 1500.0] {
            let part_of = |part: f64| {
                let grip_n = 0.5 * body.grip_n[0] * part;
                let slid = 0.5 * math::powf(part, body.load_exponent[0]) * pull_n / (3.0 * grip_n);
                grip_n * model::tyre::brush_over_grip(slid)
            };
            let force_n: f64 = parts.map(part_of).iter().sum();
            let found = body.pull(0, -force_n, parts, body.grip_n[0].recip());
            assert!((found.n / pull_n + 1.0).abs() < 1e-6, "{found:?} {pull_n}");
        }
        let linear = body.pull(0, 500.0, [1.0, 1.0], 0.0);
        assert!((linear.n - 500.0).abs() < 1e-6, "{linear:?}");
        // The pull is as smooth in the grip's reciprocal through zero as elsewhere.
        let near = |inverse: f64| body.pull(0, 500.0, parts, inverse).n;
        let bend = (near(1e-5) - 2.0 * near(0.0) + near(-1e-5)) / 500.0;
        assert!(bend.abs() < 1e-4, "{bend}");
    }
}
