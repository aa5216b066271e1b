//! The mistakes, and how they distribute their parameters before the drive.

use sample::STANDARD_GRAVITY_M_S2;

use super::evidence::Setup;
use super::layout::{
    CORNERS, EXCHANGED, HITCH, LEVER, LOST, MASS, OFFSET, PAIRS, PRELOAD, RATE, ROTATIONS, SCALE,
    SHAPE, TILT, TURNED, WHEELS,
};
use super::{HYPOTHESES, MOST};
use crate::fusion::relations::CHANNELS;
use crate::tuning::MistakeTuning;

/// A mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hypothesis {
    /// The strain channels were not zeroed. Parameters: offset of each channel, N.
    Zeros,
    /// The offset of one channel is wrong, N.
    Offset(usize),
    /// The gain of one channel is wrong, in size or sign: the part of the force that the reading lacks.
    Gain(usize),
    /// The reading of one channel is another sum of the wheel's forces than its member's force: what it has beyond,
    /// as parts of F_x, F_y and F_z.
    Bent(usize),
    /// Two channels of a corner are exchanged: 1.
    Exchanged(usize, [usize; 2]),
    /// Two corners are exchanged: 1.
    Corners([usize; 2]),
    /// A mass that the vehicle file does not have: kg, and first moments about the centre of gravity, kg m.
    Payload,
    /// The inertial unit is turned about an axis of the body, rad.
    Tilted(usize),
    /// The inertial unit is turned by right angles: 1.
    Turned(usize),
    /// The inertial unit is elsewhere: x, y and z, m.
    Moved,
    /// The readings of the accelerometers are in g (`false`), or were multiplied by g twice (`true`).
    Unit(bool),
    /// A force on the hitch: constant part along x, y and z, N, and towed mass, kg.
    Hitched,
    /// The force of a strut is wrong: constant part, N, and relative error of the rate.
    Strut(usize),
    /// More than one mistake. It is not weighed: it stands where the likeliest of the others leaves too much of the
    /// contradiction. Parameter: how many times larger than they should be the residuals are.
    Several,
}

/// Independent normal distributions of the parameters of a hypothesis before the drive.
pub(super) struct Prior {
    pub(super) count: usize,
    pub(super) parameters: [usize; MOST],
    pub(super) mean: [f64; MOST],
    pub(super) sigma: [f64; MOST],
}

/// All mistakes.
pub(super) fn all() -> impl Iterator<Item = Hypothesis> {
    let body = [
        Hypothesis::Zeros,
        Hypothesis::Payload,
        Hypothesis::Tilted(0),
        Hypothesis::Tilted(1),
        Hypothesis::Tilted(2),
        Hypothesis::Moved,
        Hypothesis::Unit(false),
        Hypothesis::Unit(true),
        Hypothesis::Hitched,
    ];
    let channels = (0..CHANNELS).flat_map(|at| {
        [
            Hypothesis::Offset(at),
            Hypothesis::Gain(at),
            Hypothesis::Bent(at),
        ]
    });
    let pairs = (0..4).flat_map(|wheel| PAIRS.map(|pair| Hypothesis::Exchanged(wheel, pair)));
    let all = body
        .into_iter()
        .chain(channels)
        .chain(pairs)
        .chain(WHEELS.map(Hypothesis::Corners))
        .chain((0..ROTATIONS).map(Hypothesis::Turned))
        .chain((0..4).map(Hypothesis::Strut));
    // The list of results has room for so many.
    all.take(HYPOTHESES)
}

impl Prior {
    /// Parameters that follow each other.
    fn centred<const N: usize>(first: usize, sigma: [f64; N]) -> Self {
        Self {
            count: N,
            parameters: std::array::from_fn(|i| first + i),
            mean: [0.0; MOST],
            sigma: std::array::from_fn(|i| sigma.get(i).copied().unwrap_or(1.0)),
        }
    }

    /// One parameter that the mistake determines.
    fn known(parameter: usize, value: f64, sigma: f64) -> Self {
        let mut prior = Self::centred(parameter, [sigma]);
        prior.mean[0] = value;
        prior
    }
}

impl Hypothesis {
    /// Whether it is a mistake of the configuration. The others are what a fault of one sensor during the drive looks
    /// like, which the monitors of the channels report: they keep such a fault from being taken for a mistake.
    pub(super) const fn is_of_configuration(self) -> bool {
        !matches!(self, Self::Offset(_) | Self::Strut(_))
    }

    pub(super) fn prior(self, setup: &Setup, t: &MistakeTuning) -> Prior {
        match self {
            Self::Zeros => Prior::centred(OFFSET, setup.count_n.map(|n| t.offset_counts * n.abs())),
            Self::Offset(at) => {
                Prior::centred(OFFSET + at, [t.one_offset_counts * setup.count_n[at].abs()])
            }
            Self::Gain(at) => Prior::centred(LOST + at, [t.gain_sigma]),
            Self::Bent(at) => Prior::centred(SHAPE + 3 * at, [t.bent_sigma; 3]),
            Self::Exchanged(wheel, pair) => {
                let k = PAIRS.iter().position(|known| *known == pair);
                let parameter = EXCHANGED + PAIRS.len() * wheel + k.unwrap_or(0);
                Prior::known(parameter, 1.0, t.exchange_sigma)
            }
            Self::Corners(wheels) => {
                let k = WHEELS.iter().position(|known| *known == wheels);
                Prior::known(CORNERS + k.unwrap_or(0), 1.0, t.exchange_sigma)
            }
            Self::Payload => {
                let moment = t.payload_sigma_kg * t.payload_arm_m;
                Prior::centred(MASS, [t.payload_sigma_kg, moment, moment, moment])
            }
            Self::Tilted(axis) => Prior::centred(TILT + axis, [t.tilt_sigma_rad]),
            Self::Turned(k) => Prior::known(TURNED + k, 1.0, t.exchange_sigma),
            Self::Moved => Prior::centred(LEVER, [t.lever_sigma_m; 3]),
            Self::Unit(is_large) => {
                let reading = if is_large {
                    STANDARD_GRAVITY_M_S2
                } else {
                    1.0 / STANDARD_GRAVITY_M_S2
                };
                // What a reading has beyond the value, as a part of the reading.
                let part = 1.0 - 1.0 / reading;
                Prior::known(SCALE, part, t.unit_sigma * part.abs())
            }
            Self::Hitched => {
                let [along, across, up] = t.hitch_sigma.map(|part| part * setup.load_n);
                Prior::centred(HITCH, [along, across, up, t.towed_sigma_kg])
            }
            Self::Strut(wheel) => Prior {
                parameters: std::array::from_fn(|i| [PRELOAD, RATE][i.min(1)] + wheel),
                ..Prior::centred(PRELOAD, [t.preload_sigma * setup.load_n, t.rate_sigma])
            },
            Self::Several => Prior::centred::<0>(0, []),
        }
    }
}
