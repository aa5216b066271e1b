//! Axial forces of a wheel's members from the columns of a truth file, in the order of the strain channels.

use nalgebra::Vector3;
use sample::Wheel;

use crate::motion::spindle;

/// Double wishbone: legs of the arms and tie rod. MacPherson strut: forces of the body on the strut's top across
/// it, forwards and to the left, in the place of those of the upper arm. Live axle: upper link, lower link, and on
/// the left side the Panhard rod in the place of the tie rod. `NaN` for what the file does not tell.
pub(super) fn axial_n(
    wheel: Wheel,
    get: impl Fn(&str) -> f64,
    whole: impl Fn(&str) -> f64,
) -> [f64; 5] {
    let [lower_n, upper_n] = ["lower_T[N]", "upper_T[N]"].map(&get);
    if lower_n.is_finite() && upper_n.is_finite() {
        let panhard_n = if wheel.is_left() {
            whole("panhard_T[N]")
        } else {
            f64::NAN
        };
        return [upper_n, f64::NAN, lower_n, f64::NAN, panhard_n];
    }
    let tie_rod_n = get("tierod_T[N]");
    if let Some([forward_n, left_n]) = across_strut_n(&get) {
        let [front_n, rear_n] = ["LCA_legF_N[N]", "LCA_legB_N[N]"].map(get);
        return [forward_n, left_n, front_n, rear_n, tie_rod_n];
    }
    let [upper_front, upper_rear, lower_front, lower_rear] = [
        "UCA_tubeF_T[N]",
        "UCA_tubeB_T[N]",
        "LCA_tubeF_T[N]",
        "LCA_tubeB_T[N]",
    ]
    .map(get);
    [upper_front, upper_rear, lower_front, lower_rear, tie_rod_n]
}

/// Force of the body on the top of a MacPherson strut across it, forwards and to the left.
fn across_strut_n(get: impl Fn(&str) -> f64) -> Option<[f64; 2]> {
    let three = |names: [&str; 3]| {
        let values = names.map(&get);
        (values.iter().all(|value| value.is_finite())).then(|| Vector3::from(values))
    };
    let side_n = three(["strut_side_Fx[N]", "strut_side_Fy[N]", "strut_side_Fz[N]"])?;
    let up = three(["strut_dir_x[-]", "strut_dir_y[-]", "strut_dir_z[-]"])?;
    let [steer_rad, elevation_rad] = ["steer[rad]", "incl_body[rad]"].map(&get);
    let spindle = Vector3::from(spindle(steer_rad, elevation_rad));
    let forward = spindle.cross(&up).normalize();
    let left = up.cross(&forward);
    let forces = [side_n.dot(&forward), side_n.dot(&left)];
    forces
        .iter()
        .all(|force| force.is_finite())
        .then_some(forces)
}
