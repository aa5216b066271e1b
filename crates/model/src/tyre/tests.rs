//! What holds for every tyre.

use super::*;
use num_dual::DualSVec64;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn physical(law: Law) -> Tyre {
    Tyre::Physical(Physical {
        law,
        cornering: Stiffness::Power {
            at_reference: 8538.0,
            reference_load_n: 1831.0,
            exponent: 0.75,
        },
        slip: Stiffness::Constant(12_000.0),
        friction: 0.87,
        sliding_friction: 0.8,
        camber_stiffness_n_rad: 500.0,
        contact_length_m: 0.1,
    })
}

fn tyres() -> Vec<Tyre> {
    let mut all: Vec<Tyre> = [Law::Fiala, Law::Brush, Law::Exponential, Law::Dugoff]
        .into_iter()
        .map(physical)
        .collect();
    all.push(Tyre::Rational(Box::new(rational::tests::front())));
    all.push(Tyre::MagicFormula89(Box::default()));
    all.push(Tyre::MagicFormula52(Box::default()));
    for text in [property::tests::MF52, property::tests::MF61] {
        let tir = Tir::parse(text, "tyre.tir").unwrap();
        all.push(Tyre::Property(Box::new(PropertyTyre::measured(&tir))));
    }
    all
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256,
        rng_seed: RngSeed::Fixed(228),
        ..ProptestConfig::default()
    })]

    #[test]
    fn forces_are_finite_and_those_with_friction_circles_stay_inside(
        load in 0.0..5000.0_f64,
        slip_tangent in -20.0..20.0_f64,
        slip_ratio in -1.0..5.0_f64,
        camber_rad in -0.2..0.2_f64,
        friction_scale in 0.2..1.2_f64,
    ) {
        let contact = Contact {
            load_n: load,
            slip_tangent,
            slip_ratio,
            camber_rad,
            friction_scale,
            stiffness_scale: 1.0,
        };
        for tyre in tyres() {
            let f = tyre.forces(&contact);
            prop_assert!(f.longitudinal_n.is_finite() && f.lateral_n.is_finite() && f.aligning_n_m.is_finite(), "{tyre:?}");
            if let Tyre::Physical(_) = &tyre {
                let most = 0.87 * friction_scale * load * (1.0 + 1e-9) + 1e-9;
                prop_assert!(math::hypot(f.longitudinal_n, f.lateral_n) <= most, "{tyre:?} {f:?}");
            }
            // Friction takes power: F_x slip_x >= 0 where the shifts and camber play no part.
            if let (Tyre::Physical(_), true) = (&tyre, slip_ratio.abs() > 1e-6) {
                prop_assert!(f.longitudinal_n * slip_ratio >= 0.0);
            }
        }
    }

    #[test]
    fn derivatives_by_dual_numbers_meet_finite_differences(
        load in 200.0..4000.0_f64,
        slip_tangent in -1.0..1.0_f64,
        slip_ratio in -0.6..0.6_f64,
    ) {
        for tyre in tyres() {
            let at = |v: [f64; 3]| {
                let f = tyre.forces(&Contact { slip_tangent: v[1], slip_ratio: v[2], ..Contact::lateral(v[0], 0.0) });
                [f.longitudinal_n, f.lateral_n, f.aligning_n_m]
            };
            let (_, exact) = num_dual::jacobian(|v: nalgebra::SVector<DualSVec64<3>, 3>| {
                let f = tyre.forces(&Contact { slip_tangent: v[1], slip_ratio: v[2], ..Contact::lateral(v[0], DualSVec64::from(0.0)) });
                nalgebra::SVector::from([f.longitudinal_n, f.lateral_n, f.aligning_n_m])
            }, &nalgebra::SVector::from([load, slip_tangent, slip_ratio]));
            for j in 0..3 {
                let h = [1e-3, 1e-7, 1e-7][j];
                let shifted = |by: f64| {
                    let mut v = [load, slip_tangent, slip_ratio];
                    v[j] += by;
                    at(v)
                };
                let (up, here, down) = (shifted(h), shifted(0.0), shifted(-h));
                for i in 0..3 {
                    let slope = (up[i] - down[i]) / (2.0 * h);
                    let kink = ((up[i] - here[i]) - (here[i] - down[i])) / h;
                    let size = 1.0 + exact.row(i).amax();
                    if kink.abs() < 1e-4 * size {
                        prop_assert!((exact[(i, j)] - slope).abs() < 1e-4 * size, "{tyre:?} {i} {j}: {} {slope}", exact[(i, j)]);
                    }
                }
            }
        }
    }
}

#[test]
fn an_airborne_tyre_gives_nothing() {
    for tyre in tyres() {
        assert_eq!(
            tyre.forces(&Contact::combined(0.0, 0.3, 0.3)),
            Forces::zero()
        );
        assert_eq!(
            tyre.forces(&Contact::combined(-5.0, 0.3, 0.3)),
            Forces::zero()
        );
    }
}

#[test]
fn a_locked_wheel_slides_at_full_friction_against_its_motion() {
    let sideways = physical(Law::Dugoff).forces(&Contact::combined(1831.0_f64, 0.0, -1.0));
    // Camber stiffness acts on no camber here.
    assert!(
        (sideways.longitudinal_n + 0.87 * 1831.0).abs() < 1e-9,
        "{sideways:?}"
    );
}

#[test]
fn load_laws_meet_their_definitions() {
    let sine = Stiffness::Sine {
        most: 9000.0,
        load_of_most_n: 2500.0,
    };
    for load in [500.0, 1831.0, 2500.0, 4000.0_f64] {
        let expected = 9000.0 * math::sin(2.0 * math::atan(load / 2500.0));
        assert!((sine.at(load) - expected).abs() < 1e-9);
        for exponent in [0.0, 0.5, 0.75, 0.766, 1.0_f64] {
            let power = Stiffness::Power {
                at_reference: 8538.0,
                reference_load_n: 1831.0,
                exponent,
            };
            let expected = 8538.0 * math::powf(load / 1831.0, exponent);
            assert!((power.at(load) - expected).abs() < 1e-9);
        }
    }
}

#[test]
fn slips_are_finite_at_rest_and_exact_under_way() {
    assert!((steady_slip(0.3_f64, 6.0, 0.5) - 0.05).abs() < 1e-15);
    assert!((steady_slip(0.3_f64, -6.0, 0.5) - 0.05).abs() < 1e-15);
    assert!(steady_slip(0.3_f64, 0.0, 0.5).is_finite());
    assert_eq!(relaxed_rate(0.1, 0.0, 0.0, 0.25), 0.0);
    assert!((relaxed_rate(0.05_f64, 0.3, 6.0, 0.25)).abs() < 1e-12);
}

#[test]
fn camber_pushes_the_way_that_the_wheel_leans() {
    let contact = Contact {
        camber_rad: 0.1,
        ..Contact::lateral(1831.0, 0.0)
    };
    assert_eq!(physical(Law::Brush).forces(&contact).lateral_n, -50.0);
}
