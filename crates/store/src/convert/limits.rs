//! What the vehicle can still do.

use sample::{Limit, LimitedBy, Limits, LimitsUnknown, LogTime};

use super::{nan, some};
use crate::proto::atvrec as pb;

pub(super) fn limits_to_proto(limits: &Limits) -> pb::Limits {
    let unknown = match limits.unknown {
        None => pb::LimitsUnknown::Nothing,
        Some(LimitsUnknown::Settling) => pb::LimitsUnknown::Settling,
        Some(LimitsUnknown::NoForces) => pb::LimitsUnknown::NoForces,
        Some(LimitsUnknown::Grip) => pb::LimitsUnknown::Grip,
    };
    let by = match limits.limited_by {
        LimitedBy::Unknown => pb::LimitedBy::Unknown,
        LimitedBy::FrontGrip => pb::LimitedBy::FrontGrip,
        LimitedBy::RearGrip => pb::LimitedBy::RearGrip,
        LimitedBy::Rollover => pb::LimitedBy::Rollover,
    };
    pb::Limits {
        unknown: unknown.into(),
        reason: limits.reason().unwrap_or_default(),
        grip_used: some(limits.grip_used),
        limited_by: by.into(),
        lateral_m_s2: some(limits.lateral_m_s2.value),
        lateral_at_least_m_s2: some(limits.lateral_m_s2.at_least),
        speed_m_s: some(limits.speed_m_s.value),
        speed_at_least_m_s: some(limits.speed_m_s.at_least),
        curve_radius_m: some(limits.curve_radius_m),
        curve_speed_m_s: some(limits.curve_speed_m_s.value),
        curve_speed_at_least_m_s: some(limits.curve_speed_m_s.at_least),
        side_slope_rad: some(limits.side_slope_rad.value),
        side_slope_at_least_rad: some(limits.side_slope_rad.at_least),
        grade_rad: some(limits.grade_rad.value),
        grade_at_least_rad: some(limits.grade_rad.at_least),
    }
}

pub(super) fn limits_from_proto(time: LogTime, limits: &pb::Limits) -> Limits {
    let limit = |value, at_least| Limit {
        value: nan(value),
        at_least: nan(at_least),
    };
    Limits {
        time,
        unknown: match limits.unknown() {
            pb::LimitsUnknown::Nothing => None,
            pb::LimitsUnknown::Settling => Some(LimitsUnknown::Settling),
            pb::LimitsUnknown::NoForces => Some(LimitsUnknown::NoForces),
            pb::LimitsUnknown::Grip => Some(LimitsUnknown::Grip),
        },
        grip_used: nan(limits.grip_used),
        limited_by: match limits.limited_by() {
            pb::LimitedBy::Unknown => LimitedBy::Unknown,
            pb::LimitedBy::FrontGrip => LimitedBy::FrontGrip,
            pb::LimitedBy::RearGrip => LimitedBy::RearGrip,
            pb::LimitedBy::Rollover => LimitedBy::Rollover,
        },
        lateral_m_s2: limit(limits.lateral_m_s2, limits.lateral_at_least_m_s2),
        speed_m_s: limit(limits.speed_m_s, limits.speed_at_least_m_s),
        curve_radius_m: nan(limits.curve_radius_m),
        curve_speed_m_s: limit(limits.curve_speed_m_s, limits.curve_speed_at_least_m_s),
        side_slope_rad: limit(limits.side_slope_rad, limits.side_slope_at_least_rad),
        grade_rad: limit(limits.grade_rad, limits.grade_at_least_rad),
    }
}
