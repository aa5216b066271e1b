//! Solutions as the devices' messages.

use wire::crossbow440::Scaled;
use wire::geodesy::{Geodetic, heading_deg_from_yaw};
use wire::gps_time::{Utc, gps_minus_utc_s, unix_ns_from_gps};
use wire::{novatel, sbf, ubx, vectornav};

use crate::gnss::{AttitudeSolution, Solution};
use crate::{Origin, SeptentrioBlocks};

/// Satellites in a solution under open sky.
const SATELLITES: u8 = 9;

/// Crossbow S1 packet of a unit at room temperature.
pub(crate) fn crossbow_s1(force_m_s2: [f64; 3], rate_rad_s: [f64; 3], counter: u16) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(31);
    Scaled {
        specific_force_m_s2: force_m_s2,
        angular_rate_rad_s: rate_rad_s,
        gyro_temperature_c: [25.0; 3],
        board_temperature_c: 25.0,
        counter,
        ..Scaled::default()
    }
    .encode_s1(&mut bytes);
    bytes
}

/// Binary output of a VectorNav unit at room temperature: time since the start, acceleration, angular
/// rate, temperature.
pub(crate) fn vectornav_binary(
    force_m_s2: [f64; 3],
    rate_rad_s: [f64; 3],
    since_start_s: f64,
) -> Vec<u8> {
    use vectornav::Group::{Common, Imu};
    let mut bytes = Vec::with_capacity(60);
    let output = vectornav::Binary {
        since_start_ns: Some((since_start_s * 1e9).round() as u64),
        acceleration_m_s2: Some(force_m_s2.map(|v| v as f32)),
        rate_rad_s: Some(rate_rad_s.map(|v| v as f32)),
        temperature_c: Some(25.0),
        ..vectornav::Binary::default()
    };
    let fields = [(Common, 0), (Common, 5), (Common, 8), (Imu, 4)];
    vectornav::encode_binary(&output, &fields, &mut bytes);
    bytes
}

/// VNIMU of a unit at room temperature and normal pressure, without a magnetometer.
pub(crate) fn vectornav_ascii([fx, fy, fz]: [f64; 3], [p, q, r]: [f64; 3]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(120);
    let text = format!(
        "VNIMU,+00.0000,+00.0000,+00.0000,{fx:+07.3},{fy:+07.3},{fz:+07.3},{p:+010.6},{q:+010.6},\
         {r:+010.6},+25.0,+101.325"
    );
    vectornav::encode_text(&text, &mut bytes);
    bytes
}

/// NAV-PVT, and NAV-DOP on whole seconds.
pub(crate) fn ublox_epoch(s: &Solution) -> Vec<Vec<u8>> {
    let mut bodies = vec![ubx::Body::Pvt(nav_pvt(s))];
    if s.time_of_week_ms.is_multiple_of(1_000) {
        bodies.push(ubx::Body::Dop(ubx::Dop {
            time_of_week_ms: s.time_of_week_ms,
            dilutions_c: [190, 170, 90, 140, 100, 80, 60],
        }));
    }
    let encoded = bodies.into_iter().map(|body| {
        let mut bytes = Vec::with_capacity(100);
        body.encode(&mut bytes);
        bytes
    });
    encoded.collect()
}

fn nav_pvt(s: &Solution) -> ubx::Pvt {
    let unix_ns = unix_ns_from_gps(s.week, f64::from(s.time_of_week_ms) / 1e3).max(0);
    let utc = Utc::of_unix_s((unix_ns / 1_000_000_000) as u64);
    let whole = |value: f64| value.round() as i32;
    let [east, north, up] = s.velocity_enu_m_s;
    let place = s.place;
    ubx::Pvt {
        time_of_week_ms: s.time_of_week_ms,
        year: u16::try_from(utc.year).unwrap_or(u16::MAX),
        month_to_second: [utc.month, utc.day, utc.hour, utc.minute, utc.second],
        // Date and time, and no doubt about the second.
        valid: 7,
        time_accuracy_ns: 20,
        nanoseconds: (unix_ns % 1_000_000_000) as i32,
        fix: if s.valid { 3 } else { 0 },
        flags: u8::from(s.valid),
        satellites: if s.valid { SATELLITES } else { 0 },
        longitude_1e7_deg: whole(place.longitude_rad.to_degrees() * 1e7),
        latitude_1e7_deg: whole(place.latitude_rad.to_degrees() * 1e7),
        height_mm: whole(place.height_m * 1e3),
        height_msl_mm: whole((place.height_m - s.undulation_m) * 1e3),
        accuracy_mm: [(s.position_sigma_m * 1e3) as u32; 2],
        velocity_ned_mm_s: [north, east, -up].map(|v| whole(v * 1e3)),
        ground_speed_mm_s: whole(math::hypot(east, north) * 1e3),
        course_1e5_deg: whole(course_deg(s) * 1e5),
        speed_accuracy_mm_s: (s.velocity_sigma_m_s * 1e3) as u32,
        dilution_c: 170,
        ..ubx::Pvt::default()
    }
}

/// BESTPOS, BESTVEL, and TIME on whole seconds.
pub(crate) fn novatel_epoch(s: &Solution) -> Vec<Vec<u8>> {
    let mut logs = vec![(42, best_position(s)), (99, best_velocity(s))];
    if s.time_of_week_ms.is_multiple_of(1_000) {
        logs.push((101, time(s)));
    }
    logs.into_iter()
        .filter_map(|(id, body)| novatel::Log::new(id, s.week, s.time_of_week_ms, body))
        .map(|log| {
            let mut bytes = Vec::with_capacity(104);
            log.encode_binary(&mut bytes);
            bytes
        })
        .collect()
}

/// Status and type: SINGLE or DOPPLER_VELOCITY, else INSUFFICIENT_OBS and NONE.
fn status(valid: bool, kind: u32) -> novatel::Solution {
    let (status, kind) = if valid { (0, kind) } else { (1, 0) };
    novatel::Solution { status, kind }
}

fn best_position(s: &Solution) -> novatel::Body {
    novatel::Body::Position(novatel::Position {
        solution: status(s.valid, 16),
        latitude_deg: s.place.latitude_rad.to_degrees(),
        longitude_deg: s.place.longitude_rad.to_degrees(),
        height_msl_m: s.place.height_m - s.undulation_m,
        undulation_m: s.undulation_m as f32,
        datum: 61,
        sigma_m: [s.position_sigma_m as f32; 3],
        tail: novatel::Tail {
            satellites: [SATELLITES, if s.valid { SATELLITES } else { 0 }, 0, 0],
            ..novatel::Tail::default()
        },
    })
}

fn best_velocity(s: &Solution) -> novatel::Body {
    let [east, north, up] = s.velocity_enu_m_s;
    novatel::Body::Velocity(novatel::Velocity {
        solution: status(s.valid, 8),
        latency_s: s.latency_s as f32,
        horizontal_m_s: math::hypot(east, north),
        track_deg: course_deg(s),
        vertical_m_s: up,
        ..novatel::Velocity::default()
    })
}

fn time(s: &Solution) -> novatel::Body {
    let unix_ns = unix_ns_from_gps(s.week, f64::from(s.time_of_week_ms) / 1e3);
    let unix_s = unix_ns.div_euclid(1_000_000_000);
    let utc = Utc::of_unix_s(unix_s.max(0) as u64);
    novatel::Body::Time(novatel::Time {
        clock_status: 0,
        offset_s: 0.0,
        offset_sigma_s: 20e-9,
        utc_offset_s: -f64::from(gps_minus_utc_s(unix_s)),
        year: utc.year,
        month: utc.month,
        day: utc.day,
        hour: utc.hour,
        minute: utc.minute,
        milliseconds: u32::from(utc.second) * 1_000,
        utc_status: 1,
    })
}

/// PVTGeodetic, VelCovGeodetic, AttEuler and AttCovEuler.
pub(crate) fn septentrio_epoch(
    s: &Solution,
    attitude: &AttitudeSolution,
    blocks: SeptentrioBlocks,
    processing_s: f64,
) -> Vec<Vec<u8>> {
    let pvt = match blocks {
        SeptentrioBlocks::PolaRx2e => (5904, 0, pvt_v1(s)),
        SeptentrioBlocks::Current => (4007, 2, pvt(s, processing_s)),
    };
    [
        pvt,
        (5908, 0, velocity_covariance(s)),
        (5938, 0, euler(attitude)),
        (5939, 0, euler_covariance(attitude)),
    ]
    .into_iter()
    .map(|(number, revision, body)| {
        let mut bytes = Vec::with_capacity(96);
        sbf::Block::new(number, revision, s.week, s.time_of_week_ms, body).encode(&mut bytes);
        bytes
    })
    .collect()
}

/// Mode and error: stand-alone, or none for want of satellites.
fn mode(valid: bool) -> (u8, u8) {
    if valid { (1, 0) } else { (0, 1) }
}

fn course_deg(s: &Solution) -> f64 {
    let [east, north, _] = s.velocity_enu_m_s;
    heading_deg_from_yaw(math::atan2(north, east))
}

/// Latitude, longitude, height; velocity north, east, up.
fn position_and_velocity(s: &Solution) -> ([Option<f64>; 3], [Option<f32>; 3]) {
    let [east, north, up] = s.velocity_enu_m_s;
    let place = s.place;
    (
        [place.latitude_rad, place.longitude_rad, place.height_m].map(|v| s.valid.then_some(v)),
        [north, east, up].map(|v| s.valid.then_some(v as f32)),
    )
}

fn pvt_v1(s: &Solution) -> sbf::Body {
    let (mode, error) = mode(s.valid);
    let (position, velocity_m_s) = position_and_velocity(s);
    sbf::Body::PvtGeodeticV1(sbf::PvtV1 {
        satellites: Some(if s.valid { SATELLITES } else { 0 }),
        error,
        mode,
        position,
        velocity_m_s,
        clock_bias_s: s.valid.then_some(0.0),
        clock_drift: s.valid.then_some(0.0),
        undulation_m: s.valid.then_some(s.undulation_m as f32),
        course_deg: s.valid.then_some(course_deg(s) as f32),
        ..sbf::PvtV1::default()
    })
}

fn pvt(s: &Solution, processing_s: f64) -> sbf::Body {
    let (mode, error) = mode(s.valid);
    let (position, velocity_m_s) = position_and_velocity(s);
    let accuracy_cm = (s.position_sigma_m * 200.0).round() as u16;
    sbf::Body::PvtGeodetic(sbf::Pvt {
        mode,
        error,
        position,
        undulation_m: s.valid.then_some(s.undulation_m as f32),
        velocity_m_s,
        course_deg: s.valid.then_some(course_deg(s) as f32),
        clock_bias_ms: s.valid.then_some(0.0),
        clock_drift_ppm: s.valid.then_some(0.0),
        time_system: Some(0),
        datum: Some(0),
        satellites: Some(if s.valid { SATELLITES } else { 0 }),
        latency_100us: Some((processing_s * 1e4).round() as u16),
        horizontal_accuracy_cm: s.valid.then_some(accuracy_cm),
        vertical_accuracy_cm: s.valid.then_some(accuracy_cm),
        ..sbf::Pvt::default()
    })
}

fn velocity_covariance(s: &Solution) -> sbf::Body {
    let (mode, error) = mode(s.valid);
    let variance = s.velocity_sigma_m_s.powi(2) as f32;
    sbf::Body::VelCovGeodetic(sbf::Covariance {
        mode,
        error,
        elements: std::array::from_fn(|i| s.valid.then_some(if i < 4 { variance } else { 0.0 })),
    })
}

fn euler(a: &AttitudeSolution) -> sbf::Body {
    let [yaw, pitch, roll] = a.yaw_pitch_roll_rad;
    let value = |degrees: f64| a.valid.then_some(degrees as f32);
    sbf::Body::AttEuler(sbf::EulerAttitude {
        satellites: Some(if a.valid { SATELLITES } else { 0 }),
        error: u8::from(!a.valid),
        // Fixed ambiguities, with roll.
        mode: if a.valid { 4 } else { 0 },
        heading_deg: value(heading_deg_from_yaw(yaw)),
        pitch_deg: value(-pitch.to_degrees()),
        roll_deg: value(roll.to_degrees()),
        ..sbf::EulerAttitude::default()
    })
}

fn euler_covariance(a: &AttitudeSolution) -> sbf::Body {
    sbf::Body::AttCovEuler(sbf::AttitudeCovariance {
        error: u8::from(!a.valid),
        variances_deg2: a
            .sigma_rad
            .map(|sigma| a.valid.then_some(sigma.to_degrees().powi(2) as f32)),
        covariances_deg2: [a.valid.then_some(0.0); 3],
        ..sbf::AttitudeCovariance::default()
    })
}

/// Where a point given east, north, up of an origin lies on WGS 84.
pub(crate) fn geodetic_from_enu(origin: &Origin, enu_m: [f64; 3]) -> Geodetic {
    let place = Geodetic {
        latitude_rad: origin.latitude_deg.to_radians(),
        longitude_rad: origin.longitude_deg.to_radians(),
        height_m: origin.height_m,
    };
    let (start, step) = (place.to_ecef(), place.rotate_to_ecef(enu_m));
    // Only a point near the earth's centre has no place.
    Geodetic::from_ecef(std::array::from_fn(|i| start[i] + step[i])).unwrap_or(place)
}
