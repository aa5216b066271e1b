//! The excerpts of truth runs in `testdata/truth`.

use atvrec_sim::{Motion, Options, Port, VirtualVehicle};
use model::sensors::Sensors;
use testkit::project;
use testkit::truth::{Run, WINDOWS, excerpt, excerpt_path, resolution, vehicle};

use crate::support;

/// Most that the excerpts may take, bytes.
const SIZE_MAX: u64 = 3_000_000;

#[test]
fn excerpts_are_small() {
    let folder = std::fs::read_dir(project().join("testdata/truth")).expect("a folder");
    let sizes = folder.map(|entry| entry.expect("an entry").metadata().expect("a file").len());
    let total: u64 = sizes.sum();
    assert!(total <= SIZE_MAX, "{total} bytes: testdata/truth is large");
}

/// Each value is that of the run, to the resolution of its unit.
#[test]
fn excerpts_have_the_values_of_their_runs() {
    for window in &WINDOWS {
        let Some(path) = window.source() else { return };
        let [whole, cut] = [path, excerpt_path(window.name)].map(|path| {
            atvrec_sim::read_columns(&path, |full| Ok(Some(full.to_owned()))).expect("a truth file")
        });
        let rows = window.rows(&whole["t[s]"]);
        assert!(!cut.is_empty());
        for (name, found) in &cut {
            let original = &whole[name][rows.clone()];
            assert_eq!(found.len(), original.len(), "{} {name}", window.name);
            // Half a step, and the rounding to 32 bits.
            for (found, original) in found.iter().zip(original) {
                let most = 0.5 * resolution(name) + f64::from(f32::EPSILON) * original.abs();
                assert!((found - original).abs() <= most, "{} {name}", window.name);
            }
        }
    }
    let Some(parameters) = testkit::shared("data/truth/params.json") else {
        return;
    };
    let [whole, copy] = [parameters, project().join("testdata/truth/params.json")]
        .map(|path| std::fs::read(path).expect("readable"));
    assert!(whole == copy, "params.json is another: make excerpts");
}

#[test]
fn the_virtual_vehicle_drives_each_excerpt() {
    for window in &WINDOWS {
        let motion = Motion::open(&excerpt_path(window.name)).expect("a truth file");
        let [first_s, last_s] = window.span_s;
        assert!((motion.duration_s() - (last_s - first_s)).abs() < 1e-3);
        if window.folder == "truth-second" {
            continue;
        }
        assert!(motion.has_link_forces(), "{}", window.name);
        let sensors = Sensors::builtin("full-bridge-16bit-bending").expect("built-in sensors");
        let options = Options::default();
        let drive = VirtualVehicle::new(motion, vehicle(), &sensors, &options, 1);
        let emissions: Vec<_> = drive.expect("a virtual vehicle").collect();
        let samples = support::imu_samples(&emissions);
        assert!(
            samples.len() as f64 > 99.0 * (last_s - first_s),
            "{}",
            window.name
        );
        assert!(!support::bytes_of(&emissions, Port::Novatel).is_empty());
    }
}

/// Mass of the second vehicle, kg, and gravity of its simulator, m/s^2.
const SECOND_MASS_KG: f64 = 1560.0;
const GRAVITY_M_S2: f64 = 9.81;
/// Largest residual of its balance of forces, a part of its weight: rounding of its columns.
const BALANCE_MAX: f64 = 1e-5;

/// The tyres carry and accelerate the mass.
#[test]
fn forces_of_the_second_vehicle_balance() {
    let run: &Run = excerpt("f1_slalom_a");
    let weight_n = SECOND_MASS_KG * GRAVITY_M_S2;
    for row in 0..run.rows {
        let [roll, pitch] = ["roll", "pitch"].map(|name| run.column(name)[row]);
        let up = [
            -math::sin(pitch),
            math::cos(pitch) * math::sin(roll),
            math::cos(pitch) * math::cos(roll),
        ];
        for (axis, up) in ["x", "y", "z"].iter().zip(up) {
            let force_n: f64 = ["FL", "FR", "RL", "RR"]
                .map(|wheel| run.column(&format!("{wheel}_Fchassis_{axis}"))[row])
                .iter()
                .sum();
            let inertia_n = SECOND_MASS_KG * run.column(&format!("acom_body_{axis}"))[row];
            let residual = (force_n - weight_n * up - inertia_n) / weight_n;
            assert!(residual.abs() < BALANCE_MAX, "row {row} {axis}: {residual}");
        }
    }
}
