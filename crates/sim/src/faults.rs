//! Things that go wrong, on purpose.

use std::ops::Range;

use model::sensors::HubAxis;
use sample::{HubAccelerationSample, StrainChannel, Wheel};
use serde::{Deserialize, Serialize};

use crate::SimError;
use crate::emission::{Emission, Output, Port};
use crate::random::Noise;

/// All faults of a run; none by default. As TOML, each is a table in an array:
///
/// ```toml
/// [[channel]]
/// wheel = "front_right"
/// channel = "lower_front"
/// kind = { drifting = { counts_per_s = 2.0 } }
/// from_s = 5.0
/// to_s = 20.0
///
/// [[outage]]
/// port = "novatel"
/// from_s = 8.0
/// to_s = 11.0
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// Faults of strain and deflection channels.
    pub channel: Vec<ChannelFault>,
    /// Faults of the inertial unit's axes.
    pub imu: Vec<ImuFault>,
    /// Hub accelerometers that are mounted turned.
    pub hub: Vec<HubFault>,
    /// Axes of hub accelerometers that are dead or frozen.
    pub hub_axis: Vec<HubAxisFault>,
    /// Intervals in which a receiver has no solution; its messages go on and say so.
    pub outage: Vec<Interruption>,
    /// Intervals in which a device is unplugged: nothing leaves, messages are cut at both ends.
    pub unplugged: Vec<Interruption>,
    /// Bytes that are changed on the way.
    pub byte_noise: Vec<Chance>,
    /// Messages that are lost whole.
    pub dropped: Vec<Chance>,
}

/// A fault of one strain or deflection channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelFault {
    /// The corner.
    pub wheel: Wheel,
    /// The strain channel; without one, the spring potentiometer.
    #[serde(default)]
    pub channel: Option<StrainChannel>,
    /// What happens to it.
    pub kind: ChannelFaultKind,
    /// When it begins, s.
    #[serde(default)]
    pub from_s: f64,
    /// When it ends, s.
    #[serde(default = "for_ever")]
    pub to_s: f64,
}

/// What happens to a channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChannelFaultKind {
    /// Torn off: the converter sits at zero.
    Dead,
    /// The count stays as it was when the fault began.
    Frozen,
    /// The bridge is wired the other way round.
    Inverted,
    /// The level runs away.
    Drifting {
        /// How fast.
        counts_per_s: f64,
    },
    /// The level jumps.
    Step {
        /// How far.
        counts: f64,
    },
    /// The gauges stand in adjacent arms of the bridge, so that it reads bending instead of axial
    /// strain (thesis section 5.2.1). A lower tube's bending is that of its outboard part; upper
    /// tubes and tie rods hardly bend.
    BendingWired,
    /// The plug is in another channel's place (`{ swapped_with = { channel = "upper_rear" } }`): it
    /// reads that channel's member with its own amplifier.
    SwappedWith {
        /// The strain channel whose member is read.
        channel: StrainChannel,
    },
}

/// A hub accelerometer that is mounted turned, from the beginning to the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HubFault {
    /// The wheel.
    pub wheel: Wheel,
    /// Turn from the carrier's to the sensor's axes about x, then y, then z, rad; the misalignment of
    /// the sensors file comes on top.
    pub turned_rad: [f64; 3],
}

/// A fault of one axis of a hub accelerometer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HubAxisFault {
    /// The wheel.
    pub wheel: Wheel,
    /// The axis of the sensor.
    pub axis: HubAxis,
    /// What happens to it.
    pub kind: HubAxisFaultKind,
    /// When it begins, s.
    #[serde(default)]
    pub from_s: f64,
    /// When it ends, s.
    #[serde(default = "for_ever")]
    pub to_s: f64,
}

/// What happens to an axis of a hub accelerometer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HubAxisFaultKind {
    /// Torn off: the converter sits at zero.
    Dead,
    /// The count stays as it was when the fault began.
    Frozen,
}

/// A fault of one axis of the inertial unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuFault {
    /// 0 to 2: specific force along x, y, z; 3 to 5: rate about x, y, z.
    pub axis: usize,
    /// What happens to it.
    pub kind: ImuFaultKind,
    /// When it begins, s.
    #[serde(default)]
    pub from_s: f64,
    /// When it ends, s.
    #[serde(default = "for_ever")]
    pub to_s: f64,
}

/// What happens to an axis; sizes are in m/s^2 or rad/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImuFaultKind {
    /// The value stays as it was when the fault began.
    Frozen,
    /// The sign is wrong.
    Inverted,
    /// An additional bias.
    Bias {
        /// Its size.
        size: f64,
    },
    /// Single wild values.
    Spikes {
        /// Their size, to either side.
        size: f64,
        /// The chance of one in each packet.
        probability: f64,
    },
}

/// An interval of a port.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interruption {
    /// The port.
    pub port: Port,
    /// When it begins, s.
    #[serde(default)]
    pub from_s: f64,
    /// When it ends, s.
    #[serde(default = "for_ever")]
    pub to_s: f64,
}

/// A chance on a port: of a message to be lost, or of each byte to be changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chance {
    /// The port.
    pub port: Port,
    /// From 0 to 1.
    pub probability: f64,
    /// When it begins, s.
    #[serde(default)]
    pub from_s: f64,
    /// When it ends, s.
    #[serde(default = "for_ever")]
    pub to_s: f64,
}

fn for_ever() -> f64 {
    f64::INFINITY
}

impl Faults {
    /// Refuses axes that do not exist and probabilities that are none.
    pub(crate) fn check(&self) -> Result<(), SimError> {
        let bad = |name: &str, value, expected| {
            Err(SimError::BadParameter {
                name: name.to_owned(),
                value,
                expected,
            })
        };
        for fault in &self.imu {
            if fault.axis > 5 {
                return bad("imu.axis", fault.axis as f64, "0 to 5");
            }
        }
        for angle in self.hub.iter().flat_map(|fault| fault.turned_rad) {
            if !angle.is_finite() {
                return bad("hub.turned_rad", angle, "a finite angle");
            }
        }
        let spikes = self.imu.iter().filter_map(|fault| match fault.kind {
            ImuFaultKind::Spikes { probability, .. } => Some(probability),
            _ => None,
        });
        let chances = self.byte_noise.iter().chain(&self.dropped);
        for probability in chances.map(|chance| chance.probability).chain(spikes) {
            if !(0.0..=1.0).contains(&probability) {
                return bad("probability", probability, "from 0 to 1");
            }
        }
        Ok(())
    }

    /// What is faulty and when, in s from the start of the motion, by the beginning of the names that an
    /// estimator's events give the channels.
    #[must_use]
    pub fn sensors(&self) -> Vec<(String, Range<f64>)> {
        let channels = self.channel.iter().map(|fault| {
            let channel = fault.channel.map_or("deflection", StrainChannel::name);
            let name = format!("{} {channel}", fault.wheel.abbreviation());
            (name, fault.from_s..fault.to_s)
        });
        // A turned sensor shows on all its axes.
        let turned = self.hub.iter().map(|fault| {
            let name = format!("{} hub acceleration", fault.wheel.abbreviation());
            (name, 0.0..f64::INFINITY)
        });
        let hub_axes = self.hub_axis.iter().map(|fault| {
            let axis = HubAccelerationSample::AXES[fault.axis as usize];
            let name = format!("{} hub acceleration {axis}", fault.wheel.abbreviation());
            (name, fault.from_s..fault.to_s)
        });
        let axes = self.imu.iter().map(|fault| {
            let name = "inertial unit".to_owned();
            (name, fault.from_s..fault.to_s)
        });
        let interruptions = self.outage.iter().chain(&self.unplugged);
        let spans = interruptions.map(|found| (found.port, found.from_s..found.to_s));
        let chances = self.byte_noise.iter().chain(&self.dropped);
        let chances = chances.map(|found| (found.port, found.from_s..found.to_s));
        let ports = spans.chain(chances).flat_map(|(port, span)| {
            let names = port.sensors().iter();
            names.map(move |name| ((*name).to_owned(), span.clone()))
        });
        let hubs = turned.chain(hub_axes);
        channels.chain(hubs).chain(axes).chain(ports).collect()
    }

    /// Whether `port` has no solution at `time_s`.
    pub(crate) fn is_out(&self, port: Port, time_s: f64) -> bool {
        self.outage
            .iter()
            .any(|outage| outage.port == port && (outage.from_s..outage.to_s).contains(&time_s))
    }

    /// Turn of a wheel's hub accelerometer by a wrong mounting, about x, y, z, rad.
    pub(crate) fn hub_turn_rad(&self, wheel: Wheel) -> [f64; 3] {
        let fault = self.hub.iter().find(|fault| fault.wheel == wheel);
        fault.map_or([0.0; 3], |fault| fault.turned_rad)
    }

    /// The fault of an axis (0 to 2) of a wheel's hub accelerometer that holds at `time_s`.
    pub(crate) fn of_hub_axis(
        &self,
        wheel: Wheel,
        axis: usize,
        time_s: f64,
    ) -> Option<HubAxisFaultKind> {
        let mut all = self.hub_axis.iter();
        let found = all.find(|fault| {
            fault.wheel == wheel
                && fault.axis as usize == axis
                && (fault.from_s..fault.to_s).contains(&time_s)
        });
        found.map(|fault| fault.kind)
    }

    /// The faults of one strain channel (`None`: potentiometer) that hold at `time_s`.
    pub(crate) fn of_channel(
        &self,
        wheel: Wheel,
        channel: Option<StrainChannel>,
        time_s: f64,
    ) -> impl Iterator<Item = &ChannelFault> {
        self.channel.iter().filter(move |fault| {
            fault.wheel == wheel
                && fault.channel == channel
                && (fault.from_s..fault.to_s).contains(&time_s)
        })
    }
}

/// What happens to a port's messages on their way.
pub(crate) struct LineFaults {
    port: Port,
    unplugged: Vec<Range<f64>>,
    dropped: Vec<(Range<f64>, f64)>,
    byte_noise: Vec<(Range<f64>, f64)>,
    noise: Noise,
}

impl LineFaults {
    pub(crate) fn new(port: Port, faults: &Faults, seed: u64) -> Self {
        let chances = |chances: &[Chance]| {
            chances
                .iter()
                .filter(|chance| chance.port == port)
                .map(|chance| (chance.from_s..chance.to_s, chance.probability))
                .collect()
        };
        Self {
            port,
            unplugged: faults
                .unplugged
                .iter()
                .filter(|interruption| interruption.port == port)
                .map(|interruption| interruption.from_s..interruption.to_s)
                .collect(),
            dropped: chances(&faults.dropped),
            byte_noise: chances(&faults.byte_noise),
            noise: Noise::new(seed, &format!("faults {}", port.name())),
        }
    }

    /// The message as it arrives; nothing where it is lost.
    pub(crate) fn pass(&mut self, mut emission: Emission, byte_time_s: f64) -> Option<Emission> {
        debug_assert_eq!(emission.port, self.port, "each port has its own faults");
        let time_s = emission.time_s;
        if hits(&mut self.noise, &self.dropped, time_s) {
            return None;
        }
        match &mut emission.output {
            Output::Can(frame) => {
                // A frame hit by noise fails its checksum in the controller and is lost.
                let bytes = usize::from(frame.len);
                let hit = (0..bytes).any(|_| hits(&mut self.noise, &self.byte_noise, time_s));
                let out = self.unplugged.iter().any(|span| span.contains(&time_s));
                (!hit && !out).then_some(emission)
            }
            Output::Bytes(bytes) => {
                for byte in bytes.iter_mut() {
                    if hits(&mut self.noise, &self.byte_noise, time_s) {
                        *byte ^= 1 << ((self.noise.unit() * 8.0) as u32).min(7);
                    }
                }
                let (length, mut index, mut last_s) = (bytes.len(), 0, time_s);
                bytes.retain(|_| {
                    index += 1;
                    let leaves_s = time_s - byte_time_s * (length - index) as f64;
                    let kept = !self.unplugged.iter().any(|span| span.contains(&leaves_s));
                    last_s = if kept { leaves_s } else { last_s };
                    kept
                });
                let anything = !bytes.is_empty();
                emission.time_s = last_s;
                anything.then_some(emission)
            }
        }
    }
}

/// Draws whether one of the chances that hold at `time_s` comes true.
fn hits(noise: &mut Noise, chances: &[(Range<f64>, f64)], time_s: f64) -> bool {
    let mut hit = false;
    for (span, probability) in chances {
        if span.contains(&time_s) {
            hit |= noise.unit() < *probability;
        }
    }
    hit
}
