//! Roughness against ISO 8608, and soft ground against an independent integration.

use std::f64::consts::TAU;

use atvrec_model::road::soil::RigidWheel;
use atvrec_model::road::{Road, RoadClass, Soil};

const SEEDS: std::ops::Range<u64> = 11..21;
const LENGTH_M: f64 = 2000.0;
/// Samples of a profile, and of a segment of the spectrum, which overlaps the next by half.
const SAMPLES: usize = 1 << 16;
const SEGMENT: usize = 1 << 12;
const STEP_M: f64 = LENGTH_M / SAMPLES as f64;
/// Edges of the bands, m: octaves from 20 m on; the last ends at 0.2 m.
const BANDS_M: [f64; 8] = [20.0, 10.0, 5.0, 2.5, 1.25, 0.625, 0.3125, 0.2];
const BANDS: usize = BANDS_M.len() - 1;
const TRACK_M: f64 = 1.1;
const PSD_DB: f64 = 1.0;
const COHERENCE: f64 = 0.1;

/// Spectra of two tracks, by bin: of the left, of the right, real part of the cross spectrum.
type Spectra = Vec<[f64; 3]>;

#[test]
fn roughness_has_the_spectrum_and_the_coherence_of_its_class() {
    for class in RoadClass::ALL.into_iter().take(6) {
        let mut spectra: Spectra = vec![[0.0; 3]; SEGMENT / 2];
        for seed in SEEDS {
            // Other fields for each class.
            let road = Road::iso8608(class, seed + 100 * class as u64);
            add_spectra(&road, 0.7 * seed as f64, &mut spectra);
        }
        for band in 0..BANDS {
            let [from, to] = [BANDS_M[band], BANDS_M[band + 1]].map(|length_m| 1.0 / length_m);
            let (mut found, mut expected) = ([0.0; 3], [0.0; 2]);
            for (bin, powers) in spectra.iter().enumerate().skip(1) {
                let cycles_m = bin as f64 / (SEGMENT as f64 * STEP_M);
                if (from..to).contains(&cycles_m) {
                    for (sum, power) in found.iter_mut().zip(powers) {
                        *sum += power;
                    }
                    let density = class.density_m3(cycles_m);
                    expected[0] += density;
                    expected[1] += density * coherence(TAU * cycles_m * TRACK_M);
                }
            }
            let db = 10.0 * math::log10(0.5 * (found[0] + found[1]) / expected[0]);
            let together = found[2] / (found[0] * found[1]).sqrt();
            let theory = expected[1] / expected[0];
            println!(
                "{class:?} {:.4}..{:.4} m: {db:+.2} dB, coherence {together:.3} ({theory:.3})",
                BANDS_M[band],
                BANDS_M[band + 1]
            );
            assert!(db.abs() < PSD_DB, "{class:?} band {band}: {db} dB");
            let off = (together - theory).abs();
            assert!(
                off < COHERENCE,
                "{class:?} band {band}: {together} {theory}"
            );
        }
    }
}

/// Adds the one-sided spectra of two parallel tracks of a heading, m^3, averaged over seeds and
/// segments.
fn add_spectra(road: &Road, heading_rad: f64, spectra: &mut Spectra) {
    let (sin, cos) = math::sin_cos(heading_rad);
    let track = |side: f64| -> Vec<f64> {
        let y = 0.5 * side * TRACK_M;
        let heights = (0..SAMPLES).map(|k| {
            let x = k as f64 * STEP_M;
            road.height_m(cos * x - sin * y, sin * x + cos * y)
        });
        heights.collect()
    };
    let [left, right] = [track(1.0), track(-1.0)];
    let starts: Vec<usize> = (0..=SAMPLES - SEGMENT).step_by(SEGMENT / 2).collect();
    let scale = 2.0 * STEP_M / (0.375 * SEGMENT as f64 * (starts.len() * SEEDS.count()) as f64);
    for start in starts {
        // Two real series as one complex one.
        let mut series: Vec<[f64; 2]> = (0..SEGMENT)
            .map(|k| {
                let window = 0.5 - 0.5 * math::cos(TAU * k as f64 / SEGMENT as f64);
                [window * left[start + k], window * right[start + k]]
            })
            .collect();
        transform(&mut series);
        for (bin, spectrum) in spectra.iter_mut().enumerate() {
            let (a, b) = (series[bin], series[(SEGMENT - bin) % SEGMENT]);
            let l = [0.5 * (a[0] + b[0]), 0.5 * (a[1] - b[1])];
            let r = [0.5 * (a[1] + b[1]), 0.5 * (b[0] - a[0])];
            spectrum[0] += scale * (l[0] * l[0] + l[1] * l[1]);
            spectrum[1] += scale * (r[0] * r[0] + r[1] * r[1]);
            spectrum[2] += scale * (l[0] * r[0] + l[1] * r[1]);
        }
    }
}

/// Fourier transform of a series whose length is a power of two (Cooley and Tukey 1965).
fn transform(series: &mut [[f64; 2]]) {
    let count = series.len();
    if count == 1 {
        return;
    }
    let half =
        |odd: usize| -> Vec<[f64; 2]> { series.iter().skip(odd).step_by(2).copied().collect() };
    let (mut even, mut odd) = (half(0), half(1));
    transform(&mut even);
    transform(&mut odd);
    for k in 0..count / 2 {
        let (sin, cos) = math::sin_cos(-TAU * k as f64 / count as f64);
        let (e, o) = (even[k], odd[k]);
        let turned = [cos * o[0] - sin * o[1], cos * o[1] + sin * o[0]];
        series[k] = [e[0] + turned[0], e[1] + turned[1]];
        series[k + count / 2] = [e[0] - turned[0], e[1] - turned[1]];
    }
}

/// x K_1(x), with the modified Bessel function K_1(x) = int_0^inf e^(-x cosh t) cosh t dt.
fn coherence(x: f64) -> f64 {
    let step = 0.02;
    let terms = (0..400).map(|k| {
        let cosh = math::cosh(step * f64::from(k));
        let end = if k == 0 { 0.5 } else { 1.0 };
        end * step * math::exp(-x * cosh) * cosh
    });
    x * terms.sum::<f64>()
}

#[test]
fn the_seed_decides_the_field() {
    let height_m = |seed| Road::iso8608(RoadClass::D, seed).height_m(31.0, -2.0);
    assert_eq!(height_m(12), height_m(12));
    assert_ne!(height_m(12), height_m(13));
}

/// Soil, load in N, slip, sinkage in m, thrust and resistance in N, torque in N m of a wheel of
/// 0.31 m radius and 0.20 m width, by scripts/soil-reference.py.
const WHEELS: [(&str, f64, f64, f64, f64, f64, f64); 16] = [
    ("sand", 1500.0, 0.0, 0.05872, 278.0, 372.7, 89.31),
    ("sand", 1500.0, 0.1, 0.05886, 434.6, 371.5, 139.52),
    ("sand", 1500.0, 0.3, 0.06006, 584.6, 379.2, 188.52),
    ("sand", 1500.0, 0.6, 0.06347, 657.8, 404.4, 214.14),
    ("loam", 1500.0, 0.0, 0.02003, 156.5, 232.8, 49.13),
    ("loam", 1500.0, 0.1, 0.01990, 444.1, 229.4, 139.33),
    ("loam", 1500.0, 0.3, 0.02016, 656.8, 231.5, 206.46),
    ("loam", 1500.0, 0.6, 0.02112, 737.3, 243.4, 232.47),
    ("clay", 1500.0, 0.0, 0.01705, 95.6, 223.5, 29.99),
    ("clay", 1500.0, 0.1, 0.01702, 270.9, 222.3, 84.93),
    ("clay", 1500.0, 0.3, 0.01733, 364.9, 226.6, 114.65),
    ("clay", 1500.0, 0.6, 0.01817, 394.9, 238.4, 124.39),
    ("snow", 500.0, 0.0, 0.18277, 164.8, 196.3, 58.16),
    ("snow", 500.0, 0.1, 0.18544, 175.5, 201.0, 62.28),
    ("snow", 500.0, 0.3, 0.19264, 185.6, 213.4, 66.98),
    ("snow", 500.0, 0.6, 0.20832, 189.0, 238.6, 70.81),
];
/// Part by which two integrations of the same stresses may differ.
const AGREEMENT: f64 = 0.02;

#[test]
fn a_wheel_on_soft_ground_agrees_with_an_independent_integration() {
    let wheel = RigidWheel {
        radius_m: 0.31,
        width_m: 0.20,
    };
    let mut worst: f64 = 0.0;
    for (name, load_n, slip, sinkage_m, thrust_n, resistance_n, torque_n_m) in WHEELS {
        let soil = Soil::by_name(name).expect("a soil");
        let found_m = soil.sinkage_m(wheel, load_n, slip).expect("carried");
        let forces = soil.forces(wheel, found_m, slip);
        for (found, expected) in [
            (found_m, sinkage_m),
            (forces.load_n, load_n),
            (forces.thrust_n, thrust_n),
            (forces.resistance_n, resistance_n),
            (forces.torque_n_m, torque_n_m),
        ] {
            let off = (found / expected - 1.0).abs();
            worst = worst.max(off);
            assert!(off < AGREEMENT, "{name} at {slip}: {found} {expected}");
        }
        let pull_n = thrust_n - resistance_n;
        let off_n = (forces.drawbar_pull_n() - pull_n).abs();
        assert!(off_n < AGREEMENT * thrust_n, "{name} at {slip}: {off_n} N");
    }
    println!("worst: {:.3} %", 100.0 * worst);
    let heavy = Soil::by_name("snow").and_then(|snow| snow.sinkage_m(wheel, 1500.0, 0.1));
    assert_eq!(heavy, None);
}

/// The plate's pressure and sinkage, k z^n, seen as a wheel that moves without shear: the vertical
/// part of the radial stress alone is what Bekker's closed form approaches for small sinkage,
/// W = b k (3 - n)/3 sqrt(D) z^(n + 1/2). It is an expansion of the same stress with the peak at the
/// lowest point.
#[test]
fn the_load_is_near_the_closed_form_of_bekker() {
    let wheel = RigidWheel {
        radius_m: 0.31,
        width_m: 0.20,
    };
    let sand = Soil::by_name("sand").expect("a soil");
    let load_n = sand.forces(wheel, 0.03, 0.0).load_n;
    let stiffness = sand.cohesive_modulus / wheel.width_m + sand.frictional_modulus;
    let closed_n = wheel.width_m * stiffness * (3.0 - sand.exponent) / 3.0
        * (2.0 * wheel.radius_m).sqrt()
        * math::powf(0.03, sand.exponent + 0.5);
    assert!(
        (0.7..1.4).contains(&(load_n / closed_n)),
        "{load_n} {closed_n}"
    );
}
