//! The sensors' messages as bytes.

use wire::crossbow440::Scaled;
use wire::geodesy::Geodetic;

use crate::gnss::{AttitudeSolution, Solution};
use crate::{Origin, SeptentrioBlocks};

const CRC_XMODEM_POLY: u16 = 0x1021;

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

fn novatel(id: u16, week: u16, ms: u32, body: &[u8]) -> Vec<u8> {
    let mut message = vec![0xAA, 0x44, 0x12, 28];
    message.extend(id.to_le_bytes());
    message.extend([0, 0x20]);
    message.extend((body.len() as u16).to_le_bytes());
    message.extend([0, 0, 100, 180]);
    message.extend(week.to_le_bytes());
    message.extend(ms.to_le_bytes());
    message.extend([0; 8]);
    message.extend(body);
    let crc = message.iter().fold(0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xEDB8_8320 & 0_u32.wrapping_sub(crc & 1))
        })
    });
    message.extend(crc.to_le_bytes());
    message
}

/// BESTPOS (42).
pub(crate) fn novatel_bestpos(s: &Solution) -> Vec<u8> {
    let mut body = Vec::with_capacity(72);
    let (status, kind) = if s.valid { (0_u32, 16_u32) } else { (1, 0) };
    body.extend(status.to_le_bytes());
    body.extend(kind.to_le_bytes());
    body.extend(s.place.latitude_rad.to_degrees().to_le_bytes());
    body.extend(s.place.longitude_rad.to_degrees().to_le_bytes());
    body.extend((s.place.height_m - s.undulation_m).to_le_bytes());
    body.extend((s.undulation_m as f32).to_le_bytes());
    body.extend(61_u32.to_le_bytes());
    for _ in 0..3 {
        body.extend((s.position_sigma_m as f32).to_le_bytes());
    }
    body.extend([0; 12]);
    body.extend([9, 9, 9, 0, 0, 0, 0, 0]);
    novatel(42, s.week, s.time_of_week_ms, &body)
}

/// BESTVEL (99).
pub(crate) fn novatel_bestvel(s: &Solution) -> Vec<u8> {
    let [east, north, up] = s.velocity_enu_m_s;
    let mut body = Vec::with_capacity(44);
    let (status, kind) = if s.valid { (0_u32, 8_u32) } else { (1, 0) };
    body.extend(status.to_le_bytes());
    body.extend(kind.to_le_bytes());
    body.extend((s.latency_s as f32).to_le_bytes());
    body.extend(0_f32.to_le_bytes());
    body.extend(east.hypot(north).to_le_bytes());
    body.extend(
        east.atan2(north)
            .to_degrees()
            .rem_euclid(360.0)
            .to_le_bytes(),
    );
    body.extend(up.to_le_bytes());
    body.extend(0_f32.to_le_bytes());
    novatel(99, s.week, s.time_of_week_ms, &body)
}

/// TIME (101).
pub(crate) fn novatel_time(week: u16, ms: u32) -> Vec<u8> {
    let mut body = Vec::with_capacity(44);
    body.extend(0_u32.to_le_bytes());
    body.extend(0_f64.to_le_bytes());
    body.extend(20e-9_f64.to_le_bytes());
    body.extend((-15.0_f64).to_le_bytes());
    body.extend(2009_u32.to_le_bytes());
    body.extend([4, 15, 17, 0]);
    body.extend((ms % 60_000).to_le_bytes());
    body.extend(1_u32.to_le_bytes());
    novatel(101, week, ms, &body)
}

fn sbf(id: u16, week: u16, ms: u32, body: &[u8]) -> Vec<u8> {
    let length = (14 + body.len()).next_multiple_of(4);
    let mut checked = id.to_le_bytes().to_vec();
    checked.extend((length as u16).to_le_bytes());
    checked.extend(ms.to_le_bytes());
    checked.extend(week.to_le_bytes());
    checked.extend(body);
    checked.resize(length - 4, 0);
    let crc = crc16(0, &checked);
    [b"$@", crc.to_le_bytes().as_slice(), &checked].concat()
}

/// PVTGeodetic: 5904 of the PolaRx2e or 4007, revision 2.
pub(crate) fn sbf_pvt_geodetic(s: &Solution, blocks: SeptentrioBlocks) -> Vec<u8> {
    let [east, north, up] = s.velocity_enu_m_s;
    let course = east.atan2(north).to_degrees().rem_euclid(360.0) as f32;
    let (mode, error) = if s.valid { (1_u8, 0_u8) } else { (0, 1) };
    let mut body = Vec::with_capacity(82);
    match blocks {
        SeptentrioBlocks::PolaRx2e => body.extend([9, error, mode, 0, 0, 0]),
        SeptentrioBlocks::Current => body.extend([mode, error]),
    }
    for value in [
        s.place.latitude_rad,
        s.place.longitude_rad,
        s.place.height_m,
    ] {
        body.extend(value.to_le_bytes());
    }
    if blocks == SeptentrioBlocks::Current {
        body.extend((s.undulation_m as f32).to_le_bytes());
    }
    for value in [north, east, up] {
        body.extend((value as f32).to_le_bytes());
    }
    match blocks {
        SeptentrioBlocks::PolaRx2e => {
            body.extend(0_f64.to_le_bytes());
            body.extend(0_f32.to_le_bytes());
            body.extend((s.undulation_m as f32).to_le_bytes());
            body.extend([0xFF; 4]);
            body.extend(course.to_le_bytes());
            sbf(5904, s.week, s.time_of_week_ms, &body)
        }
        SeptentrioBlocks::Current => {
            body.extend(course.to_le_bytes());
            body.extend(0_f64.to_le_bytes());
            body.extend(0_f32.to_le_bytes());
            body.extend([0, 0, 9, 0]);
            body.extend([0xFF; 4]);
            body.extend(0_u32.to_le_bytes());
            body.extend([0, 1, 0, 0]);
            body.extend(((s.latency_s * 1e4).round() as u16).to_le_bytes());
            let centimetres = (s.position_sigma_m * 100.0).round() as u16;
            body.extend(centimetres.to_le_bytes());
            body.extend(centimetres.to_le_bytes());
            body.push(0);
            sbf(4007 | 2 << 13, s.week, s.time_of_week_ms, &body)
        }
    }
}

/// VelCovGeodetic (5908).
pub(crate) fn sbf_vel_cov_geodetic(s: &Solution) -> Vec<u8> {
    let mut body = if s.valid { vec![1, 0] } else { vec![0, 1] };
    let variance = s.velocity_sigma_m_s.powi(2);
    for value in [
        variance, variance, variance, variance, 0., 0., 0., 0., 0., 0.,
    ] {
        body.extend((value as f32).to_le_bytes());
    }
    sbf(5908, s.week, s.time_of_week_ms, &body)
}

const DO_NOT_USE: f32 = -2e10;

/// AttEuler (5938).
pub(crate) fn sbf_att_euler(a: &AttitudeSolution) -> Vec<u8> {
    let [yaw, pitch, roll] = a.yaw_pitch_roll_rad.map(f64::to_degrees);
    let mut body = if a.valid { vec![9, 0] } else { vec![0, 1] };
    body.extend(if a.valid { 4_u16 } else { 0 }.to_le_bytes());
    body.extend([0, 0]);
    for value in [(90.0 - yaw).rem_euclid(360.0), -pitch, roll] {
        let value = if a.valid { value as f32 } else { DO_NOT_USE };
        body.extend(value.to_le_bytes());
    }
    for _ in 0..3 {
        body.extend(DO_NOT_USE.to_le_bytes());
    }
    sbf(5938, a.week, a.time_of_week_ms, &body)
}

/// AttCovEuler (5939).
pub(crate) fn sbf_att_cov_euler(a: &AttitudeSolution) -> Vec<u8> {
    let mut body = vec![0, u8::from(!a.valid)];
    for sigma in a.sigma_rad {
        let value = (sigma.to_degrees().powi(2)) as f32;
        body.extend(if a.valid { value } else { DO_NOT_USE }.to_le_bytes());
    }
    body.extend([0; 12]);
    sbf(5939, a.week, a.time_of_week_ms, &body)
}

fn crc16(seed: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(seed, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
            let top = crc & 0x8000 != 0;
            (crc << 1) ^ if top { CRC_XMODEM_POLY } else { 0 }
        })
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
