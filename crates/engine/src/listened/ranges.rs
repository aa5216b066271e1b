//! Counts that the converters of the sensors file cannot send.

use estimator::calibration::range::{BeyondRange, CountRange};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{CornerSample, PerWheel, StrainChannel, Wheel};

/// Channels of a corner: strain, and the potentiometer last.
const CHANNELS: usize = StrainChannel::COUNT + 1;
/// Fields of the sensors file with the bits of the converters.
const FIELDS: [&str; 2] = ["strain.adc_bits", "deflection.adc_bits"];

/// Range of the counts of each channel.
#[derive(Debug)]
pub(super) struct Ranges {
    /// Bits of the converters of strain channels and of potentiometers; `None` if not fitted.
    bits: [Option<u8>; 2],
    ranges: PerWheel<[CountRange; CHANNELS]>,
}

/// Channels of one table of the sensors file whose counts are beyond its range.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WrongRange {
    /// The channels, with their table.
    pub channels: String,
    /// Their counts.
    pub beyond: BeyondRange,
}

impl Ranges {
    pub fn new(sensors: &Sensors) -> Self {
        let (strain, pots) = (&sensors.strain, &sensors.deflection);
        Self {
            bits: [
                (!strain.is_not_fitted()).then_some(strain.adc_bits),
                (!pots.is_not_fitted()).then_some(pots.adc_bits),
            ],
            ranges: PerWheel::default(),
        }
    }

    pub fn push(&mut self, corner: &CornerSample) {
        let ranges = &mut self.ranges[corner.wheel];
        let counts = corner
            .strain_counts
            .iter()
            .chain([&corner.deflection_counts]);
        for (channel, (range, counts)) in ranges.iter_mut().zip(counts).enumerate() {
            if let (Some(counts), Some(bits)) = (counts, self.bits[table_of(channel)]) {
                range.push(*counts, bits);
            }
        }
    }

    /// The channels beyond the range of the sensors file, by its tables.
    pub fn wrong(&self, vehicle: &Vehicle) -> Vec<WrongRange> {
        let mut wrong = Vec::new();
        for (table, name) in ["strain", "deflection"].into_iter().enumerate() {
            let Some(bits) = self.bits[table] else {
                continue;
            };
            let mut channels = Vec::new();
            let mut all: Option<BeyondRange> = None;
            for wheel in Wheel::ALL {
                for channel in (0..CHANNELS).filter(|channel| table_of(*channel) == table) {
                    let range = &self.ranges[wheel][channel];
                    let Some(beyond) = range.beyond(FIELDS[table], bits) else {
                        continue;
                    };
                    let name = StrainChannel::ALL
                        .get(channel)
                        .map(|channel| format!(" {}", vehicle.channel_name(wheel, *channel)));
                    let corner = wheel.abbreviation();
                    channels.push(format!("{corner}{}", name.unwrap_or_default()));
                    all = Some(all.map_or(beyond, |all| BeyondRange {
                        least: all.least.min(beyond.least),
                        largest: all.largest.max(beyond.largest),
                        ..all
                    }));
                }
            }
            wrong.extend(all.map(|beyond| WrongRange {
                channels: format!("{name} {}", channels.join(", ")),
                beyond,
            }));
        }
        wrong
    }
}

fn table_of(channel: usize) -> usize {
    usize::from(channel >= StrainChannel::COUNT)
}
