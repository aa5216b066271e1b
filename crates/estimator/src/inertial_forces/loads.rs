//! Wheel loads by load transfer.
//!
//! The moments about the ground below the centre of gravity give the load that moves to the right, M_x, and to the
//! rear, M_y, with the height h, the sprung mass m_s at the arms h_1 and h_2 over the roll and the pitch axis, and
//! roll p and pitch q of the body on its springs (right side and nose down positive; I_x p'' and I_y q'' from the
//! rates of the inertial unit where it has them):
//!
//! ```text
//! M_x = m h f_y - m f_z y_c + m_s h_1 f_z p - I_x p''      M_y = m h f_x - m_s h_2 f_z q + I_y q''
//! ```
//!
//! Each axle takes its part of M_x: K p + B p' of its springs and dampers, its lateral force at the height of its roll
//! centre, and its unsprung mass. What is left of M_x by the balance is shared as the roll stiffness. A wheel carries
//! no negative load: what an axle cannot take goes to the other axle.

use model::vehicle::Vehicle;
use nalgebra::Vector6;
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use super::tilt::Tilt;
use super::turning::Turning;
use super::{Estimated, InertialInput};
use crate::handling::Handling;
use crate::tuning::InertialForcesTuning;

/// One axle.
#[derive(Clone, Copy, Debug)]
struct AxleRoll {
    stiffness_n_m_rad: f64,
    damping_n_m_s_rad: f64,
    centre_m: f64,
    unsprung_kg: f64,
    /// Height of the unsprung mass.
    radius_m: f64,
    track_m: f64,
}

/// Load transfer of a vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Loads {
    tuning: InertialForcesTuning,
    mass_kg: f64,
    sprung_kg: f64,
    arms_m: [f64; 2],
    height_m: f64,
    /// Height whose moment moves load from axle to axle.
    pitch_height_m: f64,
    left_m: f64,
    sprung_left_m: f64,
    /// Moments that turn the vehicle in roll and pitch, from the rates.
    turning: [Turning; 2],
    /// The same moments at the present instant, N m: from the rates where they are measured, else from roll and pitch
    /// on the springs.
    moment_n_m: [f64; 2],
    inertia_kg_m2: [f64; 2],
    roll_arm_m: f64,
    pitch_arm_m: f64,
    axles: [AxleRoll; 2],
    static_n: [f64; 4],
    height_part: f64,
    roll_share: f64,
    roll: Tilt,
    pitch: Tilt,
    started: bool,
    /// Mean of the upward specific force, and mean square of what differs from it.
    upward: [f64; 2],
    upward_known: bool,
}

impl Loads {
    pub fn new(
        vehicle: &Vehicle,
        identified: Option<&Handling>,
        gyro_sigma_rad_s: f64,
        tuning: &InertialForcesTuning,
    ) -> Self {
        let body = &vehicle.body;
        let sprung = vehicle.sprung();
        let roll_arm_m = vehicle.roll_arm_m().max(0.01);
        let pitch = vehicle.pitch();
        let axles = axles(vehicle, identified, tuning);
        let sum = |of: fn(&AxleRoll) -> f64| axles.iter().map(of).sum::<f64>();
        let guessed = |field: &str| usize::from(vehicle.is_guessed(field));
        Self {
            tuning: *tuning,
            mass_kg: body.mass_kg,
            sprung_kg: sprung.mass_kg,
            arms_m: [body.front_axle_to_cg_m, body.cg_to_rear_axle_m],
            height_m: body.cg_height_m,
            pitch_height_m: identified.map_or(body.cg_height_m, |h| h.load_transfer_height_m),
            left_m: body.cg_y_m,
            sprung_left_m: body.cg_y_m + sprung.cg_m[1],
            turning: [0, 1].map(|axis| {
                let walk = tuning.tilt_moment_walk * body.mass_kg * STANDARD_GRAVITY_M_S2;
                let arm_m = [axles[0].track_m, vehicle.wheelbase_m()][axis];
                Turning::new(body.inertia_kg_m2[axis], walk * arm_m, gyro_sigma_rad_s)
            }),
            moment_n_m: [0.0; 2],
            inertia_kg_m2: [body.inertia_kg_m2[0], body.inertia_kg_m2[1]],
            roll_arm_m,
            pitch_arm_m: (sprung.cg_m[2] - pitch.centre_height_m).max(0.0),
            roll: Tilt::new(
                sprung.inertia_kg_m2[0] + sprung.mass_kg * roll_arm_m.powi(2),
                sum(|axle| axle.stiffness_n_m_rad),
                sum(|axle| axle.damping_n_m_s_rad),
            ),
            pitch: Tilt::new(
                sprung.inertia_kg_m2[1],
                pitch.stiffness_n_m_rad,
                pitch.damping_n_m_s_rad,
            ),
            axles,
            static_n: Wheel::ALL.map(|wheel| vehicle.static_load_n(wheel)),
            height_part: tuning.height_part[guessed("body.cg_height_m")],
            roll_share: tuning.roll_share[guessed("front")],
            started: false,
            upward: [STANDARD_GRAVITY_M_S2, 0.0],
            upward_known: false,
        }
    }

    /// Starts anew: the next specific force finds the body in equilibrium.
    pub fn forget(&mut self) {
        self.started = false;
        self.turning.iter_mut().for_each(Turning::forget);
    }

    /// Roll and pitch of the body against the ground, rad.
    pub fn angles_rad(&self) -> [f64; 2] {
        [self.roll.angle_rad, self.pitch.angle_rad]
    }

    /// Propagates roll and pitch. Returns the specific force in axes of the ground, m/s^2.
    pub fn tilt(&mut self, input: &InertialInput) -> [f64; 3] {
        let [x, y, z] = input.force_m_s2;
        self.upward_known = z.is_finite();
        let z = if z.is_finite() {
            z
        } else {
            // The body is rolled, the ground is level.
            let (sine, cosine) = math::sin_cos(self.roll.angle_rad);
            (STANDARD_GRAVITY_M_S2 - y * sine) / cosine
        };
        let rolling = self.sprung_kg * (self.roll_arm_m * y - self.sprung_left_m * z);
        let pitching = -self.sprung_kg * self.pitch_arm_m * x;
        if self.started {
            self.roll.step(rolling, input.dt_s);
            self.pitch.step(pitching, input.dt_s);
        } else {
            self.roll.settle(rolling);
            self.pitch.settle(pitching);
            self.started = true;
        }
        for (axis, tilt) in [self.roll, self.pitch].into_iter().enumerate() {
            let rate = input.rate_rad_s[axis];
            let model = self.inertia_kg_m2[axis] * tilt.acceleration_rad_s2;
            self.moment_n_m[axis] = if rate.is_finite() {
                self.turning[axis].step(rate, model, input.dt_s).0
            } else {
                model
            };
        }
        let keep = (input.dt_s / self.tuning.unrest_time_s).min(1.0);
        let [mean, square] = &mut self.upward;
        *mean += keep * (z - *mean);
        *square += keep * ((z - *mean).powi(2) - *square);
        let (roll_sine, roll_cosine) = math::sin_cos(self.roll.angle_rad);
        let (pitch_sine, pitch_cosine) = math::sin_cos(self.pitch.angle_rad);
        let upward = z * roll_cosine + y * roll_sine;
        [
            x * pitch_cosine + upward * pitch_sine,
            y * roll_cosine - z * roll_sine,
            upward * pitch_cosine - x * pitch_sine,
        ]
    }

    /// Loads with standard deviations, N, of a specific force in axes of the ground, the lateral forces of the
    /// axles, and the force and moment about the centre of gravity of a load on the hitch.
    pub fn loads(
        &self,
        ground_m_s2: &[f64; 3],
        axles_n: [f64; 2],
        hitch: &Vector6<f64>,
    ) -> Estimated {
        let [x, y, z] = *ground_m_s2;
        let [roll, pitch] = [&self.roll, &self.pitch];
        let right = self.mass_kg * (self.height_m * y - self.left_m * z)
            + self.sprung_kg * self.roll_arm_m * z * roll.angle_rad
            - self.moment_n_m[0]
            + hitch[3]
            - self.height_m * hitch.y;
        let back = self.mass_kg * self.pitch_height_m * x
            - self.sprung_kg * self.pitch_arm_m * z * pitch.angle_rad
            + self.moment_n_m[1]
            - hitch[4]
            - self.height_m * hitch.x;
        let moments = self.roll_moments(y, right, axles_n);
        let length_m: f64 = self.arms_m.iter().sum();
        let whole = self.mass_kg * z - hitch.z;
        let axle_n = [
            (whole * self.arms_m[1] - back) / length_m,
            (whole * self.arms_m[0] + back) / length_m,
        ];
        let transfer: [f64; 2] = std::array::from_fn(|i| moments[i] / self.axles[i].track_m);
        let mut loads = [0.0; 4];
        for (i, moved) in transfer.into_iter().enumerate() {
            loads[2 * i] = 0.5 * axle_n[i] - moved;
            loads[2 * i + 1] = 0.5 * axle_n[i] + moved;
        }
        self.keep_positive(&mut loads);
        std::array::from_fn(|i| (loads[i], self.sigma_n(i, right, back, z)))
    }

    /// Part of each axle of the moment that moves load to the right, N m.
    fn roll_moments(&self, left_m_s2: f64, whole_n_m: f64, axles_n: [f64; 2]) -> [f64; 2] {
        let roll = &self.roll;
        let mut moments: [f64; 2] = std::array::from_fn(|i| {
            let axle = &self.axles[i];
            let unsprung = axle.unsprung_kg * left_m_s2;
            axle.stiffness_n_m_rad * roll.angle_rad
                + axle.damping_n_m_s_rad * roll.rate_rad_s
                + (axles_n[i] - unsprung) * axle.centre_m
                + unsprung * axle.radius_m
        });
        let stiffness = self.axles[0].stiffness_n_m_rad + self.axles[1].stiffness_n_m_rad;
        let rest = whole_n_m - moments[0] - moments[1];
        for (moment, axle) in moments.iter_mut().zip(&self.axles) {
            *moment += rest * axle.stiffness_n_m_rad / stiffness;
        }
        moments
    }

    /// Moves load that a lifted wheel cannot give, so that sum and moments stay.
    fn keep_positive(&self, loads_n: &mut [f64; 4]) {
        for (axle, other) in [(0, 1), (1, 0)] {
            let ratio = self.axles[axle].track_m / self.axles[other].track_m;
            for side in [0, 1] {
                let (lifted, beside) = (2 * axle + side, 2 * axle + 1 - side);
                let lack = -loads_n[lifted];
                if lack > 0.0 {
                    loads_n[lifted] = 0.0;
                    loads_n[beside] -= lack;
                    loads_n[2 * other + side] -= lack * ratio;
                    loads_n[2 * other + 1 - side] += lack * ratio;
                }
            }
        }
        // A vehicle that tips over has both wheels of a side off the ground: the others carry its weight.
        let whole: f64 = loads_n.iter().sum();
        let carried: f64 = loads_n.iter().map(|load| load.max(0.0)).sum();
        for load in loads_n {
            *load = load.max(0.0) * whole.max(0.0) / carried.max(1.0);
        }
    }

    /// The same loads on other tyres.
    pub fn load_tyres(
        &mut self,
        vehicle: &Vehicle,
        identified: Option<&Handling>,
        tuning: &InertialForcesTuning,
    ) {
        self.axles = axles(vehicle, identified, tuning);
        let stiffness = self.axles.iter().map(|axle| axle.stiffness_n_m_rad).sum();
        self.roll.stiffen(stiffness);
    }

    fn sigma_n(&self, i: usize, right_n_m: f64, back_n_m: f64, up_m_s2: f64) -> f64 {
        let t = &self.tuning;
        let axle = &self.axles[i / 2];
        let length_m: f64 = self.arms_m.iter().sum();
        let lever = self.mass_kg * self.height_m * t.force_sigma_m_s2;
        let own_kg = self.static_n[i] / STANDARD_GRAVITY_M_S2;
        let upward = if self.upward_known {
            t.unrest_gain * own_kg * self.upward[1].sqrt()
        } else {
            t.upward_unknown_part * self.static_n[i]
        };
        [
            t.mass_part * own_kg * up_m_s2,
            0.5 * self.height_part * right_n_m / axle.track_m,
            self.roll_share * right_n_m / axle.track_m,
            0.5 * self.height_part * back_n_m / length_m,
            0.5 * lever / axle.track_m,
            0.5 * lever / length_m,
            0.5 * t.tilt_moment_part * self.moment_n_m[0] / axle.track_m,
            0.5 * t.tilt_moment_part * self.moment_n_m[1] / length_m,
            upward,
        ]
        .iter()
        .map(|part| part * part)
        .sum::<f64>()
        .sqrt()
    }
}

/// Both axles. The roll angle at 1 g that a drive showed replaces the sum of their stiffnesses:
/// g m_s h_1/(K - m_s g h_1) is the identified roll gain less 1.
fn axles(
    vehicle: &Vehicle,
    identified: Option<&Handling>,
    tuning: &InertialForcesTuning,
) -> [AxleRoll; 2] {
    let mut axles = [&vehicle.front, &vehicle.rear].map(|axle| {
        // Tyres are springs in series.
        let tyres = 0.5 * axle.track_m.powi(2) * axle.tyre.vertical_stiffness_n_m;
        let springs = axle.roll_stiffness_n_m_rad.max(1.0);
        AxleRoll {
            stiffness_n_m_rad: springs * tyres / (springs + tyres),
            damping_n_m_s_rad: axle.roll_damping_n_m_s_rad,
            centre_m: axle.roll_centre_height_m,
            unsprung_kg: axle.unsprung_mass_kg(),
            radius_m: axle.tyre.unloaded_radius_m,
            track_m: axle.track_m,
        }
    });
    let gain = identified.map(|handling| handling.roll_gain - 1.0);
    if let Some(gain) = gain.filter(|gain| *gain > tuning.roll_gain_min) {
        let arm_m = vehicle.roll_arm_m().max(0.01);
        let moment = vehicle.sprung().mass_kg * STANDARD_GRAVITY_M_S2 * arm_m;
        let whole: f64 = axles.iter().map(|axle| axle.stiffness_n_m_rad).sum();
        let scale = moment * (1.0 + 1.0 / gain) / whole;
        for axle in &mut axles {
            axle.stiffness_n_m_rad *= scale;
            axle.damping_n_m_s_rad *= scale;
        }
    }
    axles
}
