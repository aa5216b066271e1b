//! Full car: heave, roll and pitch over four wheels (section 2.2.3 of the thesis, which describes
//! it in words).

use nalgebra::{SMatrix, SVector};
use sample::Wheel;

use super::SuspensionError;
use super::ride::{Assembly, Ride, RideCorner};
use crate::vehicle::Vehicle;

/// Full car; degrees of freedom z_s, phi (right side down), theta (nose down) at the body's centre
/// of gravity, then the wheels' heights in the usual order.
///
/// Body height over wheel i is z_s + y_i phi - x_i theta. Gravity's own moment in roll and pitch
/// (m g h times the angle) belongs to the handling models and is not in this one.
pub type FullCar = Ride<7, 14, 4>;

impl FullCar {
    /// The model from its parts: wheel positions (x, y) from the sprung centre of gravity, and the
    /// anti-roll bars of both axles in N m/rad.
    ///
    /// # Errors
    /// When a value is not finite, a mass not positive, or a stiffness or damping negative.
    pub fn new(
        sprung_mass_kg: f64,
        inertia_roll_pitch_kg_m2: [f64; 2],
        wheel_m: [[f64; 2]; 4],
        corners: [RideCorner; 4],
        anti_roll_bar_n_m_rad: [f64; 2],
    ) -> Result<Self, SuspensionError> {
        let [roll, pitch] = inertia_roll_pitch_kg_m2;
        let mut lift = SMatrix::<f64, 4, 7>::zeros();
        for (i, [x, y]) in wheel_m.into_iter().enumerate() {
            lift[(i, 0)] = 1.0;
            lift[(i, 1)] = y;
            lift[(i, 2)] = -x;
        }
        let bar = |left: usize, stiffness: f64| {
            let track = wheel_m[left][1] - wheel_m[left + 1][1];
            (stiffness > 0.0).then(|| (left, left + 1, stiffness / track.powi(2)))
        };
        Self::assemble(&Assembly {
            body_mass: SVector::from([sprung_mass_kg, roll, pitch, 0.0, 0.0, 0.0, 0.0]),
            lift,
            corners,
            bars: [
                bar(0, anti_roll_bar_n_m_rad[0]),
                bar(2, anti_roll_bar_n_m_rad[1]),
            ],
        })
    }

    /// A vehicle's full car.
    ///
    /// # Errors
    /// When an axle's hard-points are degenerate.
    pub fn of(vehicle: &Vehicle) -> Result<Self, SuspensionError> {
        let sprung = vehicle.sprung();
        let [roll, pitch, _] = sprung.inertia_kg_m2;
        let front = RideCorner::of(vehicle, Wheel::FrontLeft)?;
        let rear = RideCorner::of(vehicle, Wheel::RearLeft)?;
        let place = |wheel: Wheel| {
            let [x, y] = vehicle.wheel_place_m(wheel);
            [x - sprung.cg_m[0], y]
        };
        Self::new(
            sprung.mass_kg,
            [roll, pitch],
            Wheel::ALL.map(place),
            [front, front, rear, rear],
            [
                vehicle.front.anti_roll_bar_n_m_rad,
                vehicle.rear.anti_roll_bar_n_m_rad,
            ],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suspension::{HalfCar, QuarterCar, frequency_and_damping};
    use nalgebra::Complex;
    use proptest::prelude::*;

    fn corner(stiffness_n_m: f64) -> RideCorner {
        RideCorner {
            unsprung_mass_kg: 26.0,
            stiffness_n_m,
            damping_n_s_m: 600.0,
            tyre_stiffness_n_m: 120_000.0,
            tyre_damping_n_s_m: 500.0,
        }
    }

    const TRACK_M: f64 = 1.1;
    const X_M: [f64; 2] = [0.85, -0.6];

    fn full(front: f64, rear: f64, bars: [f64; 2]) -> FullCar {
        let y = 0.5 * TRACK_M;
        FullCar::new(
            540.0,
            [175.0, 375.0],
            [[X_M[0], y], [X_M[0], -y], [X_M[1], y], [X_M[1], -y]],
            [corner(front), corner(front), corner(rear), corner(rear)],
            bars,
        )
        .expect("in range")
    }

    fn holds(poles: &[Complex<f64>], pole: Complex<f64>) -> bool {
        poles.iter().any(|p| (p - pole).norm() < 1e-6 * pole.norm())
    }

    #[test]
    fn the_half_cars_are_parts_of_the_full_car() {
        let poles = full(11_000.0, 12_500.0, [0.0; 2]).poles();
        let pair = |k| {
            let one = corner(k);
            RideCorner {
                unsprung_mass_kg: 2.0 * one.unsprung_mass_kg,
                stiffness_n_m: 2.0 * one.stiffness_n_m,
                damping_n_s_m: 2.0 * one.damping_n_s_m,
                tyre_stiffness_n_m: 2.0 * one.tyre_stiffness_n_m,
                tyre_damping_n_s_m: 2.0 * one.tyre_damping_n_s_m,
            }
        };
        let half = HalfCar::longitudinal(540.0, 375.0, X_M, [pair(11_000.0), pair(12_500.0)])
            .expect("in range");
        for pole in half.poles() {
            assert!(holds(&poles, pole), "{pole}");
        }
        // An axle in anti-phase and the body in heave: equal axles decouple into quarter cars.
        let even = HalfCar::lateral(270.0, 90.0, TRACK_M, corner(11_000.0), 3000.0)
            .expect("in range")
            .poles();
        for pole in QuarterCar::new(135.0, corner(11_000.0))
            .expect("in range")
            .poles()
        {
            assert!(holds(&even, pole), "{pole}");
        }
    }

    #[test]
    fn a_bar_stiffens_roll_alone() {
        let bare = full(11_000.0, 12_500.0, [0.0; 2]);
        let barred = full(11_000.0, 12_500.0, [2000.0, 1000.0]);
        let change = bare.state - barred.state;
        assert!((change[(1, 8)] * 175.0 - 3000.0).abs() < 1e-9);
        assert_eq!(change[(0, 7)], 0.0);
        assert_eq!(change[(2, 9)], 0.0);
    }

    #[test]
    fn vehicles_that_ship_ride_as_vehicles_do() {
        let mut whole = 0;
        for name in Vehicle::builtin_names() {
            let vehicle = Vehicle::builtin(name).expect("ships with the project");
            let Ok(car) = FullCar::of(&vehicle) else {
                assert!(vehicle.front.unsprung.is_none(), "{name}");
                continue;
            };
            whole += 1;
            let modes: Vec<_> = car.poles().into_iter().map(frequency_and_damping).collect();
            assert!(modes.iter().all(|[_, damping]| *damping > 0.0), "{name}");
            if vehicle.front.has_hard_points() {
                // Chang's dampers hold the wheels so hard that they do not hop.
                let hops = modes
                    .iter()
                    .filter(|[hz, _]| (8.0..14.0).contains(hz))
                    .count();
                assert_eq!(hops, 8, "{name}: four wheels hop, {modes:?}");
            }
            let axles = [Wheel::FrontLeft, Wheel::RearLeft];
            for wheel in axles {
                let quarter = QuarterCar::of(&vehicle, wheel).expect("whole");
                let [bounce, _] = frequency_and_damping(quarter.poles()[0]);
                assert!((0.8..2.5).contains(&bounce), "{name} {wheel}: {bounce} Hz");
            }
            HalfCar::of(&vehicle).expect("whole");
            HalfCar::lateral_of(&vehicle, Wheel::RearLeft).expect("whole");
        }
        assert!(whole >= 1, "no vehicle has unsprung masses");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(8), ..ProptestConfig::default() })]

        /// A plane road, tilted and raised, carries the car without deflecting anything.
        #[test]
        fn a_plane_road_is_an_equilibrium(z in -0.1..0.1, phi in -0.1..0.1, theta in -0.1..0.1) {
            let model = full(11_000.0, 12_500.0, [2000.0, 0.0]);
            let body = SVector::<f64, 3>::new(z, phi, theta);
            let road = model.travel.fixed_columns::<3>(0) * body;
            let mut state = SVector::<f64, 14>::zeros();
            state.fixed_rows_mut::<3>(7).copy_from(&body);
            state.fixed_rows_mut::<4>(10).copy_from(&road);
            let rate = model.derivative(&state, &road, &SVector::zeros());
            prop_assert!(rate.amax() < 1e-9);
            prop_assert!(model.travel_m(&state).amax() < 1e-12);
            prop_assert!(model.tyre_compression_m(&state, &road).amax() < 1e-12);
        }

        /// Left free on a flat road, energy only falls.
        #[test]
        fn every_mode_decays(front in 5e3..3e4, rear in 5e3..3e4, bar in 0.0..5e3) {
            for pole in full(front, rear, [bar, 0.0]).poles() {
                prop_assert!(pole.re < 0.0, "{pole}");
            }
        }
    }
}
