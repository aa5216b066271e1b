//! Corners without geometry: the sensitivity matrix of each wheel from a load rig, and wheel-force transducers.

use atvrec_estimator::calibration::load_rig::{LoadRig, RigLoad, load_rig};
use atvrec_estimator::calibration::rest::{Rest, Signal};
use atvrec_estimator::calibration::zero::{CornerRest, ZeroInput, zero};
use atvrec_estimator::{Calibration, Estimator, EstimatorError, Settings};
use model::sensors::{Sensors, StrainChain, Transducer};
use model::steering::SteeringGear;
use model::suspension::{ChannelKind, Corner, CornerStatics, TyreFrame, Wrench};
use model::vehicle::Vehicle;
use nalgebra::{Rotation3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sample::{
    Counts, EventKind, ForceSource, Measurement, PerWheel, STANDARD_GRAVITY_M_S2, Sample,
    StrainChannel, Wheel,
};
use testkit::scoring::{
    self, carrier_errors, carrier_squares, deviations, estimate, force_errors, row,
};
use testkit::sensing;
use testkit::truth::{self, RATE_HZ, Run};

use crate::RUNS;

/// Largest mean square of the normalised errors of an axis. The errors of a matrix are not noise: on the launch,
/// those of F_x follow the moments of drive and brakes.
const SQUARE_MAX: f64 = 4.2;
/// Largest errors of the lateral and the vertical path of the contact point for one metre of strut, and of the
/// turn of the upright about x, rad/m.
const PATH_MAX: [f64; 3] = [0.05, 0.05, 0.2];

/// Loads of the rig: force, N, and point of application from the wheel centre, m. The contact point is 0.28 m
/// below it.
const LOW: [f64; 3] = [0.0, 0.0, -0.28];
const LOADS: [Load; 23] = [
    ([0.0, 0.0, 300.0], LOW),
    ([0.0, 0.0, 1500.0], LOW),
    ([0.0, 0.0, 3000.0], LOW),
    ([700.0, 0.0, 500.0], [0.0; 3]),
    ([-700.0, 0.0, 500.0], [0.0; 3]),
    ([700.0, 0.0, 2500.0], [0.0; 3]),
    ([-700.0, 0.0, 2500.0], [0.0; 3]),
    ([0.0, 900.0, 500.0], LOW),
    ([0.0, -900.0, 500.0], LOW),
    ([0.0, 900.0, 2500.0], LOW),
    ([0.0, -900.0, 2500.0], LOW),
    ([0.0, 900.0, 1500.0], [0.0; 3]),
    ([0.0, -900.0, 1500.0], [0.0; 3]),
    ([0.0, 700.0, 1500.0], [0.15, 0.0, -0.28]),
    ([0.0, -700.0, 1500.0], [0.15, 0.0, -0.28]),
    ([0.0, 700.0, 1500.0], [-0.15, 0.0, -0.28]),
    ([0.0, -700.0, 1500.0], [-0.15, 0.0, -0.28]),
    ([500.0, 0.0, 500.0], LOW),
    ([-500.0, 0.0, 500.0], LOW),
    ([500.0, 0.0, 2500.0], LOW),
    ([-500.0, 0.0, 2500.0], LOW),
    ([0.0, 900.0, 2500.0], [0.0; 3]),
    ([0.0, -900.0, 500.0], [0.0; 3]),
];

/// Forces of the members of a corner with its geometry, the last of them the strut's, N.
fn member_forces(load: &RigLoad, compression_m: f64) -> [f64; 6] {
    let vehicle = truth::vehicle();
    let axle = vehicle.axle(load.wheel);
    let corner = Corner::of(vehicle, load.wheel).unwrap();
    let pose = corner
        .pose(corner.design_strut_length_m() - compression_m, 0.0)
        .unwrap();
    let (up, kind) = (Vector3::z(), ChannelKind::Strut);
    let statics = CornerStatics::standing(&corner, &pose, axle, up, 0.0, kind).unwrap();
    let frame = TyreFrame::new(&pose, up, axle.tyre.unloaded_radius_m, 0.0);
    let force = Vector3::from(load.force_n);
    let point = pose.wheel_centre_m + Vector3::from(load.at_m);
    let moment = (point - frame.contact_m).cross(&force);
    let wrench = Wrench {
        force_n: frame.vehicle_from_tyre.tr_mul(&force),
        moment_n_m: frame.vehicle_from_tyre.tr_mul(&moment),
    };
    statics.members(&wrench).to_vector().into()
}

/// Compression of a strut at which spring and linkage hold a load, m, by bisection.
fn compression_m(load: &RigLoad) -> f64 {
    let strut = truth::vehicle().axle(load.wheel).strut.as_ref().unwrap();
    let (mut low, mut high) = (-0.05, 0.05);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let spring_n = strut.force(strut.design_length_m - middle, 0.0).total_n();
        if spring_n < member_forces(load, middle)[5] {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// What the rig does to one corner of the vehicle with its geometry. The springs are in place, so that the load
/// compresses the strut.
fn loads(wheel: Wheel, sensors: &Sensors, of: &[Load]) -> Vec<RigLoad> {
    let scale = sensors.strain.axial_scale().unwrap();
    of.iter()
        .map(|(force_n, at_m)| {
            let mut load = RigLoad {
                wheel,
                force_n: *force_n,
                at_m: *at_m,
                compression_m: 0.0,
                steering_wheel_rad: 0.0,
                counts: [None; StrainChannel::COUNT],
            };
            load.compression_m = compression_m(&load);
            let forces = member_forces(&load, load.compression_m);
            for (counts, force) in load.counts.iter_mut().zip(&forces[..5]) {
                *counts = Some([scale.level(*force), 0.05]);
            }
            load
        })
        .collect()
}

/// The vehicle without its hard-points: straight paths of the wheels and a map of the steering.
fn without_geometry() -> Vehicle {
    let mut vehicle = truth::vehicle().clone();
    let gear = SteeringGear::from_vehicle(&vehicle).unwrap();
    let angles: Vec<f64> = (-20..=20).map(|k| 0.2 * f64::from(k)).collect();
    let map = |at: &dyn Fn(f64) -> f64| angles.iter().map(|a| [*a, at(*a)]).collect();
    vehicle.steering.left_map_rad = map(&|a| gear.left.at(a));
    vehicle.steering.right_map_rad = map(&|a| gear.right.at(a));
    let ratios = [Wheel::FrontLeft, Wheel::RearLeft].map(|wheel| {
        let corner = Corner::of(&vehicle, wheel).unwrap();
        let pose = corner.pose(corner.design_strut_length_m(), 0.0).unwrap();
        corner.rates(&pose).motion_ratio()
    });
    for (axle, ratio) in [&mut vehicle.front, &mut vehicle.rear]
        .into_iter()
        .zip(ratios)
    {
        axle.wishbone = None;
        axle.strut.as_mut().unwrap().motion_ratio = Some(ratio);
    }
    vehicle
}

type Load = ([f64; 3], [f64; 3]);

fn rig(sensors: &Sensors, of: &[Load]) -> Result<LoadRig, EstimatorError> {
    let vehicle = without_geometry();
    let all: Vec<RigLoad> = (Wheel::ALL.into_iter())
        .flat_map(|wheel| loads(wheel, sensors, of))
        .collect();
    load_rig(
        &vehicle,
        sensors,
        &Calibration::nominal(&vehicle.name),
        &all,
    )
}

/// The calibration by the rig; the zeros of the virtual sensors are as uncertain as their file says.
fn calibrated(sensors: &Sensors) -> Calibration {
    let mut calibration = rig(sensors, &LOADS).unwrap().calibration;
    for corner in calibration.corner.values_mut() {
        for channel in corner.strain.values_mut() {
            channel.offset_sigma_counts = None;
        }
    }
    calibration
}

/// Errors F_x, F_y, F_z, per cent, and mean squares of the normalised errors of a run.
fn judge(run: &Run, file: &str, seed: u64, settings: Settings) -> [[f64; 3]; 2] {
    let sensors = Sensors::builtin(file).unwrap();
    let (vehicle, calibration) = (without_geometry(), calibrated(&sensors));
    let samples = sensing::samples(run, truth::vehicle(), &sensors, seed);
    let result = estimate(&vehicle, &sensors, &calibration, settings, &samples);
    let last = result.estimates.last().unwrap();
    assert_eq!(last.measured[Wheel::RearRight].source, ForceSource::Fusion);
    let faults = result.events.iter();
    let faults = faults.filter(|event| matches!(event.kind, EventKind::SensorFault(_)));
    assert_eq!(faults.count(), 0, "{:?}", result.events);
    let found = [
        force_errors(run, truth::vehicle(), &result),
        deviations(run, &result).axes,
    ];
    println!(
        "{file} {} seed {seed}: {:.2?} %, mean squares {:.2?}",
        run.name, found[0], found[1]
    );
    found
}

/// The matrices alone: largest errors F_x, F_y, F_z, per cent, and bounds of the mean squares of the normalised
/// errors. With the hard-points, the errors are at most 0.2, 0.2 and 0.5 (16 bit) and 1.1, 0.7 and 0.5 (10 bit).
#[test]
fn matrices_alone_give_the_forces() {
    for (file, most) in [
        ("full-bridge-16bit", [1.4, 1.9, 1.3]),
        ("thesis-10bit", [2.1, 1.4, 1.0]),
    ] {
        for name in RUNS {
            let [errors, squares] = judge(truth::excerpt(name), file, 1, Settings::default());
            for axis in 0..3 {
                assert!(errors[axis] < most[axis], "{file} {name} {errors:?}");
                assert!(squares[axis] < SQUARE_MAX, "{file} {name} {squares:?}");
            }
        }
    }
}

/// Largest errors of F_x, F_y, F_z with a lag of 20 ms on rough ground, wheel-carrier frame, per cent.
const ROUGH_MAX: [(&str, &str, [f64; 3]); 4] = [
    ("r2_iso_e_a", "full-bridge-16bit", [1.5, 5.0, 6.0]),
    ("r8_trail_a", "full-bridge-16bit", [2.0, 5.5, 5.5]),
    ("r2_iso_e_a", "thesis-10bit", [3.5, 6.5, 6.0]),
    ("r8_trail_a", "thesis-10bit", [4.2, 6.0, 6.0]),
];

/// The matrices alone on rough ground. With the hard-points, the 10-bit errors of these excerpts are 2.9, 3.7 and
/// 4.2 at most.
#[test]
fn matrices_alone_give_the_forces_on_rough_ground() {
    for (name, file, most) in ROUGH_MAX {
        let run = truth::excerpt(name);
        let sensors = Sensors::builtin(file).unwrap();
        let (vehicle, calibration) = (without_geometry(), calibrated(&sensors));
        let samples = sensing::samples(run, truth::vehicle(), &sensors, 1);
        let result = estimate(
            &vehicle,
            &sensors,
            &calibration,
            Settings::default(),
            &samples,
        );
        let errors = carrier_errors(run, truth::vehicle(), &result.lagged);
        let squares = carrier_squares(run, &result.lagged);
        println!("{file} {name}: {errors:.2?} %, mean squares {squares:.2?}");
        for axis in 0..3 {
            assert!(errors[axis] < most[axis], "{file} {name} {errors:?}");
            assert!(squares[axis] < SQUARE_MAX, "{file} {name} {squares:?}");
        }
    }
}

#[test]
#[ignore = "tuning of the model's error: seeds from 11"]
fn model_error_of_a_matrix() {
    for part in [0.004, 0.007, 0.01, 0.014] {
        println!("part {part}");
        for file in ["full-bridge-16bit", "thesis-10bit"] {
            for name in RUNS {
                let mut settings = Settings::default();
                settings.tuning.fusion.members.matrix_sigma_part = part;
                judge(truth::excerpt(name), file, 11, settings);
            }
        }
    }
}

/// By virtual work, what the strut carries of the loads is the path of the wheel by the hard-points.
#[test]
fn the_strut_tells_the_path_of_the_wheel() {
    let found = rig(&Sensors::builtin("full-bridge-16bit").unwrap(), &LOADS).unwrap();
    for wheel in [Wheel::FrontLeft, Wheel::RearLeft] {
        let matrix = found.calibration.corner[&wheel].matrix.clone().unwrap();
        let strut = matrix.strut.unwrap();
        let corner = Corner::of(truth::vehicle(), wheel).unwrap();
        for compression_m in [-0.02, 0.0, 0.02] {
            let length_m = corner.design_strut_length_m() - compression_m;
            let pose = corner.pose(length_m, 0.0).unwrap();
            let rates = corner.rates(&pose).strut;
            let height_m = matrix.contact_height_m.unwrap();
            let path = rates.at(&pose, pose.wheel_centre_m - Vector3::z() * height_m);
            let more_m = compression_m - matrix.compression_m;
            let row = |axis: usize| strut.part[axis] + strut.change_per_m[axis] * more_m;
            let turn = strut.per_m[0] + strut.moment_change_per_m[0] * more_m;
            let apart = [path.y + row(1), path.z + row(2), rates.rotation.x + turn];
            println!(
                "{wheel} {compression_m}: {apart:.4?} of {:.3} {:.3} {:.3}",
                path.y, path.z, rates.rotation.x
            );
            for (apart, most) in apart.into_iter().zip(PATH_MAX) {
                assert!(apart.abs() < most, "{wheel} {compression_m} {apart}");
            }
        }
    }
}

/// Forces at the hub alone do not tell what the lateral force of a tyre does.
#[test]
fn loads_at_the_hub_alone_are_refused_with_the_load_to_add() {
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let at_hub = LOADS.map(|(force_n, _)| (force_n, [0.0; 3]));
    let error = rig(&sensors, &at_hub).unwrap_err().to_string();
    for part in [
        "FL",
        "1.00 F_y",
        "condition number",
        "rig FL 0 1000 0 at 0 0 -0.31",
    ] {
        assert!(error.contains(part), "{error}");
    }
    let none: Vec<_> = LOADS
        .into_iter()
        .filter(|(force_n, _)| force_n[1] == 0.0)
        .collect();
    let none = rig(&sensors, &none).unwrap_err().to_string();
    assert!(none.contains("spread of F_y on FL"), "{none}");
    // Forward and left together: the forces do not vary by themselves.
    let together: Vec<_> = (LOADS.into_iter())
        .map(|([x, y, z], _)| ([x + y, x + y, z], LOW))
        .collect();
    let together = rig(&sensors, &together).unwrap_err().to_string();
    assert!(
        together.contains("0.71 F_x -0.71 F_y") || together.contains("-0.71 F_x +0.71 F_y"),
        "{together}"
    );
}

/// Channels that follow each other make a singular matrix.
#[test]
fn channels_that_do_not_tell_the_forces_apart_are_refused() {
    let (vehicle, sensors) = (
        without_geometry(),
        Sensors::builtin("thesis-10bit").unwrap(),
    );
    let mut all = loads(Wheel::RearLeft, &sensors, &LOADS);
    for load in &mut all {
        let [first, second] = [load.counts[0].unwrap(), load.counts[3].unwrap()];
        load.counts[1] = Some([2.0 * first[0] - 500.0, first[1]]);
        load.counts[2] = Some([first[0] + second[0] - 500.0, first[1]]);
        load.counts[4] = None;
    }
    let nominal = Calibration::nominal(&vehicle.name);
    let error = load_rig(&vehicle, &sensors, &nominal, &all)
        .unwrap_err()
        .to_string();
    for part in [
        "corner.rear_left.matrix is singular",
        "upper_front, upper_rear, lower_front, lower_rear",
        "condition number",
        "add or repair a gauge that reacts to",
    ] {
        assert!(error.contains(part), "{error}");
    }
}

/// Ten seconds at a level with the noise of a converter.
fn at_rest(random: &mut ChaCha8Rng, level: f64, counts_max: f64) -> Option<Rest> {
    let time_s: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
    let noisy = |_: &f64| (level + random.random_range(-1.0..1.0)).round();
    let value: Vec<f64> = time_s.iter().map(noisy).collect();
    let signal = Signal {
        time_s: &time_s,
        value: &value,
    };
    Rest::of(&signal, 0.0, 10.0, [0.0, counts_max])
}

/// The bridges have moved since the load rig. The wheels hang, which they did not on the rig.
#[test]
fn hanging_wheels_give_new_zeros_to_a_matrix() {
    const MOVED_COUNTS: f64 = 40.0;
    // 36 and 40 N of static loads of 1,400 to 1,900 N.
    for (file, most) in [("full-bridge-16bit", 100.0), ("thesis-10bit", 1.5)] {
        let sensors = Sensors::builtin(file).unwrap();
        let (vehicle, known) = (without_geometry(), calibrated(&sensors));
        let strain = sensors.strain.axial_scale().unwrap();
        let pot = sensors.deflection.scale();
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let maxima = [sensors.strain.adc_bits, sensors.deflection.adc_bits];
        let [strain_max, pot_max] = maxima.map(|bits| f64::from(1_u32 << bits) - 1.0);
        let hanging = PerWheel::from_fn(|wheel| {
            let axle = truth::vehicle().axle(wheel);
            let corner = Corner::of(truth::vehicle(), wheel).unwrap();
            let gravity = Vector3::z() * STANDARD_GRAVITY_M_S2;
            let hanging = corner.hanging(axle, 0.0, gravity).unwrap();
            let forces = hanging.members.to_vector();
            let design_m = axle.strut.as_ref().unwrap().design_length_m;
            let compression_m = design_m - hanging.pose.strut_length_m;
            let mut rest = CornerRest {
                deflection: at_rest(&mut random, pot.level(compression_m), pot_max),
                ..CornerRest::default()
            };
            for (i, slot) in rest.strain[..5].iter_mut().enumerate() {
                let level = strain.level(forces[i]) + MOVED_COUNTS;
                *slot = at_rest(&mut random, level, strain_max);
            }
            rest
        });
        let found = zero(&ZeroInput {
            vehicle: &vehicle,
            sensors: &sensors,
            known: &known,
            hanging: &hanging,
            standing: None,
            specific_force_m_s2: [0.0, 0.0, STANDARD_GRAVITY_M_S2],
            steering_wheel_rad: [0.0; 2],
            weight_sigma: 0.02,
        })
        .unwrap();
        for wheel in Wheel::ALL {
            for (channel, slot) in &found.calibration.corner[&wheel].strain {
                let before = known.corner[&wheel].strain[channel].offset_counts.unwrap();
                let moved = slot.offset_counts.unwrap() - before;
                let sigma = slot.offset_sigma_counts.unwrap();
                println!(
                    "{file} {wheel} {}: {:.2} ± {sigma:.2} counts",
                    channel.name(),
                    moved - MOVED_COUNTS
                );
                assert!(
                    (moved - MOVED_COUNTS).abs() < most
                        && (moved - MOVED_COUNTS).abs() < 3.0 * sigma,
                    "{wheel} {}: {moved}",
                    channel.name()
                );
            }
        }
    }
}

/// Nothing tells what a channel reads of a hanging wheel before the load rig.
#[test]
fn a_zero_without_geometry_and_without_a_matrix_is_refused() {
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let vehicle = without_geometry();
    let error = zero(&ZeroInput {
        vehicle: &vehicle,
        sensors: &sensors,
        known: &Calibration::nominal(&vehicle.name),
        hanging: &PerWheel::default(),
        standing: None,
        specific_force_m_s2: [0.0, 0.0, STANDARD_GRAVITY_M_S2],
        steering_wheel_rad: [0.0; 2],
        weight_sigma: 0.02,
    });
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("FL") && error.contains("`calibrate load-rig` first"),
        "{error}"
    );
}

#[test]
fn a_matrix_on_a_live_axle_is_refused() {
    let vehicle = Vehicle::builtin("second-vehicle").unwrap();
    let sensors = Sensors::builtin("second-vehicle-16bit").unwrap();
    let mut calibration = Calibration::nominal(&vehicle.name);
    let matrix = rig(&Sensors::builtin("thesis-10bit").unwrap(), &LOADS).unwrap();
    let matrix = matrix.calibration.corner[&Wheel::RearLeft].matrix.clone();
    calibration
        .corner
        .entry(Wheel::RearLeft)
        .or_default()
        .matrix = matrix;
    let refused = Estimator::new(&vehicle, &sensors, &calibration, Settings::default());
    let error = refused.err().unwrap().to_string();
    assert!(
        error.contains("corner.rear_left.matrix") && error.contains("live axle"),
        "{error}"
    );
}

/// Mass of tyre, rim and outer part, kg, and noise of a force, N.
const OUTBOARD_KG: f64 = 16.0;
const TRANSDUCER_NOISE_N: f64 = 8.0;
/// Largest errors of F_x, F_y, F_z in this noise. The transducers of the test do not feel that the wheel moves
/// against the body, which the estimator expects.
const TRANSDUCER_MAX: [f64; 3] = [1.3, 1.6, 2.5];

/// Sensors with wheel-force transducers that send newtons.
fn transducers() -> Sensors {
    let mut sensors = Sensors::builtin("full-bridge-16bit").unwrap();
    let unit = sensors.strain.rate_hz;
    sensors.strain = StrainChain {
        rate_hz: unit,
        n_per_count: Some(1.0),
        lag_hz: 1e4,
        noise_counts: TRANSDUCER_NOISE_N,
        zero_error_counts: 0.0,
        transducer: Some(Transducer {
            outboard_mass_kg: OUTBOARD_KG,
            sigma_part: 0.002,
        }),
        ..StrainChain::default()
    };
    sensors
}

/// The run's samples with what the transducers read: the force of the ground in the axes of the carrier, less
/// what carries and accelerates the outer part with the body.
fn with_transducers(run: &Run, sensors: &Sensors) -> Vec<Sample> {
    let gauges = Sensors::builtin("full-bridge-16bit").unwrap();
    let mut samples = sensing::samples(run, truth::vehicle(), &gauges, 1);
    let mut noise = ChaCha8Rng::seed_from_u64(1);
    let zero = sensors.strain.axial_scale().unwrap().zero_counts;
    for sample in &mut samples {
        let row = (sample.valid_time.seconds_since(sensing::START) * RATE_HZ).round() as usize;
        let Measurement::Corner(corner) = &mut sample.measurement else {
            continue;
        };
        let force = Vector3::from(run.carrier_forces(row)[corner.wheel.index()]);
        let body = Vector3::from(run.vector(["fx_body", "fy_body", "fz_body"], row));
        let steer = run.column(&format!("{}_steer", corner.wheel.abbreviation()))[row];
        let carrier_from_body = Rotation3::from_axis_angle(&Vector3::z_axis(), -steer);
        let read = force - carrier_from_body * body * OUTBOARD_KG;
        corner.strain_counts = [None; StrainChannel::COUNT];
        for (counts, force_n) in corner.strain_counts.iter_mut().zip(read.iter()) {
            // Uniform noise with the standard deviation of the sensor.
            let error = TRANSDUCER_NOISE_N * 3.0_f64.sqrt() * noise.random_range(-1.0..1.0);
            *counts = Some(Counts::Equivalent {
                counts: zero + force_n + error,
                step: 0.0,
            });
        }
    }
    samples
}

/// Transducers in the wheels give the forces without any geometry, calibration or matrix of one's own.
#[test]
fn transducers_give_the_forces_of_wheels_without_geometry() {
    let (vehicle, sensors) = (without_geometry(), transducers());
    let nominal = Calibration::nominal(&vehicle.name);
    for name in ["c_sine03", "f_launch_brake"] {
        let Some(run) = truth::run(name) else { return };
        let samples = with_transducers(run, &sensors);
        let result = estimate(&vehicle, &sensors, &nominal, Settings::default(), &samples);
        let rms = |axis: usize| {
            let all = result
                .estimates
                .iter()
                .map(|estimate| (estimate, row(estimate)));
            let judged = all.filter(|(_, row)| (600..run.rows).contains(row));
            scoring::rms(judged.flat_map(|(estimate, row)| {
                let truth = run.carrier_forces(row);
                Wheel::ALL.map(|w| estimate.carrier[w].force_n[axis] - truth[w.index()][axis])
            }))
        };
        let errors = [0, 1, 2].map(rms);
        let squares = carrier_squares(run, &result.estimates);
        println!("{name}: {errors:.1?} N, mean squares {squares:.2?}");
        for axis in 0..3 {
            let most = TRANSDUCER_MAX[axis] * TRANSDUCER_NOISE_N;
            assert!(errors[axis] < most, "{name} {errors:?}");
            assert!(squares[axis] < SQUARE_MAX, "{name} {squares:?}");
        }
    }
}
