//! Load of the bus and of the serial lines: what the devices send against what a port can carry.

use std::fmt;

use model::sensors::Sensors;

use crate::can_bus::{HUB_FRAME_BYTES, frame_bits};
use crate::emission::Port;
use crate::steering::RODS_FRAME_BYTES;
use crate::tyre_pressure::{TYRE_PRESSURE_BYTES, TYRE_PRESSURE_HZ};
use crate::wheel_angles::WHEEL_ANGLES_BYTES;
use crate::{Options, SeptentrioBlocks, SimError, VelocityReceiver};

/// Greatest part of a CAN bus's bit rate that is used: beyond it, frames of low priority wait for
/// several milliseconds.
const CAN_MOST: f64 = 0.7;
/// Greatest part of a serial line's speed that is used: a message must have left before the next one.
const SERIAL_MOST: f64 = 0.9;
/// Bits of a byte on a serial line: start, eight data bits, stop.
const BYTE_BITS: f64 = 10.0;

/// Load of one port.
#[derive(Clone, Debug, PartialEq)]
pub struct PortLoad {
    /// The port.
    pub port: Port,
    /// What it can carry, bit/s.
    pub bit_rate: u32,
    /// What is sent.
    pub parts: Vec<LoadPart>,
}

/// One kind of message on a port.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadPart {
    /// Field of the sensors file (of the options, for controllers) that has the rate.
    pub rate_field: &'static str,
    /// Messages at each instant.
    pub messages: f64,
    /// Instants a second.
    pub rate_hz: f64,
    /// Bits of each message.
    pub bits: f64,
}

impl PortLoad {
    /// What is sent, bit/s.
    #[must_use]
    pub fn bits_per_s(&self) -> f64 {
        let parts = self.parts.iter();
        parts.map(|p| p.messages * p.rate_hz * p.bits).sum()
    }

    /// Part of the bit rate that is used.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.bits_per_s() / f64::from(self.bit_rate.max(1))
    }

    /// Greatest part of the bit rate that may be used.
    #[must_use]
    pub fn share_max(&self) -> f64 {
        if self.port.is_can() {
            CAN_MOST
        } else {
            SERIAL_MOST
        }
    }

    /// Field that has the bit rate.
    fn bit_rate_field(&self) -> &'static str {
        match self.port {
            Port::Imu => "imu_baud of the options",
            Port::Novatel => "novatel_baud of the options",
            Port::Septentrio => "septentrio_baud of the options",
            Port::Can0 => "bus.bit_rate of the sensors file",
            Port::Steering | Port::Throttle | Port::Brake => "controller_baud of the options",
        }
    }

    fn check(&self) -> Result<(), SimError> {
        // Rates that make no sense are reported where they are used.
        if self.share() > self.share_max() {
            Err(SimError::Overloaded {
                arithmetic: self.to_string(),
                most_percent: 100.0 * self.share_max(),
                rate_fields: (self.parts.iter().map(|part| part.rate_field))
                    .collect::<Vec<_>>()
                    .join(" or "),
                bit_rate_field: self.bit_rate_field(),
                needed: (self.bits_per_s() / self.share_max()).ceil(),
            })
        } else {
            Ok(())
        }
    }
}

impl fmt::Display for PortLoad {
    /// The arithmetic: parts, sum, and the share of the bit rate.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.port.name())?;
        for (number, part) in self.parts.iter().enumerate() {
            if number > 0 {
                write!(f, " + ")?;
            }
            if part.messages > 1.0 {
                write!(f, "{} × ", part.messages)?;
            }
            let (rate, bits, field) = (part.rate_hz, part.bits, part.rate_field);
            write!(f, "{rate} Hz ({field}) × {bits:.1} bit")?;
        }
        let (sum, share) = (self.bits_per_s(), 100.0 * self.share());
        write!(
            f,
            " = {sum:.0} bit/s, {share:.1} % of {} bit/s",
            self.bit_rate
        )
    }
}

/// Load of every port.
#[must_use]
pub fn port_loads(sensors: &Sensors, options: &Options) -> Vec<PortLoad> {
    let serial = |port, bit_rate, rate_field, bytes: f64, rate_hz| PortLoad {
        port,
        bit_rate,
        parts: vec![LoadPart {
            rate_field,
            messages: 1.0,
            rate_hz,
            bits: BYTE_BITS * bytes,
        }],
    };
    let septentrio_bytes = match options.septentrio_blocks {
        SeptentrioBlocks::PolaRx2e => 224.0,
        SeptentrioBlocks::Current => 240.0,
    };
    let mut loads = vec![
        serial(
            Port::Imu,
            options.imu_baud,
            "imu.rate_hz",
            options.inertial_unit.message_bytes(),
            sensors.imu.rate_hz,
        ),
        serial(
            Port::Novatel,
            options.novatel_baud,
            "gnss_velocity.rate_hz",
            match options.velocity_receiver {
                VelocityReceiver::Novatel => 180.0,
                VelocityReceiver::Ublox => 100.0,
            },
            sensors.gnss_velocity.rate_hz,
        ),
        serial(
            Port::Septentrio,
            options.septentrio_baud,
            "gnss_attitude.rate_hz",
            septentrio_bytes,
            sensors.gnss_attitude.rate_hz,
        ),
        can_load(sensors, options),
    ];
    for port in [Port::Steering, Port::Throttle, Port::Brake] {
        let (baud, rate_hz) = (options.controller_baud, options.controller_rate_hz);
        // A count of four figures with sign and line end.
        loads.push(serial(port, baud, "controller_rate_hz", 7.0, rate_hz));
    }
    loads
}

fn can_load(sensors: &Sensors, options: &Options) -> PortLoad {
    let strain_hz = sensors.strain.rate_hz;
    let deflection_hz = sensors.deflection.rate_hz;
    // Deflections of a strain box's own instants need no frame of their own.
    let is_whole = |ratio: f64| (ratio - ratio.round()).abs() < 1e-9 && ratio > 0.5;
    let shared_hz = if is_whole(strain_hz / deflection_hz) {
        deflection_hz
    } else if is_whole(deflection_hz / strain_hz) {
        strain_hz
    } else {
        0.0
    };
    let part = |rate_field, messages, rate_hz, bytes| LoadPart {
        rate_field,
        messages,
        rate_hz,
        bits: frame_bits(bytes),
    };
    let mut parts = vec![part("strain.rate_hz", 8.0, strain_hz, 8)];
    if deflection_hz > shared_hz {
        let own_hz = deflection_hz - shared_hz;
        parts.push(part("deflection.rate_hz", 4.0, own_hz, 8));
    }
    if let Some(encoder) = &sensors.steer {
        parts.push(part("steer.rate_hz", 1.0, encoder.rate_hz, 8));
    } else if let Some(pots) = &sensors.steer_potentiometers {
        let field = "steer_potentiometers.rate_hz";
        parts.push(part(field, 1.0, pots.rate_hz, RODS_FRAME_BYTES));
    }
    if let Some(angles) = &sensors.wheel_angles {
        let field = "wheel_angles.rate_hz";
        parts.push(part(field, 1.0, angles.rate_hz, WHEEL_ANGLES_BYTES));
    }
    let wheel_hz = sensors.wheel_speed.rate_hz;
    parts.push(part("wheel_speed.rate_hz", 1.0, wheel_hz, 8));
    if options.tyre_pressure_pa.is_some() {
        let field = "tyre_pressure_pa of the options";
        parts.push(part(field, 1.0, TYRE_PRESSURE_HZ, TYRE_PRESSURE_BYTES));
    }
    if let Some(hub) = &sensors.hub_acceleration {
        let field = "hub_acceleration.rate_hz";
        parts.push(part(field, 4.0, hub.rate_hz, HUB_FRAME_BYTES));
    }
    PortLoad {
        port: Port::Can0,
        bit_rate: options.can_bit_rate(sensors),
        parts,
    }
}

/// Refuses what a bus or a line cannot carry.
pub(crate) fn check_loads(sensors: &Sensors, options: &Options) -> Result<(), SimError> {
    port_loads(sensors, options)
        .iter()
        .try_for_each(PortLoad::check)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_that_ship_load_their_bus_as_their_files_say() {
        for name in Sensors::builtin_names() {
            let sensors = Sensors::builtin(name).unwrap();
            for load in port_loads(&sensors, &Options::default()) {
                assert!(load.share() <= 0.7, "{name}: {load}");
                if load.port.is_can() {
                    let told = format!("# Load: {:.1} % of", 100.0 * load.share());
                    let text = Sensors::builtin_text(name).unwrap();
                    assert!(text.contains(&told), "{name}: {load}");
                }
            }
        }
    }

    #[test]
    fn an_overloaded_port_is_refused_with_the_arithmetic() {
        let mut sensors = Sensors::builtin("thesis-10bit").unwrap();
        sensors.imu.rate_hz = 200.0;
        let told = check_loads(&sensors, &Options::default())
            .unwrap_err()
            .to_string();
        for part in [
            "imu: 200 Hz (imu.rate_hz) × 310.0 bit = 62000 bit/s, 107.6 % of 57600 bit/s",
            "imu_baud of the options to at least 68889",
        ] {
            assert!(told.contains(part), "{told}");
        }
        let fast = "full-bridge-16bit-bending-500hz-hub";
        let mut sensors = Sensors::builtin(fast).unwrap();
        assert!(check_loads(&sensors, &Options::default()).is_ok());
        sensors.bus.bit_rate = 500_000;
        let told = check_loads(&sensors, &Options::default())
            .unwrap_err()
            .to_string();
        for part in ["8 × 500 Hz (strain.rate_hz) × 122.1 bit", "at least 792315"] {
            assert!(told.contains(part), "{told}");
        }
    }
}
