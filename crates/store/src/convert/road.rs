//! The road under the wheels.

use sample::{LogTime, PerWheel, Road, RoadPlane, RoadRoughness, RoadUnknown};

use super::{nan, some};
use crate::proto::atvrec as pb;
use crate::wheels::{entries, per_wheel};

pub(super) fn road_to_proto(road: &Road) -> pb::Road {
    let unknown = match road.unknown {
        None => pb::RoadUnknown::Nothing,
        Some(RoadUnknown::Settling) => pb::RoadUnknown::Settling,
        Some(RoadUnknown::Slow) => pb::RoadUnknown::Slow,
        Some(RoadUnknown::NoDeflection) => pb::RoadUnknown::NoDeflection,
    };
    let plane = &road.plane;
    let [iri_left_m_km, iri_right_m_km] = road.iri_m_km.map(some);
    pb::Road {
        unknown: unknown.into(),
        wheels: if road.unknown.is_some() {
            Vec::new()
        } else {
            entries(|wheel, axle, side| pb::WheelRoad {
                axle,
                side,
                height_m: road.height_m[wheel],
                height_sigma_m: road.height_sigma_m[wheel],
            })
        },
        bank_rad: some(plane.bank_rad),
        bank_sigma_rad: some(plane.bank_sigma_rad),
        grade_rad: some(plane.grade_rad),
        grade_sigma_rad: some(plane.grade_sigma_rad),
        warp_m: some(plane.warp_m),
        warp_sigma_m: some(plane.warp_sigma_m),
        roughness: road.roughness.as_ref().map(roughness_to_proto),
        iri_left_m_km,
        iri_right_m_km,
    }
}

fn roughness_to_proto(roughness: &RoadRoughness) -> pb::RoadRoughness {
    let [best, worst] = roughness.class_bounds();
    let [gd_n0_low_m3, gd_n0_high_m3] = roughness.bounds_m3;
    pb::RoadRoughness {
        class: roughness.class().to_string(),
        class_best: best.to_string(),
        class_worst: worst.to_string(),
        gd_n0_m3: roughness.gd_n0_m3,
        gd_n0_low_m3,
        gd_n0_high_m3,
        waviness: some(roughness.waviness),
        distance_m: roughness.distance_m,
    }
}

pub(super) fn road_from_proto(time: LogTime, road: &pb::Road) -> Road {
    Road {
        time,
        unknown: road_unknown(road.unknown),
        height_m: per_wheel(&road.wheels, f64::NAN, |w| w.height_m),
        height_sigma_m: per_wheel(&road.wheels, f64::NAN, |w| w.height_sigma_m),
        plane: RoadPlane {
            bank_rad: nan(road.bank_rad),
            bank_sigma_rad: nan(road.bank_sigma_rad),
            grade_rad: nan(road.grade_rad),
            grade_sigma_rad: nan(road.grade_sigma_rad),
            warp_m: nan(road.warp_m),
            warp_sigma_m: nan(road.warp_sigma_m),
        },
        roughness: road.roughness.as_ref().map(|found| RoadRoughness {
            gd_n0_m3: found.gd_n0_m3,
            bounds_m3: [found.gd_n0_low_m3, found.gd_n0_high_m3],
            waviness: nan(found.waviness),
            distance_m: found.distance_m,
        }),
        iri_m_km: [road.iri_left_m_km, road.iri_right_m_km].map(nan),
    }
}

/// Why a road has no values.
pub(super) fn road_unknown(number: i32) -> Option<RoadUnknown> {
    match pb::RoadUnknown::try_from(number).unwrap_or_default() {
        pb::RoadUnknown::Nothing => None,
        pb::RoadUnknown::Settling => Some(RoadUnknown::Settling),
        pb::RoadUnknown::Slow => Some(RoadUnknown::Slow),
        pb::RoadUnknown::NoDeflection => Some(RoadUnknown::NoDeflection),
    }
}

pub(super) fn friction_from_proto(message: &pb::Friction) -> PerWheel<f64> {
    per_wheel(&message.wheels, f64::NAN, |entry| entry.coefficient)
}
