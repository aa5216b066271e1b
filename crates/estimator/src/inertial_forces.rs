//! Tyre forces of a vehicle without linkages, from the balances of the whole vehicle
//! ([`ForceSource::Inertial`]).
//!
//! With the mass m, the specific force f of the centre of gravity in axes of the ground, the yaw rate r, the
//! distances a and b of the axles, their lateral forces F_f and F_r (vehicle axes), and the longitudinal forces
//! F_xi at y_i (Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge, balance of the plane motion):
//!
//! ```text
//! F_f + F_r = m f_y      (a - t) F_f - (b + t) F_r = I_z r' + sum y_i F_xi      sum F_xi = m f_x + drag
//! ```
//!
//! t is the pneumatic trail, which vanishes as the tyres slide. A specific force is measured without its part by
//! gravity, so that bank and grade need not be known. Only the tilt of the body against the ground turns the axes:
//! roll and pitch on the springs follow from the specific force (`tilt.rs`). The yaw moment is a random walk that
//! the yaw rate corrects (`turning.rs`).
//!
//! Loads: `loads.rs`. Longitudinal forces follow from the torques of the wheels where they are recorded,
//! F_x = (T - I_w w')/R - f_r F_z, else from m f_x and the split of drive and brakes. The wheels of an axle share
//! its lateral force as (F_z/F_z0)^n.
//!
//! The force of a load on the hitch, where it is measured, is subtracted from the balances.
//!
//! Errors of mass, heights, stiffnesses and shares are constant and not noise. The standard deviations contain them
//! by the tolerances of the tuning.

mod loads;
mod tilt;
mod turning;

use model::vehicle::{Tyre, Vehicle};
use nalgebra::Vector6;
use sample::{ForceSource, PerWheel, TyreForce, Wheel};

use crate::calibration::Resolved;
use crate::handling::Handling;
use crate::tuning::InertialForcesTuning;
use loads::Loads;
use turning::Turning;

/// The estimator of the forces.
#[derive(Clone, Debug)]
pub struct InertialForces {
    tuning: InertialForcesTuning,
    vehicle: Vehicle,
    handling: Handling,
    loads: Loads,
    yaw: Turning,
    spin: PerWheel<Spin>,
}

/// What is measured at one instant.
#[derive(Clone, Copy, Debug)]
pub struct InertialInput {
    /// Time since the instant before, s.
    pub dt_s: f64,
    /// Specific force of the centre of gravity, body axes, m/s^2; `NaN` upward where it is not measured.
    pub force_m_s2: [f64; 3],
    /// Standard deviation of its forward part, m/s^2.
    pub forward_sigma_m_s2: f64,
    /// Roll, pitch and yaw rate, rad/s; `NaN` where roll or pitch rate is not measured.
    pub rate_rad_s: [f64; 3],
    /// Forward speed, m/s.
    pub speed_m_s: f64,
    /// Steer angles, rad.
    pub steer_rad: [f64; 4],
    /// Torque on each wheel about its spindle, forward positive, N m, where it is recorded.
    pub torque_n_m: PerWheel<Option<f64>>,
    /// Angular speed of each wheel, rad/s, where it is measured.
    pub wheel_speed_rad_s: PerWheel<Option<f64>>,
    /// Force and moment about the centre of gravity of a load on the hitch, body axes, N and N m.
    pub hitch: Vector6<f64>,
}

/// Derivative of a wheel's speed.
#[derive(Clone, Copy, Debug, Default)]
struct Spin {
    smooth_rad_s: Option<f64>,
    rad_s2: f64,
}

impl Spin {
    fn step(&mut self, speed_rad_s: Option<f64>, dt_s: f64, time_s: f64) {
        self.rad_s2 = match (speed_rad_s, self.smooth_rad_s) {
            (Some(now), Some(smooth)) => (now - smooth) / time_s,
            _ => 0.0,
        };
        self.smooth_rad_s = speed_rad_s.map(|now| {
            let smooth = self.smooth_rad_s.unwrap_or(now);
            smooth + (dt_s / time_s).min(1.0) * (now - smooth)
        });
    }
}

/// A value with its standard deviation for each wheel.
type Estimated = [(f64, f64); 4];

impl InertialForces {
    /// An estimator without readings.
    #[must_use]
    pub fn new(
        vehicle: &Vehicle,
        calibration: &Resolved,
        gyro_sigma_rad_s: f64,
        tuning: &InertialForcesTuning,
    ) -> Self {
        let identified = calibration.handling;
        let handling = identified.unwrap_or_else(|| Handling::of_vehicle(vehicle));
        let weight_n = vehicle.body.mass_kg * sample::STANDARD_GRAVITY_M_S2;
        let walk_n_m = tuning.yaw_moment_walk * weight_n * vehicle.wheelbase_m();
        let noise = gyro_sigma_rad_s.max(tuning.yaw_rate_sigma_rad_s);
        Self {
            tuning: *tuning,
            vehicle: vehicle.clone(),
            loads: Loads::new(vehicle, identified.as_ref(), noise, tuning),
            yaw: Turning::new(handling.yaw_inertia_kg_m2, walk_n_m, noise),
            handling,
            spin: PerWheel::default(),
        }
    }

    /// The same forces on other tyres. A handling that was identified stays.
    pub fn load_tyres(&mut self, vehicle: &Vehicle, calibration: &Resolved) {
        self.vehicle = vehicle.clone();
        self.loads
            .load_tyres(vehicle, calibration.handling.as_ref(), &self.tuning);
        if calibration.handling.is_none() {
            self.handling = Handling::of_vehicle(vehicle);
        }
    }

    /// The forces at one instant; unknown without a specific force along and across the vehicle and a yaw rate.
    pub fn step(&mut self, input: &InertialInput) -> PerWheel<TyreForce> {
        let [forward, left, _] = input.force_m_s2;
        let yaw_rate = input.rate_rad_s[2];
        let known = [forward, left, yaw_rate, input.speed_m_s];
        if !known.iter().chain(&input.steer_rad).all(|x| x.is_finite()) {
            self.forget();
            return PerWheel::default();
        }
        let (moment_n_m, moment_sigma_n_m) = self.yaw.step(yaw_rate, 0.0, input.dt_s);
        for wheel in Wheel::ALL {
            let speed = input.wheel_speed_rad_s[wheel];
            self.spin[wheel].step(speed, input.dt_s, self.tuning.spin_time_s);
        }
        let ground = self.loads.tilt(input);
        let lateral_n = self.vehicle.body.mass_kg * ground[1] - input.hitch.y;
        let moment_n_m = moment_n_m - input.hitch[5];
        let rough = self.axle_forces(lateral_n, moment_n_m, [0.0; 4], input.speed_m_s);
        let loads = self.loads.loads(&ground, rough, &input.hitch);
        let along = self.longitudinal(input, ground[0], rough, &loads);
        let along_n = along.map(|(force, _)| force);
        let axles_n = self.axle_forces(lateral_n, moment_n_m, along_n, input.speed_m_s);
        let across = self.lateral(input, axles_n, moment_sigma_n_m, &along, &loads);
        PerWheel::from_fn(|wheel| {
            let of = [along, across, loads].map(|all| all[wheel.index()]);
            TyreForce {
                force_n: of.map(|(force, _)| force),
                sigma_n: of.map(|(_, sigma)| sigma),
                source: ForceSource::Inertial,
                ..TyreForce::default()
            }
        })
    }

    /// The forces in the wheel-carrier frame, of those in the contact frame. The frame pitches with the body, and the
    /// spindle leans by a part of the roll that the suspension does not take back.
    #[must_use]
    pub fn in_carrier_frame(
        &self,
        contact: &PerWheel<TyreForce>,
        steer_rad: [f64; 4],
    ) -> PerWheel<TyreForce> {
        let t = &self.tuning;
        let [roll, pitch] = self.loads.angles_rad();
        PerWheel::from_fn(|wheel| {
            let (sine, cosine) = math::sin_cos(steer_rad[wheel.index()]);
            let nose_down = pitch * cosine - roll * sine;
            let lean = roll * cosine + pitch * sine;
            let camber = t.camber_part * lean;
            let camber_sigma = math::hypot(t.camber_sigma_rad, t.camber_part_sigma * lean);
            let force = contact[wheel];
            let [x, y, z] = force.force_n;
            let (pitch_sine, pitch_cosine) = math::sin_cos(nose_down);
            let (camber_sine, camber_cosine) = math::sin_cos(camber);
            let up = z * pitch_cosine + x * pitch_sine;
            let [x_sigma, y_sigma, z_sigma] = force.sigma_n;
            TyreForce {
                force_n: [
                    x * pitch_cosine - z * pitch_sine,
                    y * camber_cosine + up * camber_sine,
                    up * camber_cosine - y * camber_sine,
                ],
                sigma_n: [
                    x_sigma,
                    math::hypot(y_sigma, camber_sigma * z),
                    math::hypot(z_sigma, camber_sigma * y),
                ],
                ..force
            }
        })
    }

    /// Starts anew after a gap.
    pub fn forget(&mut self) {
        self.yaw.forget();
        self.loads.forget();
        self.spin = PerWheel::default();
    }

    /// Yaw acceleration at the last instant, rad/s^2.
    #[must_use]
    pub fn yaw_acceleration_rad_s2(&self) -> f64 {
        self.yaw.acceleration_rad_s2()
    }

    /// Lateral force of each axle, vehicle axes, N.
    fn axle_forces(
        &self,
        lateral_n: f64,
        moment_n_m: f64,
        along_n: [f64; 4],
        speed_m_s: f64,
    ) -> [f64; 2] {
        let body = &self.vehicle.body;
        let turning: f64 = Wheel::ALL
            .into_iter()
            .map(|wheel| self.vehicle.wheel_place_m(wheel)[1] * along_n[wheel.index()])
            .sum();
        let used = lateral_n.abs() / (self.vehicle.body.mass_kg * sample::STANDARD_GRAVITY_M_S2);
        let tyre = &self.vehicle.front.tyre;
        let sliding = (1.0 - used / tyre.friction.max(0.1)).clamp(0.0, 1.0);
        // The force acts behind the middle of the contact, as seen in the direction of travel.
        let behind = speed_m_s.clamp(-1.0, 1.0);
        let trail_m = self.tuning.trail_part * tyre.unloaded_radius_m * sliding * behind;
        let moment = moment_n_m + turning;
        let front =
            (moment + (body.cg_to_rear_axle_m + trail_m) * lateral_n) / self.vehicle.wheelbase_m();
        [front, lateral_n - front]
    }

    /// Longitudinal force of each wheel along its heading, N.
    fn longitudinal(
        &self,
        input: &InertialInput,
        forward_m_s2: f64,
        axles_n: [f64; 2],
        loads: &Estimated,
    ) -> Estimated {
        let body = &self.vehicle.body;
        let drag_n = body.drag_n_s2_m2 * input.speed_m_s * input.speed_m_s.abs();
        // A steered wheel's lateral force has a part against the travel.
        let steered_n = axles_n[0] * math::sin(0.5 * (input.steer_rad[0] + input.steer_rad[1]));
        let whole_n = body.mass_kg * forward_m_s2 + drag_n + steered_n - input.hitch.x;
        let whole_sigma_n = body.mass_kg
            * math::hypot(
                input.forward_sigma_m_s2,
                self.tuning.mass_part * forward_m_s2,
            );
        let torque = |i: usize| self.of_torque(Wheel::ALL[i], input, loads[i].0);
        let measured: [Option<(f64, f64)>; 4] = std::array::from_fn(torque);
        // A standing vehicle is taken to drive off forwards.
        let is_backward = input.speed_m_s < -self.tuning.backward_m_s;
        let parts = self.split(if is_backward { -whole_n } else { whole_n });
        let open: f64 = (0..4)
            .filter(|i| measured[*i].is_none())
            .map(|i| parts[i])
            .sum();
        let told_n: f64 = measured.iter().flatten().map(|(force, _)| force).sum();
        let variance: f64 = measured
            .iter()
            .flatten()
            .map(|(_, sigma)| sigma * sigma)
            .sum();
        let rest_n = whole_n - told_n;
        std::array::from_fn(|i| match measured[i] {
            // The balance corrects torques by their variances.
            Some((force, sigma)) if open <= 0.0 => {
                let total = variance + whole_sigma_n.powi(2);
                let gain = sigma * sigma / total.max(1.0);
                (force + gain * rest_n, sigma * (1.0 - gain).max(0.0).sqrt())
            }
            Some(known) => known,
            None => {
                let share = if open > 0.0 { parts[i] / open } else { 0.25 };
                let t = &self.tuning;
                let doubt = math::hypot(t.drive_share * 0.5, t.side_share) * rest_n.abs();
                let balance = share * (whole_sigma_n.powi(2) + variance).sqrt();
                let constant = t.longitudinal_constant * self.vehicle.static_load_n(Wheel::ALL[i]);
                let sigma = math::hypot(math::hypot(doubt, balance), constant);
                (share * rest_n, sigma)
            }
        })
    }

    /// Part of each wheel of the longitudinal force of the vehicle: `travel_n` is this force in
    /// the direction of travel: positive where the vehicle is driven, negative where it brakes.
    fn split(&self, travel_n: f64) -> [f64; 4] {
        let front = if travel_n > 0.0 {
            self.handling.drive_split_front
        } else {
            self.handling.brake_split_front
        };
        [front, front, 1.0 - front, 1.0 - front].map(|part| 0.5 * part)
    }

    /// Force of a wheel along its heading by its torque, with its standard deviation, N.
    fn of_torque(&self, wheel: Wheel, input: &InertialInput, load_n: f64) -> Option<(f64, f64)> {
        let torque_n_m = input.torque_n_m[wheel]?;
        let axle = self.vehicle.axle(wheel);
        let tyre = &axle.tyre;
        let radius_m = (tyre.unloaded_radius_m - load_n / tyre.vertical_stiffness_n_m.max(1.0))
            .max(0.5 * tyre.unloaded_radius_m);
        let inertia = axle
            .unsprung
            .as_ref()
            .map_or(0.0, |u| u.wheel_spin_inertia_kg_m2);
        let rolling = tyre.rolling_resistance * load_n * input.speed_m_s.clamp(-1.0, 1.0);
        let spun = torque_n_m - inertia * self.spin[wheel].rad_s2;
        let [part, constant] = self.tuning.torque_part;
        let sigma = math::hypot(
            part * torque_n_m / radius_m,
            constant * self.vehicle.static_load_n(wheel),
        );
        Some((spun / radius_m - rolling, sigma))
    }

    /// Lateral force of each wheel, wheel axes, N.
    fn lateral(
        &self,
        input: &InertialInput,
        axles_n: [f64; 2],
        moment_sigma_n_m: f64,
        along: &Estimated,
        loads: &Estimated,
    ) -> Estimated {
        let t = &self.tuning;
        let body = &self.vehicle.body;
        let length_m = self.vehicle.wheelbase_m();
        let whole_n: f64 = axles_n.iter().sum();
        let sum_sigma_n = math::hypot(
            body.mass_kg * t.force_sigma_m_s2,
            math::hypot(t.tilt_part, t.mass_part) * whole_n,
        );
        let moment_sigma = math::hypot(moment_sigma_n_m, self.unknown_moment_n_m(input));
        let arms_m = [body.cg_to_rear_axle_m, body.front_axle_to_cg_m];
        let mut forces = [(0.0, 0.0); 4];
        for axle in 0..2 {
            let [l, r] = [2 * axle, 2 * axle + 1];
            let shares = self.shares(axle, [loads[l].0, loads[r].0]);
            let cosines = [l, r].map(|i| math::cos(input.steer_rad[i]));
            let pushed: f64 = [l, r]
                .map(|i| along[i].0 * math::sin(input.steer_rad[i]))
                .iter()
                .sum();
            let turned = shares[0] * cosines[0] + shares[1] * cosines[1];
            let force_n = (axles_n[axle] - pushed) / turned;
            let axle_sigma_n = math::hypot(
                sum_sigma_n * arms_m[axle] / length_m,
                moment_sigma / length_m,
            );
            for (i, share) in [l, r].into_iter().zip(shares) {
                let doubt = math::hypot(t.lateral_share * force_n, share * axle_sigma_n);
                // Left and right wheel push against each other where their angles differ from the true ones.
                let turned = t.lateral_constant + t.lateral_steered * input.steer_rad[i].abs();
                let constant = turned * self.vehicle.static_load_n(Wheel::ALL[i]);
                forces[i] = (share * force_n, math::hypot(doubt, constant));
            }
        }
        forces
    }

    /// Standard deviation of the yaw moment of longitudinal forces that no torque tells, N m.
    fn unknown_moment_n_m(&self, input: &InertialInput) -> f64 {
        let all = input.torque_n_m.0.iter().all(Option::is_some);
        let axle =
            |wheel: Wheel| self.vehicle.static_load_n(wheel) * self.vehicle.axle(wheel).track_m;
        let largest = axle(Wheel::FrontLeft).max(axle(Wheel::RearLeft));
        if all {
            0.0
        } else {
            2.0 * self.tuning.unknown_moment_part * largest
        }
    }

    /// Part of each wheel (left, right) of the lateral force of its axle.
    fn shares(&self, axle: usize, loads_n: [f64; 2]) -> [f64; 2] {
        let tyre: &Tyre = [&self.vehicle.front.tyre, &self.vehicle.rear.tyre][axle];
        let stiffness = loads_n.map(|load| {
            let load = load.max(1.0) / tyre.reference_load_n.max(1.0);
            math::powf(load, tyre.load_exponent.clamp(0.3, 1.0))
        });
        let whole = stiffness[0] + stiffness[1];
        stiffness.map(|part| part / whole)
    }
}

/// Sum of drive and brake torque of each wheel about its spindle, forward positive, N m: a brake torque acts against
/// the rotation. `None` where neither is recorded, and for a wheel that a brake holds below `standing_m_s`.
#[must_use]
pub fn net_torque(
    torques_n_m: &[[f64; 4]; 2],
    speed_m_s: f64,
    standing_m_s: f64,
) -> PerWheel<Option<f64>> {
    let [drive, brake] = torques_n_m;
    PerWheel::from_fn(|wheel| {
        let i = wheel.index();
        let or_none = |torque: f64| if torque.is_nan() { 0.0 } else { torque };
        let braked = or_none(brake[i]).abs();
        let is_silent = drive[i].is_nan() && brake[i].is_nan();
        // A brake holds a standing wheel by any torque up to its own.
        if is_silent || (speed_m_s.abs() < standing_m_s && braked > 0.0) {
            return None;
        }
        Some(or_none(drive[i]) - speed_m_s.signum() * braked)
    })
}

#[cfg(test)]
mod tests {
    use model::sensors::Sensors;
    use sample::STANDARD_GRAVITY_M_S2;

    use super::*;
    use crate::Calibration;

    const SENSORS: &str = "thesis-10bit";

    /// Forces of the built-in vehicle in a steady state.
    fn steady(input: &InertialInput) -> (Vehicle, PerWheel<TyreForce>) {
        after_5_s(|_| *input)
    }

    /// Forces of the built-in vehicle after 5 s of inputs, by the time in s.
    fn after_5_s(input: impl Fn(f64) -> InertialInput) -> (Vehicle, PerWheel<TyreForce>) {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let sensors = Sensors::builtin(SENSORS).unwrap();
        let calibration = Resolved::new(&sensors, &Calibration::nominal(&vehicle.name)).unwrap();
        let tuning = InertialForcesTuning::default();
        let mut forces = InertialForces::new(&vehicle, &calibration, 0.001, &tuning);
        let steps = (0..500).map(|step| forces.step(&input(f64::from(step) * 0.01)));
        let last = steps.last().unwrap();
        (vehicle, last)
    }

    fn standing() -> InertialInput {
        InertialInput {
            dt_s: 0.01,
            force_m_s2: [0.0, 0.0, STANDARD_GRAVITY_M_S2],
            forward_sigma_m_s2: 0.1,
            rate_rad_s: [0.0; 3],
            speed_m_s: 3.0,
            steer_rad: [0.0; 4],
            torque_n_m: PerWheel::default(),
            wheel_speed_rad_s: PerWheel::default(),
            hitch: Vector6::zeros(),
        }
    }

    fn sum(forces: &PerWheel<TyreForce>, axis: usize) -> f64 {
        forces.0.iter().map(|force| force.force_n[axis]).sum()
    }

    #[test]
    fn a_load_on_the_hitch_is_carried_and_pulled_by_the_tyres() {
        let (back_m, up_m) = (1.2, 0.4);
        let mut input = standing();
        let (vehicle, free) = steady(&input);
        let body = &vehicle.body;
        // 400 N backwards and 100 N down, behind and below the centre of gravity.
        let arm = nalgebra::Vector3::new(-back_m, 0.0, up_m - body.cg_height_m);
        let force = nalgebra::Vector3::new(-400.0, 0.0, -100.0);
        let moment = arm.cross(&force);
        input.hitch = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        let (_, towing) = steady(&input);
        assert!((sum(&towing, 0) - 400.0).abs() < 1e-6);
        assert!((sum(&towing, 2) - sum(&free, 2) - 100.0).abs() < 1e-6);
        let rear_n = |forces: &PerWheel<TyreForce>| forces.0[2].force_n[2] + forces.0[3].force_n[2];
        // Moments about the front contact.
        let added =
            (100.0 * (back_m + body.front_axle_to_cg_m) + 400.0 * up_m) / vehicle.wheelbase_m();
        assert!((rear_n(&towing) - rear_n(&free) - added).abs() < 1e-6);
    }

    #[test]
    fn the_trail_moves_lateral_force_to_the_leading_axle() {
        for (speed, leading) in [(5.0, 0), (-5.0, 1)] {
            let mut input = standing();
            input.force_m_s2 = [0.0, 1.0, f64::NAN];
            input.speed_m_s = speed;
            let (vehicle, forces) = steady(&input);
            let of_axle =
                |axle: usize| forces.0[2 * axle].force_n[1] + forces.0[2 * axle + 1].force_n[1];
            let whole = of_axle(0) + of_axle(1);
            let body = &vehicle.body;
            let arm_m = [body.cg_to_rear_axle_m, body.front_axle_to_cg_m][leading];
            let trail_m = of_axle(leading) / whole * vehicle.wheelbase_m() - arm_m;
            // At small slip angles a trail of 9 % of the radius, less the part that slides.
            let most_m = 0.09 * vehicle.front.tyre.unloaded_radius_m;
            assert!(
                (0.8 * most_m..most_m).contains(&trail_m),
                "{trail_m} {most_m}"
            );
        }
    }

    #[test]
    fn a_growing_pitch_rate_moves_load_to_the_rear() {
        let rate = |time_s: f64| InertialInput {
            rate_rad_s: [0.0, 0.5 * time_s, 0.0],
            ..standing()
        };
        let (vehicle, still) = steady(&standing());
        let (_, turning) = after_5_s(rate);
        let rear_n = |forces: &PerWheel<TyreForce>| forces.0[2].force_n[2] + forces.0[3].force_n[2];
        let moved_n = rear_n(&turning) - rear_n(&still);
        let expected_n = vehicle.body.inertia_kg_m2[1] * 0.5 / vehicle.wheelbase_m();
        assert!(
            (moved_n / expected_n - 1.0).abs() < 0.05,
            "{moved_n} {expected_n}"
        );
    }

    #[test]
    fn a_steady_bend_moves_load_outward_and_lifts_no_wheel_below_zero() {
        let mut input = standing();
        for left in [3.0, 9.0] {
            input.force_m_s2 = [0.0, left, f64::NAN];
            let (vehicle, forces) = steady(&input);
            let weight_n = vehicle.body.mass_kg * STANDARD_GRAVITY_M_S2;
            assert!((sum(&forces, 2) / weight_n - 1.0).abs() < 1e-6, "{left}");
            let [fl, fr, rl, rr] = [0, 1, 2, 3].map(|i| forces.0[i].force_n[2]);
            assert!(
                fr > fl && rr > rl && fl >= 0.0 && rl >= 0.0,
                "{left}: {forces:?}"
            );
        }
    }

    #[test]
    fn a_brake_torque_acts_against_the_rotation_and_a_missing_one_is_none() {
        let nan = f64::NAN;
        let torques = [[100.0, nan, nan, nan], [40.0, 40.0, nan, nan]];
        let forward = net_torque(&torques, 5.0, 0.2);
        assert_eq!(forward.0, [Some(60.0), Some(-40.0), None, None]);
        let backward = net_torque(&torques, -5.0, 0.2);
        assert_eq!(backward.0, [Some(140.0), Some(40.0), None, None]);
        assert_eq!(net_torque(&torques, 0.0, 0.2).0, [None; 4]);
    }
}
