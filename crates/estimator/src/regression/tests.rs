use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;

/// Repetitions of the coverage tests.
const SEEDS: u64 = 200;
/// Part of the intervals that must hold the truth.
const COVERAGE: std::ops::RangeInclusive<f64> = 0.90..=0.98;

struct Noise(ChaCha8Rng);

impl Noise {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// First-order autoregression of unit variance.
    fn wandering(&mut self, rows: usize, rho: f64) -> Vec<f64> {
        let mut value = self.normal();
        (0..rows)
            .map(|_| {
                let now = value;
                value = rho * value + (1.0 - rho * rho).sqrt() * self.normal();
                now
            })
            .collect()
    }
}

/// A column of ones and a sine of 0.3 Hz over 40 s at 10 Hz.
fn sine_design() -> DMatrix<f64> {
    DMatrix::from_fn(400, 2, |i, j| {
        if j == 0 {
            1.0
        } else {
            math::sin(std::f64::consts::TAU * 0.3 * 0.1 * i as f64)
        }
    })
}

/// NIST's statistical reference data set Norris: linear, one predictor.
#[test]
fn norris_is_met_to_its_certified_digits() {
    const DATA: [[f64; 2]; 36] = [
        [0.1, 0.2],
        [338.8, 337.4],
        [118.1, 118.2],
        [888.0, 884.6],
        [9.2, 10.1],
        [228.1, 226.5],
        [668.5, 666.3],
        [998.5, 996.3],
        [449.1, 448.6],
        [778.9, 777.0],
        [559.2, 558.2],
        [0.3, 0.4],
        [0.1, 0.6],
        [778.1, 775.5],
        [668.8, 666.9],
        [339.3, 338.0],
        [448.9, 447.5],
        [10.8, 11.6],
        [557.7, 556.0],
        [228.3, 228.1],
        [998.0, 995.8],
        [888.8, 887.6],
        [119.6, 120.2],
        [0.3, 0.3],
        [0.6, 0.3],
        [557.6, 556.8],
        [339.3, 339.1],
        [888.0, 887.2],
        [998.5, 999.0],
        [778.9, 779.0],
        [10.2, 11.1],
        [117.6, 118.3],
        [228.9, 229.2],
        [668.4, 669.1],
        [449.2, 448.9],
        [0.2, 0.5],
    ];
    let design = DMatrix::from_fn(36, 2, |i, j| if j == 0 { 1.0 } else { DATA[i][1] });
    let response = DVector::from_fn(36, |i, _| DATA[i][0]);
    // Certified for y on x; the set lists y first.
    let fit = least_squares(&design, &response).expect("a plain line");
    let certified = [-0.262_323_073_774_029, 1.002_116_818_020_45];
    let deviations = [0.232_818_234_301_152, 0.429_796_848_199_937e-3];
    for j in 0..2 {
        assert!(
            (fit.coefficients[j] / certified[j] - 1.0).abs() < 1e-10,
            "{fit:?}"
        );
        let sigma = fit.covariance_white[(j, j)].sqrt();
        assert!((sigma / deviations[j] - 1.0).abs() < 1e-10, "{sigma}");
    }
}

#[test]
fn weights_count_as_repetitions() {
    let rows = [
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 2.5],
        [1.0, 2.0, 2.0],
        [1.0, 3.0, 4.5],
        [1.0, 4.0, 4.0],
    ];
    let expand = |counts: [usize; 5]| -> Vec<[f64; 3]> {
        rows.iter()
            .zip(counts)
            .flat_map(|(row, n)| vec![*row; n])
            .collect()
    };
    let split = |rows: &[[f64; 3]]| {
        (
            DMatrix::from_fn(rows.len(), 2, |i, j| rows[i][j]),
            DVector::from_fn(rows.len(), |i, _| rows[i][2]),
        )
    };
    let (design, response) = split(&rows);
    let weighted = weighted(&design, &response, Some(&[1.0, 3.0, 1.0, 2.0, 1.0])).expect("fits");
    let (design, response) = split(&expand([1, 3, 1, 2, 1]));
    let repeated = least_squares(&design, &response).expect("fits");
    for j in 0..2 {
        assert!((weighted.coefficients[j] - repeated.coefficients[j]).abs() < 1e-12);
    }
}

/// With one noisy column beside the ones, total least squares is Deming's regression, whose slope
/// has a closed form.
#[test]
fn total_least_squares_is_demings_regression_in_one_dimension() {
    let mut noise = Noise::new(3);
    let x: Vec<f64> = (0..200)
        .map(|i| math::sin(0.1 * f64::from(i)) + 0.3 * noise.normal())
        .collect();
    let y: Vec<f64> = (0..200)
        .map(|i| 2.0 * math::sin(0.1 * f64::from(i)) + 0.5 + 0.6 * noise.normal())
        .collect();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (mx, my) = (mean(&x), mean(&y));
    let sum = |f: &dyn Fn(usize) -> f64| (0..200).map(f).sum::<f64>();
    let sxx = sum(&|i| (x[i] - mx).powi(2));
    let syy = sum(&|i| (y[i] - my).powi(2));
    let sxy = sum(&|i| (x[i] - mx) * (y[i] - my));
    let ratio = 0.36 / 0.09;
    let d = syy - ratio * sxx;
    let slope = (d + (d * d + 4.0 * ratio * sxy * sxy).sqrt()) / (2.0 * sxy);
    let design = DMatrix::from_fn(200, 2, |i, j| if j == 0 { 1.0 } else { x[i] });
    let errors = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 0.09, 0.36]));
    let fit = total(&design, &DVector::from_vec(y), &errors).expect("fits");
    assert!(
        (fit.coefficients[1] - slope).abs() < 1e-9,
        "{} {slope}",
        fit.coefficients[1]
    );
    assert!((fit.coefficients[0] - (my - slope * mx)).abs() < 1e-9);
}

#[test]
fn columns_that_cannot_be_told_apart_are_refused() {
    let design = DMatrix::from_fn(50, 2, |i, j| (i as f64) * (1.0 + j as f64));
    let response = DVector::from_fn(50, |i, _| i as f64);
    assert!(matches!(
        least_squares(&design, &response),
        Err(Refusal::Singular { .. })
    ));
    let empty = DMatrix::zeros(50, 1);
    assert!(matches!(
        least_squares(&empty, &response),
        Err(Refusal::Singular { .. })
    ));
    let few = DMatrix::from_element(2, 1, 1.0);
    assert!(least_squares(&few, &DVector::zeros(2)).is_err());
    let nan = DVector::from_element(50, f64::NAN);
    assert!(least_squares(&DMatrix::from_element(50, 1, 1.0), &nan).is_err());
}

/// Whether the truth lies within 1.96 deviations, and within the bootstrap interval, for each of
/// the coefficients.
fn covered(
    fit: &Fit,
    truth: &[f64],
    refit: impl Fn(&[usize]) -> Option<Vec<f64>>,
    seed: u64,
) -> [Vec<bool>; 2] {
    let by_sigma = (0..truth.len())
        .map(|j| (fit.coefficients[j] - truth[j]).abs() < 1.96 * fit.sigma(j))
        .collect();
    let intervals = Bootstrap::for_influence(&fit.influence, seed)
        .intervals(fit.residuals.len(), refit)
        .expect("every repetition can be fitted");
    let by_interval = intervals
        .iter()
        .zip(truth)
        .map(|([low, high], truth)| (low..=high).contains(&truth))
        .collect();
    [by_sigma, by_interval]
}

fn coverage(all: &[[Vec<bool>; 2]], which: usize, coefficient: usize) -> f64 {
    let hits = all.iter().filter(|each| each[which][coefficient]).count();
    hits as f64 / all.len() as f64
}

/// Residuals that wander (first-order autoregression, 0.8 from row to row) would make plain
/// standard deviations three times too small.
#[test]
fn intervals_hold_the_truth_although_residuals_wander() {
    let design = sine_design();
    let truth = [0.3, 2.0];
    let mut all = Vec::new();
    let mut white = 0;
    for seed in 0..SEEDS {
        let noise = Noise::new(seed).wandering(400, 0.8);
        let response = DVector::from_fn(400, |i, _| {
            truth[0] + truth[1] * design[(i, 1)] + 0.5 * noise[i]
        });
        let fit = least_squares(&design, &response).expect("fits");
        white += u32::from(
            (fit.coefficients[0] - truth[0]).abs() < 1.96 * fit.covariance_white[(0, 0)].sqrt(),
        );
        assert!(fit.whiteness.ljung_box_p < 0.01 && fit.whiteness.durbin_watson < 1.0);
        all.push(covered(
            &fit,
            &truth,
            |rows| {
                let drawn = design.select_rows(rows);
                let response = response.select_rows(rows);
                let sums = drawn.transpose() * &drawn;
                Some(
                    (sums.try_inverse()? * drawn.transpose() * response)
                        .as_slice()
                        .to_vec(),
                )
            },
            seed,
        ));
    }
    for coefficient in 0..2 {
        let [sigma, interval] = [0, 1].map(|which| coverage(&all, which, coefficient));
        println!("coefficient {coefficient}: sigma {sigma}, bootstrap {interval}");
        assert!(
            COVERAGE.contains(&sigma),
            "coefficient {coefficient}: {sigma}"
        );
        assert!(
            COVERAGE.contains(&interval),
            "coefficient {coefficient}: {interval}"
        );
    }
    assert!(
        f64::from(white) < 0.7 * SEEDS as f64,
        "plain deviations: {white}"
    );
}

#[test]
fn total_least_squares_covers_the_truth_and_white_residuals_are_told_so() {
    let clean = sine_design();
    let truth = [0.1, 1.5];
    let errors = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 0.04, 0.09]));
    let mut all = Vec::new();
    let (mut mean, mut white) = (0.0, 0);
    for seed in 0..SEEDS {
        let mut noise = Noise::new(1_000 + seed);
        let response = DVector::from_fn(400, |i, _| {
            truth[0] + truth[1] * clean[(i, 1)] + 0.3 * noise.normal()
        });
        let mut design = clean.clone();
        for i in 0..400 {
            design[(i, 1)] += 0.2 * noise.normal();
        }
        let fit = total(&design, &response, &errors).expect("fits");
        mean += fit.coefficients[1] / SEEDS as f64;
        white += u32::from(fit.whiteness.ljung_box_p > 0.05);
        let by_sigma: Vec<bool> = (0..2)
            .map(|j| (fit.coefficients[j] - truth[j]).abs() < 1.96 * fit.sigma(j))
            .collect();
        all.push([by_sigma, Vec::new()]);
    }
    // Plain least squares would give 1.5 / (1 + 0.04 / 0.5) = 1.39.
    assert!((mean - 1.5).abs() < 0.01, "{mean}");
    for coefficient in 0..2 {
        let sigma = coverage(&all, 0, coefficient);
        assert!(
            COVERAGE.contains(&sigma),
            "coefficient {coefficient}: {sigma}"
        );
    }
    assert!(
        (0.90..=0.99).contains(&(f64::from(white) / SEEDS as f64)),
        "{white}"
    );
}

/// NIST's statistical reference data set Misra1a: y = b1 (1 - exp(-b2 x)), from its far start.
#[test]
fn misra1a_is_met_to_its_certified_digits() {
    const DATA: [[f64; 2]; 14] = [
        [10.07, 77.6],
        [14.73, 114.9],
        [17.94, 141.1],
        [23.93, 190.8],
        [29.61, 239.9],
        [35.18, 289.0],
        [40.02, 332.8],
        [44.82, 378.4],
        [50.76, 434.8],
        [55.05, 477.3],
        [61.01, 536.8],
        [66.40, 593.1],
        [75.47, 689.1],
        [81.78, 760.0],
    ];
    let problem = Nonlinear {
        start: vec![500.0, 0.0001],
        scale: vec![100.0, 1e-4],
        iterations: 200,
    };
    let fit = nonlinear(&problem, |b| {
        DATA.iter()
            .map(|[y, x]| y - b[0] * (1.0 - math::exp(-b[1] * x)))
            .collect()
    })
    .expect("converges");
    let certified = [238.942_129_18, 5.501_564_318_1e-4];
    let deviations = [2.707_007_524_1, 7.266_868_865_4e-6];
    for j in 0..2 {
        assert!(
            (fit.coefficients[j] / certified[j] - 1.0).abs() < 1e-6,
            "{:?}",
            fit.coefficients
        );
        assert!((fit.covariance_white[(j, j)].sqrt() / deviations[j] - 1.0).abs() < 1e-4);
    }
}

#[test]
fn the_same_seed_gives_the_same_interval() {
    let estimate = |rows: &[usize]| Some(vec![rows.iter().sum::<usize>() as f64]);
    let bootstrap = Bootstrap {
        repetitions: 50,
        block: 3,
        seed: 9,
    };
    assert_eq!(
        bootstrap.intervals(40, estimate),
        bootstrap.intervals(40, estimate)
    );
    let other = Bootstrap {
        seed: 10,
        ..bootstrap
    };
    assert_ne!(
        bootstrap.intervals(40, estimate),
        other.intervals(40, estimate)
    );
    assert_eq!(bootstrap.intervals(40, |_| None), None);
}
