//! What is wrong with a channel at rest.

use std::fmt;

use sample::{Mounting, StrainChannel, Wheel};

use super::Said;
use crate::calibration::Channel;
use crate::calibration::rest::Rest;

/// Drift is named beyond this many standard deviations, and beyond this size, counts/s.
const DRIFT: [f64; 2] = [4.5, 0.02];
/// Short means that differ this much more than noise lets them are a fault.
const UNSTEADY: f64 = 3.0;
/// Noise beyond this multiple of the sensors file's is a fault.
const NOISY: f64 = 3.0;
/// Part of the range that an offset may take before it is named.
const FAR_OFF: f64 = 0.25;
/// Least expected change from hanging to standing that tells a sign, counts.
const TELLING_COUNTS: f64 = 8.0;
/// Measured change over the expected one: below the first the channel is inverted, below the second
/// (in size) it does not react, above the third (in size) it reads bending.
const RATIOS: [f64; 3] = [-0.35, 0.3, 2.6];
/// Part of readings at the range's end that makes a channel saturated.
pub(super) const SATURATED: f64 = 0.2;

/// Something wrong with a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelFault {
    /// Corner.
    pub wheel: Wheel,
    /// Strain channel; without one, the spring potentiometer.
    pub channel: Option<StrainChannel>,
    /// What carries the wheel, for the channel's name.
    pub mounting: Option<Mounting>,
    /// What it is.
    pub kind: FaultKind,
}

/// What is wrong with a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// No reading at all.
    Silent,
    /// At the lower end of the range: a wire is off.
    Dead,
    /// At the upper end of the range.
    Saturated,
    /// Every reading is the same.
    Frozen,
    /// The level runs away.
    Drifting {
        /// How fast, counts/s.
        counts_per_s: f64,
    },
    /// The level jumps or wanders.
    Unsteady,
    /// More noise than the sensors file says.
    Noisy {
        /// How much, counts.
        counts: f64,
    },
    /// The zero is far from the middle of the range.
    FarOff {
        /// Zero, counts.
        counts: f64,
    },
    /// It falls where it should rise.
    Inverted,
    /// It does not react to load: a bridge that is not glued, or wired to read bending where there
    /// is none.
    NoReaction {
        /// Change from hanging to standing that was expected, counts.
        expected: f64,
        /// Change that was found, counts.
        found: f64,
    },
    /// It reacts far too strongly: its gauges stand in adjacent arms of the bridge (thesis section
    /// 5.2.1).
    Bending {
        /// Change from hanging to standing that was expected, counts.
        expected: f64,
        /// Change that was found, counts.
        found: f64,
    },
}

impl FaultKind {
    /// Whether the channel is of no use until it is mended.
    #[must_use]
    pub const fn disables(self) -> bool {
        matches!(
            self,
            Self::Silent
                | Self::Dead
                | Self::Saturated
                | Self::Frozen
                | Self::NoReaction { .. }
                | Self::Bending { .. }
        )
    }
}

impl fmt::Display for ChannelFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |channel: StrainChannel| channel.name_on(self.mounting);
        let channel = self.channel.map_or("deflection", name);
        write!(f, "{} {channel} ", self.wheel)?;
        match self.kind {
            FaultKind::Silent => write!(f, "sends nothing; it is called dead"),
            FaultKind::Dead => write!(
                f,
                "is dead: the converter stands at 0, look for a torn wire"
            ),
            FaultKind::Saturated => {
                write!(
                    f,
                    "is saturated at the top of its range; balance the bridge"
                )
            }
            FaultKind::Frozen => write!(f, "is frozen: every reading is the same"),
            FaultKind::Drifting { counts_per_s } => write!(
                f,
                "drifts by {counts_per_s:.3} counts/s; let it warm up, or look at glue and moisture"
            ),
            FaultKind::Unsteady => write!(f, "is unsteady: its level jumps or wanders"),
            FaultKind::Noisy { counts } => write!(f, "is noisy: {counts:.1} counts"),
            FaultKind::FarOff { counts } => write!(
                f,
                "has its zero at {counts:.0} counts, far from the middle; balance the bridge"
            ),
            FaultKind::Inverted => {
                write!(
                    f,
                    "is wired the other way round; its gain is written negative"
                )
            }
            FaultKind::NoReaction { expected, found } => write!(
                f,
                "does not react to load ({found:.0} counts where {expected:.0} were expected): \
                 look at glue and wiring; it is called dead"
            ),
            FaultKind::Bending { expected, found } => write!(
                f,
                "reads bending ({found:.0} counts where {expected:.0} were expected): its gauges \
                 stand in adjacent arms of the bridge; it is called dead"
            ),
        }
    }
}

pub(super) fn faults_of(chain: &Channel, said: &Said<'_>, expected: [f64; 2]) -> Vec<FaultKind> {
    let Some(rest) = said.hanging else {
        return vec![FaultKind::Silent];
    };
    let full = chain.counts_max + 1.0;
    if rest.saturated > SATURATED {
        let dead = rest.mean < 0.5 * full;
        return vec![if dead {
            FaultKind::Dead
        } else {
            FaultKind::Saturated
        }];
    }
    if rest.unmoved && chain.frozen_after.is_some() {
        return vec![FaultKind::Frozen];
    }
    let mut faults = Vec::new();
    let slope = rest.slope_per_s.abs();
    if slope > DRIFT[0] * rest.slope_sigma && slope > DRIFT[1] {
        faults.push(FaultKind::Drifting {
            counts_per_s: rest.slope_per_s,
        });
    }
    if rest.unsteadiness > UNSTEADY {
        faults.push(FaultKind::Unsteady);
    }
    if rest.noise > NOISY * math::hypot(said.noise_counts, 1.0 / 12.0_f64.sqrt()) {
        faults.push(FaultKind::Noisy { counts: rest.noise });
    }
    let drifted = slope
        * said
            .standing
            .map_or(0.0, |s| s.span.from_s - rest.span.from_s);
    let wiring = said.standing.and_then(|standing| {
        wiring(
            chain,
            rest,
            standing,
            (expected[1] - expected[0]) / chain.gain,
            drifted,
        )
    });
    let turned = wiring == Some(FaultKind::Inverted);
    let gain = if turned { -chain.gain } else { chain.gain };
    let offset = rest.mean - expected[0] / gain;
    if (offset / full - 0.5).abs() > FAR_OFF {
        faults.push(FaultKind::FarOff { counts: offset });
    }
    faults.extend(wiring);
    faults
}

/// What the change from hanging to standing says of a channel's wiring.
fn wiring(
    chain: &Channel,
    hanging: &Rest,
    standing: &Rest,
    expected: f64,
    drifted: f64,
) -> Option<FaultKind> {
    let found = standing.mean - hanging.mean;
    let bending = FaultKind::Bending { expected, found };
    let room = if expected > 0.0 {
        chain.counts_max - hanging.mean
    } else {
        hanging.mean
    };
    if standing.saturated > SATURATED && expected.abs() < 0.7 * room {
        return Some(bending);
    }
    // A channel with little sensitivity to the load shows that it works by any reaction.
    if expected.abs() < TELLING_COUNTS + drifted {
        let most = RATIOS[2] * (TELLING_COUNTS + drifted) + expected.abs();
        return (found.abs() > most).then_some(bending);
    }
    let ratio = found / expected;
    if ratio.abs() > RATIOS[2] {
        Some(bending)
    } else if ratio < RATIOS[0] {
        Some(FaultKind::Inverted)
    } else if ratio < RATIOS[1] {
        Some(FaultKind::NoReaction { expected, found })
    } else {
        None
    }
}
