//! Stress and strain at the gauges of a corner under a load, and the counts that they make (thesis section 3.3).
//!
//! | quantity | equation |
//! |---|---|
//! | axial stress | sigma_a = N/A |
//! | bending stress of the outer fibre | sigma_b = M/W |
//! | largest strain of a gauge | e = (abs(sigma_a) + abs(sigma_b))/E |
//! | counts | zero + N or M over the load of one count ([`ChannelScale`](crate::strain::ChannelScale)) |
//!
//! with the tension N and the moment M of [`MemberBeam`] at the gauge, the area A and the section modulus W of the
//! tube of the sensors file. A gauge is strained by the bending also where its bridge does not measure it.

use sample::{StrainChannel, Wheel};

use super::{MemberBeam, SuspensionError, beams};
use crate::sensors::Sensors;
use crate::strain::{ChannelScale, Section};
use crate::vehicle::Vehicle;

/// Distance of the axial gauges from the outer joint if nothing else is given, m.
const AXIAL_DISTANCE_M: f64 = 0.1;

/// A load on a wheel, and where its gauges are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaugeLoad {
    /// The wheel.
    pub wheel: Wheel,
    /// Force of the ground on the tyre, contact frame, N.
    pub force_n: [f64; 3],
    /// Compression of the strut from its design length, m.
    pub compression_m: f64,
    /// Distance of the axial gauges from the outer joint along the member, m; absent: that of the bending bridge,
    /// or 0.1 m.
    pub axial_distance_m: Option<f64>,
}

/// A bridge under a load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gauge {
    /// Its channel.
    pub channel: StrainChannel,
    /// Distance from the outer joint along the member, m.
    pub distance_m: f64,
    /// Tension, N.
    pub tension_n: f64,
    /// Bending moment, N m.
    pub moment_n_m: f64,
    /// Axial stress, Pa.
    pub axial_stress_pa: f64,
    /// Bending stress of the outer fibre, Pa.
    pub bending_stress_pa: f64,
    /// Largest strain of one of its gauges, m/m.
    pub strain: f64,
    /// Counts without noise and rounding. They can be beyond the range of the converter.
    pub counts: f64,
    /// Counts from the zero over the counts from the zero to the end of the range in this direction.
    pub part_of_range: f64,
}

/// The bridges of a corner under a load.
#[derive(Clone, Debug, PartialEq)]
pub struct GaugeTable {
    /// Members of the corner.
    pub beams: Vec<MemberBeam>,
    /// Section of the tubes.
    pub section: Section,
    /// Its bridges, axial ones first.
    pub gauges: Vec<Gauge>,
}

/// Why there are no stresses.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GaugeError {
    /// The linkage has no forces.
    #[error(transparent)]
    Suspension(#[from] SuspensionError),
    /// The sensors file lacks a value.
    #[error(transparent)]
    Sensors(#[from] crate::Error),
    /// A gauge would be beyond its member.
    #[error(
        "{channel}: the gauge is {distance_m} m from the outer joint, but the member is {length_m:.3} m long; use a \
         distance above 0 and below its length"
    )]
    Distance {
        /// Channel.
        channel: &'static str,
        /// Distance from the outer joint, m.
        distance_m: f64,
        /// Length of the member, m.
        length_m: f64,
    },
    /// A solid axle.
    #[error(
        "the {axle} axle is a solid axle; stresses are computed for double wishbones, MacPherson struts and five links, \
         so choose a wheel of the other axle"
    )]
    SolidAxle {
        /// `front` or `rear`.
        axle: &'static str,
    },
}

/// The bridges of a corner under a load.
///
/// # Errors
/// As [`beams`]; a sensors file without tube, modulus or gain; a gauge beyond its member; a solid axle.
pub fn gauges(
    vehicle: &Vehicle,
    sensors: &Sensors,
    load: &GaugeLoad,
) -> Result<GaugeTable, GaugeError> {
    let is_front = load.wheel.is_front();
    if vehicle.axle(load.wheel).is_solid() {
        return Err(GaugeError::SolidAxle {
            axle: if is_front { "front" } else { "rear" },
        });
    }
    let chain = &sensors.strain;
    let section = chain.section()?;
    let modulus_pa = chain.modulus_pa()?;
    let beams = beams(vehicle, load.wheel, load.force_n, load.compression_m)?;
    let bending_m = chain
        .bending
        .as_ref()
        .map(|bending| bending.distance_from_ball_joint_m);
    let axial_m = load
        .axial_distance_m
        .or(bending_m)
        .unwrap_or(AXIAL_DISTANCE_M);
    let axial_scale = chain.axial_scale()?;
    let mut bridges: Vec<(&MemberBeam, StrainChannel, f64, ChannelScale, bool)> = beams
        .iter()
        .map(|beam| (beam, beam.channel, axial_m, axial_scale, false))
        .collect();
    // No channel has the bending of a single link.
    let bending_m = bending_m.filter(|_| vehicle.axle(load.wheel).five_link.is_none());
    if let (Some(scale), Some(bending_m)) = (chain.bending_scale()?, bending_m) {
        for beam in beams.iter().filter(|beam| beam.mount_m.is_some()) {
            let channel = match beam.channel {
                StrainChannel::LowerFront => StrainChannel::LowerFrontBending,
                _ => StrainChannel::LowerRearBending,
            };
            bridges.push((beam, channel, bending_m, scale, true));
        }
    }
    let gauges = bridges
        .into_iter()
        .map(|(beam, channel, distance_m, scale, bends)| {
            if !(0.0 < distance_m && distance_m < beam.length_m) {
                return Err(GaugeError::Distance {
                    channel: channel.name(),
                    distance_m,
                    length_m: beam.length_m,
                });
            }
            let axial_pa = beam.tension_n(distance_m) / section.area_m2();
            let bending_pa = beam.moment_n_m(distance_m) / section.section_modulus_m3();
            let strain = (axial_pa.abs() + bending_pa.abs()) / modulus_pa;
            Ok(gauge(
                beam,
                channel,
                distance_m,
                &scale,
                bends,
                [axial_pa, bending_pa, strain],
            ))
        })
        .collect::<Result<Vec<Gauge>, GaugeError>>()?;
    Ok(GaugeTable {
        beams,
        section,
        gauges,
    })
}

/// A bridge with its counts. `stressed`: axial and bending stress, Pa, and largest strain.
fn gauge(
    beam: &MemberBeam,
    channel: StrainChannel,
    distance_m: f64,
    scale: &ChannelScale,
    bends: bool,
    [axial_stress_pa, bending_stress_pa, strain]: [f64; 3],
) -> Gauge {
    let (tension_n, moment_n_m) = (beam.tension_n(distance_m), beam.moment_n_m(distance_m));
    let counts = scale.level(if bends { moment_n_m } else { tension_n });
    let change = counts - scale.zero_counts;
    let room = if change < 0.0 {
        scale.zero_counts
    } else {
        scale.largest_count - scale.zero_counts
    };
    Gauge {
        channel,
        distance_m,
        tension_n,
        moment_n_m,
        axial_stress_pa,
        bending_stress_pa,
        strain,
        counts,
        part_of_range: change.abs() / room,
    }
}

#[cfg(test)]
mod tests;
