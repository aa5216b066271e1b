//! What is wrong with a channel's wiring.

use std::fmt;

use sample::{Mounting, StrainChannel, Wheel};

/// Something wrong with a channel's wiring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WiringFault {
    /// Corner.
    pub wheel: Wheel,
    /// Channel.
    pub channel: StrainChannel,
    /// What it is.
    pub kind: WiringKind,
    /// What carries the wheel, where channels have other names.
    pub mounting: Option<Mounting>,
}

/// What is wrong with a channel's wiring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WiringKind {
    /// It falls where it should rise.
    Inverted,
    /// It reads another channel's member.
    Swapped(StrainChannel),
    /// It reads the arm's bending.
    Bending,
    /// It does not react.
    NoReaction,
    /// It is at an end of its range, or silent, whatever the load.
    Silent,
    /// It leaves its range under most loads.
    OutOfRange,
    /// It follows nothing that the linkage knows.
    Unexplained,
}

impl fmt::Display for WiringFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |channel: StrainChannel| channel.name_on(self.mounting);
        write!(f, "{} {} ", self.wheel, name(self.channel))?;
        match self.kind {
            WiringKind::Inverted => write!(
                f,
                "is wired the other way round; its gain is written negative"
            ),
            WiringKind::Swapped(other) => write!(
                f,
                "reads {}: its plug is in the wrong place; it is called dead until that is mended",
                name(other)
            ),
            WiringKind::Bending => write!(
                f,
                "reads bending: its gauges stand in adjacent arms of the bridge; it is called dead"
            ),
            WiringKind::NoReaction => write!(f, "does not react to load; it is called dead"),
            WiringKind::Silent => write!(
                f,
                "gives no reading within its range; it is called dead, look at gauge and cable"
            ),
            WiringKind::OutOfRange => write!(
                f,
                "leaves its range under load: its gauges stand in adjacent arms of the bridge, \
                 where they read bending, or its gain is too high; it is called dead"
            ),
            WiringKind::Unexplained => write!(
                f,
                "follows no member of the linkage; it is called dead, look at gauge and cable"
            ),
        }
    }
}
