//! Measurements in the signals of a frame.

use std::sync::Arc;

use sample::{CornerSample, Counts, HubAccelerationSample, PerWheel, Signal, StrainChannel, Wheel};
use wire::column::Quantity;
use wire::dbc::MessageDef;

use super::{Conversion, Plan, Scales};
use crate::config::{Role, Travel, WheelRate};

/// Measurements in the signals of a frame.
#[derive(Default)]
pub(super) struct Measured {
    pub(super) steer_rad: Option<f64>,
    /// Travel of the tie rods, left and right, and of the rack, m.
    pub(super) rods_m: [Option<f64>; 3],
    pub(super) speeds_rad_s: PerWheel<Option<f64>>,
    /// Corners in the order of the wheels.
    pub(super) corners: Vec<CornerSample>,
    /// Uprights in the order of the wheels.
    pub(super) hubs: Vec<HubAccelerationSample>,
    /// Values that are recorded under their names.
    pub(super) controls: Vec<Signal>,
    /// Parts of measurements of other devices.
    pub(super) parts: Vec<(Quantity, f64)>,
    /// Whether the receiver has a solution.
    pub(super) is_solved: Option<bool>,
}

/// Signals of a message, and the measurements in them.
pub(super) fn decode(
    message: &MessageDef,
    plan: &Plan,
    data: &[u8],
    scales: &Scales,
) -> (Vec<Signal>, Measured) {
    let mut measured = Measured::default();
    let mut signals = Vec::with_capacity(message.signals.len());
    for value in message.decode(data) {
        let signal = &plan.signals[value.index];
        signals.push(Signal {
            name: Arc::clone(&signal.name),
            value: value.physical,
            unit: Arc::clone(&signal.unit),
        });
        let is_absent =
            signal.absent.is_some() && signal.absent == value.signal.integer(value.bits);
        match signal.role.filter(|_| !is_absent) {
            Some(Role::Steer(factor)) => measured.steer_rad = Some(value.physical * factor),
            Some(Role::SteerRod(side, travel)) => {
                measured.rods_m[side as usize] = match travel {
                    Travel::Length(factor) => Some(value.physical * factor),
                    _ => (scales.rods.as_ref().zip(signal.conversion.counts(&value)))
                        .and_then(|(pots, counts)| pots.travel_m(counts)),
                };
            }
            Some(Role::Rack(factor)) => measured.rods_m[2] = Some(value.physical * factor),
            Some(Role::WheelSpeed(wheel, rate)) => {
                let radius_m = scales.rolling_radius_m[wheel];
                measured.speeds_rad_s[wheel] = match rate {
                    WheelRate::Angular(factor) => Some(value.physical * factor),
                    WheelRate::Rolling(factor) => radius_m.map(|r| value.physical * factor / r),
                };
            }
            Some(Role::Deflection(wheel, _)) => {
                let corner = measured.corner(wheel);
                corner.deflection_counts = signal.conversion.counts(&value);
            }
            Some(Role::Strain(wheel, channel, _)) => {
                let corner = measured.corner(wheel);
                corner.strain_counts[channel.index()] = signal.conversion.counts(&value);
            }
            Some(Role::Quantity(quantity, factor)) => {
                measured.parts.push((quantity, value.physical * factor));
            }
            Some(Role::Fix) => measured.is_solved = Some(value.physical != 0.0),
            Some(Role::HubAcceleration(wheel, axis, factor)) => {
                let hub = measured.hub(wheel);
                let counts = Conversion::Counts.counts(&value).map(Counts::number);
                let counts = counts.map(|counts| counts as i32);
                hub.counts[axis] = counts.filter(|_| factor.is_none());
                hub.specific_force_m_s2[axis] = match factor {
                    Some(factor) => Some(value.physical * factor),
                    None => (scales.hub.as_ref())
                        .zip(hub.counts[axis])
                        .and_then(|(scale, count)| scale.specific_force_m_s2(count)),
                };
            }
            Some(Role::Control(_, factor)) => {
                let names = signal.control.iter();
                measured.controls.extend(names.map(|(name, unit)| Signal {
                    name: Arc::clone(name),
                    value: value.physical * factor,
                    unit: Arc::clone(unit),
                }));
            }
            None => {}
        }
    }
    (signals, measured)
}

impl Measured {
    /// Steering-wheel angle by the mean travel of the tie rods in the frame, rad. Both rods hang on the
    /// rack, so that their inner ends travel alike.
    pub(super) fn by_rods_rad(&self, rack_m_rad: Option<f64>) -> Option<f64> {
        let known = || self.rods_m.into_iter().flatten();
        let count = known().count();
        let rack_m_rad = rack_m_rad.filter(|rack| *rack != 0.0 && count > 0)?;
        Some(known().sum::<f64>() / count as f64 / rack_m_rad)
    }

    fn corner(&mut self, wheel: Wheel) -> &mut CornerSample {
        let place = self.corners.partition_point(|known| known.wheel < wheel);
        if self
            .corners
            .get(place)
            .is_none_or(|known| known.wheel != wheel)
        {
            let corner = CornerSample {
                wheel,
                strain_counts: [None; StrainChannel::COUNT],
                deflection_counts: None,
            };
            self.corners.insert(place, corner);
        }
        &mut self.corners[place]
    }

    fn hub(&mut self, wheel: Wheel) -> &mut HubAccelerationSample {
        let place = self.hubs.partition_point(|known| known.wheel < wheel);
        if self
            .hubs
            .get(place)
            .is_none_or(|known| known.wheel != wheel)
        {
            self.hubs.insert(place, HubAccelerationSample::empty(wheel));
        }
        &mut self.hubs[place]
    }
}
