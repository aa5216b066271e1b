//! The road under the wheels: heights of the ground, the plane through them, roughness by ISO 8608 and the
//! International Roughness Index.
//!
//! Height of the ground below wheel centre i, earth axes, up:
//!
//! h_i = z + e_z' R (w_i - c) - (r - F_i/k) e_z' R a_i
//!
//! | symbol | meaning |
//! |---|---|
//! | z | height of the centre of gravity c: the integral of the motion filter's upward velocity |
//! | R | rotation from body to earth axes |
//! | w_i | wheel centre, by the linkage at the strut's length of the force filter |
//! | r, k | radius of the unloaded tyre, vertical stiffness |
//! | F_i | load in the wheel-carrier frame, a_i the axis of that frame along which it acts |
//!
//! The motion filter corrects the upward velocity by GNSS, so that one integration remains. Its drift is
//! taken off by a high-pass of second order far below the waves of the road (`BodyHeight`). The estimate
//! with a lag uses the geometry of its instant and the loads with the lag. The statistics of the road
//! (`road/spectrum.rs`, `road/golden_car.rs`) use these heights over the distance (`road/profile.rs`).
//! Everything has a fixed size and is updated from step to step.

mod footing;
mod golden_car;
mod plane;
mod profile;
mod slope;
mod spectrum;

use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{LogTime, PerWheel, Road, RoadUnknown, TyreForce, Wheel, WheelAxes};

use crate::corners::CornerState;
use crate::estimator::LAG_STEPS;
use crate::motion::MotionState;
use crate::tuning::RoadTuning;

use footing::Footing;
use plane::fit;
pub use profile::RoadStatistics;
pub use slope::SlopeFilter;
pub use spectrum::Section;

/// Input of one step.
#[derive(Clone, Copy)]
pub struct RoadInput<'a> {
    /// The instant.
    pub now: LogTime,
    /// Since the last one, s.
    pub dt: f64,
    /// Motion of the body.
    pub motion: &'a MotionState,
    /// Standard deviations of roll and pitch, rad.
    pub tilt_sigma_rad: [f64; 2],
    /// The corners.
    pub corners: &'a [CornerState; 4],
    /// Length of each strut by the force filter, m.
    pub strut_m: [f64; 4],
    /// Why heights are not known at this instant.
    pub unknown: Option<RoadUnknown>,
    /// Loads and their standard deviations, wheel-carrier frame.
    pub forces: &'a PerWheel<TyreForce>,
    /// The same two steps before.
    pub lagged: &'a PerWheel<TyreForce>,
}

/// Steps of the lag.
const LAG: usize = LAG_STEPS;

/// Position of the four tyres against the earth at one instant.
#[derive(Clone, Copy, Debug)]
struct Moment {
    time: LogTime,
    dt: f64,
    speed_m_s: f64,
    unknown: Option<RoadUnknown>,
    /// Lowest point of each unloaded tyre in level axes along the heading: forward, left, up, m.
    tyres_m: [Vector3<f64>; 4],
    /// Upward part of a compression of each tyre.
    upward: [f64; 4],
    /// Vertical speed of each wheel centre, m/s.
    rise_m_s: [f64; 4],
    tilt_sigma_rad: [f64; 2],
}

/// Estimates of the road.
#[derive(Clone, Debug)]
pub struct RoadEstimator {
    tuning: RoadTuning,
    cg_height_m: f64,
    radius_m: [f64; 4],
    stiffness_n_m: [f64; 4],
    static_load_n: [f64; 4],
    body: BodyHeight,
    past: [Option<Moment>; LAG],
    /// The ground below each wheel: causal and with the lag.
    footings: [[Footing; 4]; 2],
    statistics: RoadStatistics,
}

impl RoadEstimator {
    /// Nothing known yet.
    #[must_use]
    pub fn new(vehicle: &Vehicle, tuning: &RoadTuning) -> Self {
        let mut new = Self {
            tuning: *tuning,
            cg_height_m: 0.0,
            radius_m: [0.0; 4],
            stiffness_n_m: [0.0; 4],
            static_load_n: [0.0; 4],
            body: BodyHeight::default(),
            past: [None; LAG],
            footings: Default::default(),
            statistics: RoadStatistics::new(tuning),
        };
        new.load(vehicle);
        new
    }

    /// The same estimator of a vehicle whose mass properties or tyres have changed.
    pub fn load(&mut self, vehicle: &Vehicle) {
        let tyres = Wheel::ALL.map(|wheel| &vehicle.axle(wheel).tyre);
        self.cg_height_m = vehicle.body.cg_height_m;
        self.radius_m = tyres.map(|tyre| tyre.unloaded_radius_m);
        self.stiffness_n_m = tyres.map(|tyre| tyre.vertical_stiffness_n_m.max(1.0));
        self.static_load_n = Wheel::ALL.map(|wheel| vehicle.static_load_n(wheel));
    }

    /// Takes one instant. Returns its road, and the road two steps before by the loads with the lag.
    pub fn step(&mut self, input: &RoadInput<'_>) -> (Road, Option<Road>) {
        let now = self.moment(input);
        self.past.rotate_right(1);
        let before = self.past[0].replace(now);
        let lagged = before.map(|moment| {
            let road = self.road(&moment, input.lagged, 1);
            let known = road.unknown.is_none() && input.unknown.is_none();
            self.statistics.step(
                input.dt,
                moment.speed_m_s,
                known.then_some(&road.height_m.0),
            );
            road
        });
        let roads = (self.road(&now, input.forces, 0), lagged);
        let speed_m_s = now.speed_m_s;
        (
            self.statistics.complete(roads.0, speed_m_s),
            roads
                .1
                .map(|road| self.statistics.complete(road, speed_m_s)),
        )
    }

    fn moment(&mut self, input: &RoadInput<'_>) -> Moment {
        let motion = input.motion;
        let velocity = motion.earth_from_body * motion.velocity_m_s;
        let height_m = self
            .body
            .step(input.dt, velocity.z, self.tuning.reference_hz);
        let (_, _, yaw) = motion.euler_rad();
        let (sine, cosine) = math::sin_cos(yaw);
        let cg = Vector3::z() * self.cg_height_m;
        let mut moment = Moment {
            time: input.now,
            dt: input.dt,
            speed_m_s: math::hypot(velocity.x, velocity.y),
            unknown: input.unknown,
            tyres_m: [Vector3::zeros(); 4],
            upward: [1.0; 4],
            rise_m_s: [0.0; 4],
            tilt_sigma_rad: input.tilt_sigma_rad,
        };
        for (i, corner) in input.corners.iter().enumerate() {
            let further_m = input.strut_m[i] - corner.pose.strut_length_m;
            let centre = corner.pose.wheel_centre_m + corner.travel.path * further_m;
            let axes = WheelAxes::carrier(corner.pose.spindle.into());
            let along = motion.earth_from_body * Vector3::from(axes.rows()[2]);
            let lowest = motion.earth_from_body * (centre - cg) - along * self.radius_m[i];
            moment.tyres_m[i] = Vector3::new(
                cosine * lowest.x + sine * lowest.y,
                cosine * lowest.y - sine * lowest.x,
                lowest.z + self.cg_height_m + height_m,
            );
            moment.upward[i] = along.z;
            let relative = corner.travel_m_s + motion.rate_rad_s.cross(&(centre - cg));
            moment.rise_m_s[i] = velocity.z + (motion.earth_from_body * relative).z;
        }
        moment
    }

    /// The road of a moment by loads; `output`: 0 causal, 1 with the lag.
    fn road(&mut self, moment: &Moment, forces: &PerWheel<TyreForce>, output: usize) -> Road {
        let t = self.tuning;
        let slow = (moment.speed_m_s < t.speed_min_m_s).then_some(RoadUnknown::Slow);
        if let Some(why) = moment.unknown.or(slow) {
            return Road::unknown(moment.time, why);
        }
        let mut road = Road {
            unknown: None,
            ..Road::unknown(moment.time, RoadUnknown::Settling)
        };
        let mut relative = [0.0; 4];
        for i in 0..4 {
            let TyreForce {
                force_n: [_, _, load_n],
                sigma_n: [_, _, sigma_n],
                ..
            } = forces.0[i];
            let k = self.stiffness_n_m[i];
            let pressed_m = load_n.max(0.0) / k * moment.upward[i];
            let uneven_m = t.tyre_part * (load_n - self.static_load_n[i]) / k;
            let slope = moment.rise_m_s[i] / moment.speed_m_s;
            let [height_m, lifted_m] = self.footings[output][i].step(
                moment.tyres_m[i].z + pressed_m,
                load_n / self.static_load_n[i],
                moment.speed_m_s * moment.dt,
                &t,
            );
            let own = [
                t.wheel_sigma_m,
                sigma_n / k,
                uneven_m,
                t.slope_part_m * slope,
                lifted_m,
            ];
            relative[i] = own.iter().map(|sigma| sigma * sigma).sum();
            road.height_m.0[i] = height_m;
            road.height_sigma_m.0[i] = (relative[i] + t.body_sigma_m * t.body_sigma_m).sqrt();
        }
        let places = moment.tyres_m.each_ref().map(|tyre| [tyre.x, tyre.y]);
        road.plane = fit(&places, &road.height_m.0, &relative, moment.tilt_sigma_rad);
        road
    }
}

/// Height of the body's centre of gravity against a reference that follows it slowly.
///
/// z'' + 2 d w z' + w^2 z = v', with the upward velocity v, w = 2 pi f and d = 1/sqrt(2): a high-pass of
/// second order of the integral of v.
#[derive(Clone, Copy, Debug, Default)]
struct BodyHeight {
    height_m: f64,
    /// Integral of the height, m s.
    integral: f64,
    velocity_m_s: Option<f64>,
}

impl BodyHeight {
    /// Takes the upward velocity, m/s; returns the height, m.
    fn step(&mut self, dt: f64, up_m_s: f64, reference_hz: f64) -> f64 {
        if !up_m_s.is_finite() {
            return self.height_m;
        }
        let before = self.velocity_m_s.replace(up_m_s).unwrap_or(up_m_s);
        let w = std::f64::consts::TAU * reference_hz;
        let back = std::f64::consts::SQRT_2 * w * self.height_m + w * w * self.integral;
        self.height_m += dt * (0.5 * (before + up_m_s) - back);
        self.integral += dt * self.height_m;
        self.height_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_passes_and_a_climb_does_not() {
        let mut body = BodyHeight::default();
        let (dt, w) = (0.01, std::f64::consts::TAU);
        let mut worst: f64 = 0.0;
        for k in 0..60_000 {
            let t = f64::from(k) * dt;
            let up = 0.5 + 0.05 * w * math::cos(w * t);
            let height = body.step(dt, up, 0.02);
            if t > 300.0 {
                worst = worst.max((height - 0.05 * math::sin(w * t)).abs());
            }
        }
        assert!(worst < 0.003, "{worst}");
    }
}
