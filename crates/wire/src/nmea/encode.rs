//! Sentences of the virtual receiver.

use super::{M_S_PER_KNOT, checksum};
use crate::geodesy::{Geodetic, heading_deg_from_yaw};

/// Appends `$`, the text, its checksum and a line end.
pub fn encode_sentence(text: &str, out: &mut Vec<u8>) {
    let sum = checksum(text.as_bytes());
    out.extend(format!("${text}*{sum:02X}\r\n").as_bytes());
}

/// Appends a GGA sentence of an RTK fixed solution. `undulation_m` is the geoid's height.
pub fn encode_gga(
    utc_s: f64,
    place: Geodetic,
    undulation_m: f64,
    satellites: u8,
    out: &mut Vec<u8>,
) {
    let position = position_fields(place);
    let msl = place.height_m - undulation_m;
    let utc = utc_field(utc_s);
    let text = format!(
        "GPGGA,{utc},{position},4,{satellites:02},0.8,{msl:.3},M,{undulation_m:.3},M,1.0,0000"
    );
    encode_sentence(&text, out);
}

/// Appends an RMC sentence; the date is `ddmmyy`.
pub fn encode_rmc(
    utc_s: f64,
    date: &str,
    place: Geodetic,
    velocity_enu_m_s: [f64; 3],
    out: &mut Vec<u8>,
) {
    let [east, north, _] = velocity_enu_m_s;
    let knots = math::hypot(east, north) / M_S_PER_KNOT;
    let course = heading_deg_from_yaw(math::atan2(north, east));
    let (utc, position) = (utc_field(utc_s), position_fields(place));
    encode_sentence(
        &format!("GPRMC,{utc},A,{position},{knots:.4},{course:.3},{date},,,R"),
        out,
    );
}

/// Appends Septentrio's attitude sentence from the project's axes; a fixed solution with roll.
pub fn encode_hrp(
    utc_s: f64,
    date: &str,
    yaw_pitch_roll_rad: [f64; 3],
    sigma_deg: [f64; 3],
    out: &mut Vec<u8>,
) {
    let [yaw, pitch, roll] = yaw_pitch_roll_rad;
    let heading = heading_deg_from_yaw(yaw);
    let (pitch, roll) = (-pitch.to_degrees(), roll.to_degrees());
    let [sh, sr, sp] = sigma_deg;
    let utc = utc_field(utc_s);
    let text = format!(
        "PSSN,HRP,{utc},{date},{heading:.3},{roll:.3},{pitch:.3},{sh:.3},{sr:.3},{sp:.3},12,4,0.0,E"
    );
    encode_sentence(&text, out);
}

fn utc_field(utc_s: f64) -> String {
    let centis = (utc_s * 100.0).round() as i64;
    let centis = centis.rem_euclid(8_640_000);
    let (h, m, s) = (centis / 360_000, centis / 6000 % 60, centis % 6000);
    format!("{h:02}{m:02}{:02}.{:02}", s / 100, s % 100)
}

fn position_fields(place: Geodetic) -> String {
    let split = |rad: f64| {
        let units = (rad.to_degrees().abs() * 60e7).round() as u64;
        (units / 600_000_000, (units % 600_000_000) as f64 / 1e7)
    };
    let (lat, lat_min) = split(place.latitude_rad);
    let (lon, lon_min) = split(place.longitude_rad);
    let ns = if place.latitude_rad < 0.0 { 'S' } else { 'N' };
    let ew = if place.longitude_rad < 0.0 { 'W' } else { 'E' };
    format!("{lat:02}{lat_min:010.7},{ns},{lon:03}{lon_min:010.7},{ew}")
}
