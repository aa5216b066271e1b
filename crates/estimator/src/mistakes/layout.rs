//! Positions of the parameters in the evidence.

use crate::fusion::relations::CHANNELS;

/// Offset of each axial channel, N.
pub(super) const OFFSET: usize = 0;
/// Relative error of the gain of each axial channel, by its reading.
pub(super) const GAIN: usize = OFFSET + CHANNELS;
/// Error of the geometry: part of F_x, F_y and F_z of the tyre that the member carries beyond the model.
pub(super) const SHAPE: usize = GAIN + CHANNELS;
/// Error of each strut's force, N.
pub(super) const PRELOAD: usize = SHAPE + 3 * CHANNELS;
/// Relative error of each spring's rate.
pub(super) const RATE: usize = PRELOAD + 4;
/// Mass beyond the vehicle file, kg, and its first moments about the centre of gravity, kg m.
pub(super) const MASS: usize = RATE + 4;
/// The first moments along x, y and z.
pub(super) const FIRST_MOMENT: usize = MASS + 1;
/// The first moment along z.
pub(super) const HEIGHT: usize = MASS + 3;
/// Bias of the accelerometers, m/s^2.
pub(super) const BIAS: usize = MASS + 4;
/// Turn of the inertial unit about the axes of the body, rad.
pub(super) const TILT: usize = BIAS + 3;
/// Position of the inertial unit beyond that of the file, m.
pub(super) const LEVER: usize = TILT + 3;
/// Relative error of the accelerometers' scale.
pub(super) const SCALE: usize = LEVER + 3;
/// Number of parameters that are never known exactly.
pub(super) const TOLERATED: usize = SCALE + 1;
/// What each axial channel lacks of its member's force: 1 without any signal of it, 2 with the sign inverted.
pub(super) const LOST: usize = TOLERATED;
/// 1 where two axial channels of a corner are exchanged.
pub(super) const EXCHANGED: usize = LOST + CHANNELS;
/// Pairs of channels of one corner.
pub(super) const PAIRS: [[usize; 2]; 10] = [
    [0, 1],
    [0, 2],
    [0, 3],
    [0, 4],
    [1, 2],
    [1, 3],
    [1, 4],
    [2, 3],
    [2, 4],
    [3, 4],
];
/// 1 where two corners are exchanged.
pub(super) const CORNERS: usize = EXCHANGED + 4 * PAIRS.len();
/// Pairs of wheels.
pub(super) const WHEELS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
/// Constant force on the hitch, N, and mass that is towed, kg.
pub(super) const HITCH: usize = CORNERS + WHEELS.len();
/// 1 where the inertial unit's axes are turned by right angles.
pub(super) const TURNED: usize = HITCH + 4;
/// Rotations by right angles other than none.
pub(super) const ROTATIONS: usize = 23;
/// Number of all parameters.
pub(super) const SIZE: usize = TURNED + ROTATIONS;
