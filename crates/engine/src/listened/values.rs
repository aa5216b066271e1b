//! Last values of each source.

use std::collections::BTreeMap;

use sample::{Measurement, Sample, Signal, SourceId};

use crate::config::{CanMeaning, Meaning, Source};

/// Most values that are kept.
const VALUES_MAX: usize = 10_000;
/// Most values of a source that are listed.
const LISTED_MAX: usize = 40;

/// Last values, by source and name.
#[derive(Debug, Default)]
pub(super) struct Values(BTreeMap<(SourceId, String), (f64, String)>);

impl Values {
    pub fn push(&mut self, sample: &Sample) {
        let mut put = |name: &str, value: f64, unit: &str| {
            let key = (sample.source, name.to_owned());
            if self.0.len() < VALUES_MAX || self.0.contains_key(&key) {
                self.0.insert(key, (value, unit.to_owned()));
            }
        };
        let mut axes = |name: &str, names: [&str; 3], values: [f64; 3], unit: &str| {
            for (axis, value) in names.into_iter().zip(values) {
                put(&format!("{name} {axis}"), value, unit);
            }
        };
        const XYZ: [&str; 3] = ["x", "y", "z"];
        const ENU: [&str; 3] = ["east", "north", "up"];
        match &sample.measurement {
            Measurement::Imu(imu) => {
                axes("specific force", XYZ, imu.specific_force_m_s2, "m/s^2");
                axes("angular rate", XYZ, imu.angular_rate_rad_s, "rad/s");
            }
            Measurement::GnssPosition(position) => {
                put("latitude", position.latitude_rad.to_degrees(), "degrees");
                put("longitude", position.longitude_rad.to_degrees(), "degrees");
                put("height above the ellipsoid", position.height_m, "m");
            }
            Measurement::GnssVelocity(velocity) => {
                axes("velocity", ENU, velocity.velocity_enu_m_s, "m/s");
            }
            Measurement::GnssAttitude(attitude) => {
                let angles = [attitude.yaw_rad, attitude.pitch_rad, attitude.roll_rad];
                for (name, angle) in ["yaw", "pitch", "roll"].into_iter().zip(angles) {
                    put(name, angle.unwrap_or(f64::NAN), "rad");
                }
            }
            Measurement::Attitude(attitude) => {
                put("yaw", attitude.yaw_rad, "rad");
                put("pitch", attitude.pitch_rad, "rad");
                put("roll", attitude.roll_rad, "rad");
            }
            Measurement::Steer(steer) => put("steering wheel", steer.steering_wheel_rad, "rad"),
            Measurement::GroundSpeed(speed) => put("forward speed", speed.forward_m_s, "m/s"),
            Measurement::Signals(frame) => {
                for Signal { name, value, unit } in &frame.signals {
                    put(&format!("{}.{name}", frame.message), *value, unit);
                }
            }
            Measurement::Control(control) => {
                for Signal { name, value, unit } in &control.values {
                    put(name, *value, unit);
                }
            }
            Measurement::Corner(_)
            | Measurement::WheelSpeed(_)
            | Measurement::HubAcceleration(_) => {}
        }
    }

    /// Values of a source as texts: of a bus the signals of its roles, of others all.
    pub fn of(&self, source: &Source) -> Vec<String> {
        let id = source.spec.id;
        let text = |name: &str| {
            let (value, unit) = self.0.get(&(id, name.to_owned()))?;
            let value = if value.is_nan() {
                "not sent".to_owned()
            } else {
                format!("{} {unit}", rounded(*value))
            };
            Some(format!("{name} = {}", value.trim_end()))
        };
        let texts: Vec<String> = match &source.meaning {
            Meaning::Can(can) => {
                let names = role_signals(can);
                // Roles of the built-in file that nothing sends are no news.
                names.iter().filter_map(|name| text(name)).collect()
            }
            _ => {
                let own = self.0.keys().filter(|(source, _)| *source == id);
                own.filter_map(|(_, name)| text(name)).collect()
            }
        };
        let more = texts.len().saturating_sub(LISTED_MAX);
        let mut listed: Vec<String> = texts.into_iter().take(LISTED_MAX).collect();
        if more > 0 {
            listed.push(format!("and {more} more"));
        }
        listed
    }
}

/// Signals with a role, as `Message.signal`.
fn role_signals(can: &CanMeaning) -> Vec<String> {
    let signal = |role: &crate::config::RoleOf| {
        let message = can
            .databases
            .get(role.database)?
            .messages()
            .get(role.message)?;
        let name = can.names.get(role.database)?.get(role.message)?;
        Some(format!("{name}.{}", message.signals.get(role.signal)?.name))
    };
    can.roles.iter().filter_map(signal).collect()
}

/// A number with six significant digits.
fn rounded(value: f64) -> String {
    let scientific = format!("{value:.5e}");
    let magnitude = scientific
        .split_once('e')
        .and_then(|(_, m)| m.parse::<i32>().ok());
    match magnitude {
        Some(magnitude @ -4..9) => {
            let decimals = usize::try_from(5 - magnitude).unwrap_or(0);
            let text = format!("{value:.decimals$}");
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
        _ => scientific,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_significant_digits() {
        let texts = [
            0.0,
            5.144_444_44,
            -85.483_333_33,
            12.0,
            1_234_567.0,
            1e-7,
            3e12,
        ]
        .map(rounded);
        let expected = [
            "0",
            "5.14444",
            "-85.4833",
            "12",
            "1234567",
            "1.00000e-7",
            "3.00000e12",
        ];
        assert_eq!(texts, expected);
    }
}
