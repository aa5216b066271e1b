//! Heights from the scales of a vehicle whose equilibrium is solved by itself: a body on two springs that act
//! along its normal, unsprung masses, tyres that act vertically.

use model::vehicle::Vehicle;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;

const G: f64 = STANDARD_GRAVITY_M_S2;

/// The vehicle in its side view. Lengths in the body's frame: forward from the rear axle, up.
struct Side {
    wheelbase_m: f64,
    body_kg: f64,
    unsprung_kg: [f64; 2],
    cg_m: [f64; 2],
    spring_n_m: [f64; 2],
    free_m: [f64; 2],
    tyre_n_m: [f64; 2],
    radius_m: [f64; 2],
}

impl Side {
    /// A vehicle with the stiffnesses of a file, and a body of its own.
    fn of(vehicle: &Vehicle) -> Self {
        let axles = [Wheel::FrontLeft, Wheel::RearLeft].map(|wheel| vehicle.axle(wheel));
        let unsprung_kg = axles.map(|axle| axle.unsprung_mass_kg());
        Self {
            wheelbase_m: vehicle.wheelbase_m(),
            body_kg: vehicle.body.mass_kg - unsprung_kg[0] - unsprung_kg[1],
            unsprung_kg,
            cg_m: [0.62, 0.33],
            spring_n_m: axles.map(|axle| 2.0 * axle.wheel_rate_n_m()),
            free_m: [0.1, 0.15],
            tyre_n_m: axles.map(|axle| 2.0 * axle.tyre.vertical_stiffness_n_m),
            radius_m: axles.map(|axle| axle.tyre.unloaded_radius_m),
        }
    }

    /// Loads of the axles, N, and height of the whole centre of gravity above the rear pad, m, with the front
    /// pad higher by `lift_m`. Springs that are locked keep `lengths`; the lengths are given back.
    fn solve(&self, lift_m: f64, locked: Option<[f64; 2]>) -> ([f64; 2], f64, [f64; 2]) {
        let whole_n = G * (self.body_kg + self.unsprung_kg[0] + self.unsprung_kg[1]);
        let (mut front_n, mut angle) = (0.5 * whole_n, 0.0_f64);
        let mut lengths = self.free_m;
        let mut height_m = 0.0;
        for _ in 0..2_000 {
            let loads = [front_n, whole_n - front_n];
            for axle in 0..2 {
                let spring_n = (loads[axle] - G * self.unsprung_kg[axle]) * math::cos(angle);
                let free = self.free_m[axle] - spring_n / self.spring_n_m[axle];
                lengths[axle] = locked.map_or(free, |locked| locked[axle]);
            }
            let centre = |axle: usize| self.radius_m[axle] - loads[axle] / self.tyre_n_m[axle];
            let rise_m = lift_m + centre(0) - centre(1);
            // (L, -l_f) less (0, -l_r), turned by the angle, rises by this.
            let tilt = (lengths[0] - lengths[1]) * math::cos(angle);
            angle = math::asin((rise_m + tilt) / self.wheelbase_m);
            let (sine, cosine) = math::sin_cos(angle);
            let base_m = self.wheelbase_m * cosine + (lengths[0] - lengths[1]) * sine;
            let [along, up] = self.cg_m;
            let body_m = along * cosine - (up + lengths[1]) * sine;
            let next = G * (self.unsprung_kg[0] * base_m + self.body_kg * body_m) / base_m;
            front_n += 0.5 * (next - front_n);
            let body_up = centre(1) + along * sine + (up + lengths[1]) * cosine;
            let moment = self.body_kg * body_up
                + self.unsprung_kg[0] * (centre(0) + lift_m)
                + self.unsprung_kg[1] * centre(1);
            height_m = moment * G / whole_n;
        }
        ([front_n, whole_n - front_n], height_m, lengths)
    }

    fn reading(
        &self,
        lift_m: f64,
        locked: Option<[f64; 2]>,
        noise: &mut impl FnMut() -> f64,
    ) -> Reading {
        let (loads, ..) = self.solve(lift_m, locked);
        Reading {
            raised: (lift_m > 0.0).then_some(Axle::Front),
            lift_m,
            axle_kg: loads.map(|load| load / G + noise()),
        }
    }
}

const OPTIONS: Options = Options {
    locked: false,
    scale_sigma_kg: 0.5,
    lift_sigma_m: 0.002,
};

fn prowler() -> Vehicle {
    Vehicle::builtin("prowler").expect("a built-in vehicle")
}

#[test]
fn exact_scales_give_the_height_with_springs_locked_or_free() {
    let vehicle = prowler();
    let side = Side::of(&vehicle);
    let (_, truth_m, lengths) = side.solve(0.0, None);
    for locked in [true, false] {
        let held = locked.then_some(lengths);
        let readings = [0.0, 0.3, 0.45].map(|lift| side.reading(lift, held, &mut || 0.0));
        let options = Options { locked, ..OPTIONS };
        let found = cg_height(&vehicle, &readings, &options).expect("a height");
        let [height_m, sigma_m] = found.value("cg_height");
        assert!(
            (height_m - truth_m).abs() < 0.005,
            "{locked}: {height_m} for {truth_m}"
        );
        assert!(sigma_m < 0.02, "{sigma_m}");
        // Without the correction, free springs would be an error.
        if !locked {
            let wrong = Options {
                locked: true,
                ..OPTIONS
            };
            let [wrong_m, _] = cg_height(&vehicle, &readings, &wrong)
                .expect("a height")
                .value("cg_height");
            assert!(
                (wrong_m - truth_m).abs() > 2.0 * (height_m - truth_m).abs(),
                "{wrong_m}"
            );
        }
    }
}

#[test]
fn intervals_hold_and_errors_are_within_10_mm() {
    let vehicle = prowler();
    let side = Side::of(&vehicle);
    let (_, truth_m, _) = side.solve(0.0, None);
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let normal = Normal::new(0.0, 0.5).expect("a distribution");
    let (mut inside, mut within) = (0, 0);
    for _ in 0..100 {
        let mut noise = || normal.sample(&mut random);
        let lifts = [0.0, 0.0, 0.35, 0.45, 0.5, 0.5];
        let readings = lifts.map(|lift| side.reading(lift, None, &mut noise));
        let found = cg_height(&vehicle, &readings, &OPTIONS).expect("a height");
        let finding = found.get("cg_height").expect("the height");
        let [low, high] = finding.interval.expect("an interval");
        inside += usize::from((low..=high).contains(&truth_m));
        within += usize::from((finding.value - truth_m).abs() < 0.01);
    }
    assert!(
        (90..=100).contains(&inside),
        "{inside} of 100 intervals hold"
    );
    assert!(within >= 95, "{within} of 100 are within 10 mm");
}

#[test]
fn readings_that_cannot_be_used_are_named() {
    let vehicle = prowler();
    let side = Side::of(&vehicle);
    let level = side.reading(0.0, None, &mut || 0.0);
    let raised = side.reading(0.4, None, &mut || 0.0);
    let said = |readings: &[Reading]| {
        cg_height(&vehicle, readings, &OPTIONS)
            .expect_err("refused")
            .to_string()
    };
    assert!(said(&[level]).contains("no reading with a raised axle"));
    assert!(said(&[raised]).contains("no reading of the level vehicle"));
    let low = Reading {
        lift_m: 0.05,
        ..raised
    };
    assert!(said(&[level, low]).contains("lift over wheelbase"));
    let heavy = Reading {
        axle_kg: raised.axle_kg.map(|kg| kg + 20.0),
        ..raised
    };
    assert!(said(&[level, raised, heavy]).contains("front_kg + rear_kg of row 3"));
    let negative = Reading {
        axle_kg: [-1.0, 300.0],
        ..level
    };
    assert!(said(&[negative, raised]).contains("front_kg = -1"));
}
