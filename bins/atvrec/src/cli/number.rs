//! Numbers on the command line, each within its range.

use std::ops::RangeInclusive;

/// Duration of a drive or a recording, s: up to a year.
pub fn duration_s(text: &str) -> Result<f64, String> {
    within(text, 0.001..=31_536_000.0, "s")
}

/// Time in a log, s from its start.
pub fn moment_s(text: &str) -> Result<f64, String> {
    within(text, 0.0..=1e9, "s")
}

/// A place and a direction: latitude, longitude and perhaps a heading, deg.
pub fn gate(text: &str) -> Result<report::Gate, String> {
    let mut words = text.split(',');
    let mut next = |limit: f64| {
        words
            .next()
            .map(|word| within(word.trim(), -limit..=limit, "deg"))
    };
    let (latitude, longitude, heading) = (next(90.0), next(180.0), next(360.0));
    match (latitude, longitude, words.next()) {
        (Some(latitude), Some(longitude), None) => Ok(report::Gate {
            latitude_deg: latitude?,
            longitude_deg: longitude?,
            heading_deg: heading.transpose()?,
        }),
        _ => Err(
            "give latitude, longitude and perhaps a heading, as in 32.5967,-85.4903,90".to_owned(),
        ),
    }
}

/// Address and port of a server.
#[cfg(feature = "live")]
pub fn listen_address(text: &str) -> Result<std::net::SocketAddr, String> {
    let error =
        |_| "use an IP address and a port, such as 127.0.0.1:8765 or 0.0.0.0:8765".to_owned();
    text.parse().map_err(error)
}

/// Time for which a command listens to a device, s.
pub fn listen_s(text: &str) -> Result<f64, String> {
    within(text, 0.01..=3600.0, "s")
}

/// Length of a time window, s.
pub fn window_s(text: &str) -> Result<f64, String> {
    within(text, 0.1..=3600.0, "s")
}

/// Corner of a low-pass at the rate of the estimates.
pub fn low_pass_hz(text: &str) -> Result<f64, String> {
    let [least, most] = report::score::LOW_PASS_HZ;
    within(text, least..=most, "Hz")
}

/// A multiple of real time.
pub fn rate(text: &str) -> Result<f64, String> {
    within(text, 0.001..=1e6, "times real time")
}

/// Rate of a table.
pub fn rate_hz(text: &str) -> Result<f64, String> {
    within(text, 0.001..=1e6, "Hz")
}

/// Longest interval between two values that is no gap.
pub fn gap_s(text: &str) -> Result<f64, String> {
    within(text, 1e-6..=3600.0, "s")
}

/// A standard deviation as a fraction of the value.
pub fn fraction(text: &str) -> Result<f64, String> {
    within(text, 1e-6..=1.0, "")
}

/// A small angle or its standard deviation.
pub fn angle_deg(text: &str) -> Result<f64, String> {
    within(text, 0.001..=90.0, "degrees")
}

/// A mass.
pub fn mass_kg(text: &str) -> Result<f64, String> {
    within(text, 0.001..=1e6, "kg")
}

/// A length of a pendulum.
pub fn length_m(text: &str) -> Result<f64, String> {
    within(text, 0.001..=1000.0, "m")
}

/// Compression of a spring from its design length, m.
pub fn compression_m(text: &str) -> Result<f64, String> {
    within(text, -1.0..=1.0, "m")
}

/// Strain, um/m.
pub fn strain_um_m(text: &str) -> Result<f64, String> {
    within(text, 1.0..=100_000.0, "um/m")
}

/// A wheel and the force of the ground on its tyre: forward, left and up, N.
pub fn wheel_load(text: &str) -> Result<(sample::Wheel, [f64; 3]), String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [wheel, forces @ ..] = parts.as_slice() else {
        return Err(WHEEL_LOAD.to_owned());
    };
    let wheel = sample::Wheel::from_abbreviation(wheel)
        .ok_or_else(|| format!("{wheel:?} is no wheel; {WHEEL_LOAD}"))?;
    let [x, y, z] = forces else {
        return Err(WHEEL_LOAD.to_owned());
    };
    let force_n = |text: &str| within(text, -1e6..=1e6, "N");
    Ok((wheel, [force_n(x)?, force_n(y)?, force_n(z)?]))
}

const WHEEL_LOAD: &str =
    "give a wheel (FL, FR, RL or RR) and its forces forward, left and up in N, as in FL,0,800,1800";

/// A stiffness about an axis.
pub fn stiffness_n_m_rad(text: &str) -> Result<f64, String> {
    within(text, 0.001..=1e9, "N m/rad")
}

/// A moment of inertia that may be zero.
pub fn inertia_kg_m2(text: &str) -> Result<f64, String> {
    within(text, 0.0..=1e6, "kg m^2")
}

/// A seed of random numbers.
pub fn seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("it must be an integer from 0 to {}", u64::MAX))
}

/// Parses `text` as a number in `range`. NaN is in no range.
fn within(text: &str, range: RangeInclusive<f64>, unit: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if range.contains(&value) => Ok(value),
        _ => {
            let allowed = format!("{} to {} {unit}", range.start(), range.end());
            Err(format!("it must be a number from {}", allowed.trim_end()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_outside_of_the_range_are_rejected() {
        for wrong in [
            "1e300", "1e-300", "0", "-1", "nan", "inf", "-inf", "", "x", "1e999",
        ] {
            assert!(duration_s(wrong).is_err(), "{wrong}");
            assert!(rate(wrong).is_err(), "{wrong}");
        }
        assert_eq!(duration_s("25"), Ok(25.0));
        assert_eq!(moment_s("0"), Ok(0.0));
        let refused = rate("1e-300").unwrap_err();
        assert!(refused.contains("0.001 to 1000000 times"), "{refused}");
    }
}
