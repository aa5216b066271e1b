//! Physical ranges of the parameters.

use super::{LOGARITHMIC, PARAMETERS};
use crate::planar::SHAPE_RANGE;

/// Least and greatest value of each parameter, in its own unit: rigid and very soft tyres, ice and
/// racing tyres, a body that does not roll and one that rolls by half a degree for each m/s^2.
const RANGE: [[f64; 2]; PARAMETERS] = [
    [1e2, 1e7],
    [1e2, 1e7],
    [0.1, 3.0],
    [0.1, 3.0],
    SHAPE_RANGE,
    SHAPE_RANGE,
    [1e-3, 1e7],
    [0.9, 1.6],
    [0.3, 3.0],
    [0.0, 1.0],
    [0.0, 1.0],
    [0.01, 3.0],
    [0.05, 3.0],
];
/// Largest delay that is searched for, s.
const DELAY_MAX_S: f64 = 0.6;

/// Ends of the range of a parameter as it is searched for.
fn ends(index: usize) -> [f64; 2] {
    if index >= PARAMETERS {
        return [-DELAY_MAX_S, DELAY_MAX_S];
    }
    RANGE[index].map(|end| {
        if LOGARITHMIC[index] {
            math::ln(end)
        } else {
            end
        }
    })
}

/// The nearest value of a parameter within its range.
pub(super) fn clamp(index: usize, value: f64) -> f64 {
    let [least, most] = ends(index);
    value.clamp(least, most)
}

/// Whether a parameter stopped at an end of its range.
pub(super) fn is_at_end(index: usize, value: f64) -> bool {
    let [least, most] = ends(index);
    let near = 1e-6 * (most - least);
    value <= least + near || value >= most - near
}
