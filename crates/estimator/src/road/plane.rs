//! The plane through the four ground points.

use nalgebra::{Matrix3, SMatrix, Vector4};
use sample::RoadPlane;

/// Least-squares plane h = a + b x + c y through the heights at `places` (forward, left, m) of level axes,
/// and the warp. `variance_m2`: of the heights without what all have in common.
pub(super) fn fit(
    places: &[[f64; 2]; 4],
    height_m: &[f64; 4],
    variance_m2: &[f64; 4],
    tilt_sigma_rad: [f64; 2],
) -> RoadPlane {
    let design = SMatrix::<f64, 4, 3>::from_fn(|row, column| match column {
        0 => 1.0,
        _ => places[row][column - 1],
    });
    let normal: Matrix3<f64> = design.transpose() * design;
    let Some(inverse) = normal.try_inverse() else {
        return RoadPlane::UNKNOWN;
    };
    let solve = inverse * design.transpose();
    let found = solve * Vector4::from(*height_m);
    let sigma = |row: usize, tilt: f64| {
        let terms = (0..4).map(|i| solve[(row, i)] * solve[(row, i)] * variance_m2[i]);
        (terms.sum::<f64>() + tilt * tilt).sqrt()
    };
    let [roll_sigma, pitch_sigma] = tilt_sigma_rad;
    let [fl, fr, rl, rr] = *height_m;
    RoadPlane {
        bank_rad: math::atan(found[2]),
        bank_sigma_rad: sigma(2, roll_sigma),
        grade_rad: -math::atan(found[1]),
        grade_sigma_rad: sigma(1, pitch_sigma),
        warp_m: fl - fr - rl + rr,
        warp_sigma_m: variance_m2.iter().sum::<f64>().sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bank_grade_and_warp_have_the_signs_of_the_vehicle() {
        let places = [[0.8, 0.5], [0.8, -0.5], [-0.7, 0.5], [-0.7, -0.5]];
        let of = |height: fn(f64, f64) -> f64| {
            fit(
                &places,
                &places.map(|[x, y]| height(x, y)),
                &[1e-6; 4],
                [0.0; 2],
            )
        };
        // The left side is high: the right side is down.
        let bank = of(|_, y| 0.1 * y);
        assert!((bank.bank_rad - math::atan(0.1)).abs() < 1e-12 && bank.grade_rad.abs() < 1e-12);
        assert!((bank.bank_sigma_rad - 1e-3).abs() < 1e-9, "{bank:?}");
        // The front is high: the nose is up.
        let grade = of(|x, _| 0.1 * x);
        assert!((grade.grade_rad + math::atan(0.1)).abs() < 1e-12 && grade.bank_rad.abs() < 1e-12);
        let warp = of(|x, y| if x * y > 0.0 { 0.01 } else { -0.01 });
        assert!((warp.warp_m - 0.04).abs() < 1e-12 && (warp.warp_sigma_m - 2e-3).abs() < 1e-12);
    }
}
