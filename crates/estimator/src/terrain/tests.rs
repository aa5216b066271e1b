use sample::ForceSource;

use super::*;

const TIME: LogTime = LogTime(1_000_000_000);
/// A road without roughness, N²/s.
const SMOOTH: f64 = 2.0e4;
/// A road of class D, N²/s.
const ROUGH: f64 = 1.0e7;
/// Rolling resistance over load of the vehicle file.
const FILE: f64 = 0.02;

fn estimator() -> TerrainEstimator {
    let vehicle = Vehicle::builtin("prowler").expect("a vehicle");
    TerrainEstimator::new(&vehicle, &TerrainTuning::default())
}

/// Forces of a drive with a resistance of the front axle, over its load.
fn forces(resistance: f64, driven: f64) -> PerWheel<TyreForce> {
    PerWheel::from_fn(|wheel| TyreForce {
        force_n: [
            1000.0
                * if wheel.is_front() {
                    -resistance
                } else {
                    driven
                },
            0.0,
            1000.0,
        ],
        sigma_n: [10.0; 3],
        source: ForceSource::Fusion,
        ..TyreForce::default()
    })
}

fn grip(friction: Option<f64>, friction_min: f64) -> AxleGrip {
    AxleGrip {
        stiffness_factor: 1.0,
        stiffness_factor_sigma: 0.2,
        friction,
        friction_sigma: friction.map(|_| 0.05),
        friction_min,
        ..AxleGrip::default()
    }
}

/// The ground after some seconds of the same.
fn after(
    estimator: &mut TerrainEstimator,
    seconds: u32,
    resistance: f64,
    grip: &AxleGrip,
) -> Terrain {
    let forces = forces(resistance, 0.1);
    let mut terrain = estimator.present(TIME);
    for _ in 0..10 * seconds {
        for _ in 0..10 {
            estimator.step(0.01, 8.0, &forces);
        }
        terrain = estimator.terrain(TIME, 0.1, [grip, grip], SMOOTH);
    }
    terrain
}

#[test]
fn much_grip_on_firm_ground_is_asphalt_and_its_probabilities_add_up() {
    let found = after(&mut estimator(), 3, FILE, &grip(Some(0.87), 0.5));
    assert_eq!(found.class, TerrainClass::Asphalt, "{found:?}");
    let sum: f64 = found.probability.iter().sum();
    assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    assert!((found.rolling_resistance - FILE).abs() < 1e-12);
    // 10 N on each wheel of 1000 N load: 10 sqrt(2)/2000, and 0.01.
    let sigma = math::hypot(0.01, 2.0_f64.sqrt() * 10.0 / 2000.0);
    assert!(
        (found.rolling_resistance_sigma - sigma).abs() < 1e-12,
        "{found:?}"
    );
}

#[test]
fn the_lower_bound_of_the_friction_excludes_classes_with_less() {
    let mut weak = estimator();
    let mut strong = estimator();
    for _ in 0..30 {
        weak.terrain(TIME, 0.1, [&grip(None, 0.2); 2], ROUGH);
        strong.terrain(TIME, 0.1, [&grip(None, 0.75); 2], ROUGH);
    }
    assert_eq!(weak.present(TIME).class, TerrainClass::Gravel, "{weak:?}");
    assert_ne!(
        strong.present(TIME).class,
        TerrainClass::Gravel,
        "{strong:?}"
    );
}

#[test]
fn the_resistance_tells_sand_from_loam_and_another_surface_is_named_within_3_s() {
    let mut estimator = estimator();
    let unknown = grip(None, 0.2);
    let t = TerrainTuning::default();
    let sand = after(&mut estimator, 3, FILE + t.resistance[3], &unknown);
    assert_eq!(sand.class, TerrainClass::Sand, "{sand:?}");
    let loam = after(&mut estimator, 3, FILE + t.resistance[2], &unknown);
    assert_eq!(loam.class, TerrainClass::Loam, "{loam:?}");
}

#[test]
fn what_fits_no_class_is_unknown() {
    let found = after(&mut estimator(), 3, 0.5, &grip(None, 0.1));
    assert_eq!(found.class, TerrainClass::Unknown, "{found:?}");
    let ice = after(&mut estimator(), 3, FILE, &grip(Some(0.12), 0.1));
    assert_eq!(ice.class, TerrainClass::Unknown, "{ice:?}");
}

#[test]
fn braking_is_no_rolling_resistance() {
    let mut estimator = estimator();
    for _ in 0..300 {
        estimator.step(0.01, 8.0, &forces(0.3, -0.3));
    }
    assert!(estimator.present(TIME).rolling_resistance.is_nan());
    assert_eq!(estimator.present(TIME).class, TerrainClass::Unknown);
}
