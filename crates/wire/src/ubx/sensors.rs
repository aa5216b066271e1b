//! ESF-MEAS and ESF-RAW: readings of inertial unit and wheels, of 24 bits each.

use crate::codec::{BinaryReader, Codec};

/// Most readings of one message that are decoded: ten instants of seven sensors.
pub const READINGS_MAX: usize = 70;

/// One reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// Its sensor: 5, 13, 14 gyros z, y, x; 12 their temperature; 16, 17, 18 accelerometers x, y, z;
    /// 6 to 9 wheel ticks FL, FR, RL, RR; 10 single tick; 11 speed.
    pub sensor: u8,
    /// Its 24 bits.
    pub bits: u32,
    /// Time of the sensor that it belongs to (ESF-RAW), in units of the receiver.
    pub time: u32,
}

impl Reading {
    /// Name, value and unit; `None` for sensors without a scale.
    #[must_use]
    pub fn value(&self) -> Option<(&'static str, f64, &'static str)> {
        let signed = f64::from((self.bits << 8).cast_signed() >> 8);
        let rate = (signed / 4096.0).to_radians();
        // The highest bit of ticks is the direction.
        let ticks = f64::from(self.bits & 0x7F_FFFF);
        let ticks = if self.bits & 0x80_0000 == 0 {
            ticks
        } else {
            -ticks
        };
        Some(match self.sensor {
            5 => ("gyro_z", rate, "rad/s"),
            13 => ("gyro_y", rate, "rad/s"),
            14 => ("gyro_x", rate, "rad/s"),
            12 => ("gyro_temperature", signed * 0.01, "degC"),
            16 => ("accelerometer_x", signed / 1024.0, "m/s^2"),
            17 => ("accelerometer_y", signed / 1024.0, "m/s^2"),
            18 => ("accelerometer_z", signed / 1024.0, "m/s^2"),
            6 => ("wheel_ticks_fl", ticks, "1"),
            7 => ("wheel_ticks_fr", ticks, "1"),
            8 => ("wheel_ticks_rl", ticks, "1"),
            9 => ("wheel_ticks_rr", ticks, "1"),
            10 => ("wheel_ticks", ticks, "1"),
            11 => ("speed", signed * 1e-3, "m/s"),
            _ => return None,
        })
    }
}

/// The readings of one message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Readings {
    /// Time of the sensors (ESF-MEAS), in units of the receiver.
    pub time: u32,
    /// Flags (ESF-MEAS): bit 3, a calibration time follows the readings.
    pub flags: u16,
    /// Who sent the readings (ESF-MEAS).
    pub provider: u16,
    /// How many readings there are.
    pub count: usize,
    /// The readings.
    pub all: [Reading; READINGS_MAX],
    /// Calibration time (ESF-MEAS).
    pub calibration_time: u32,
}

impl Default for Readings {
    fn default() -> Self {
        Self {
            time: 0,
            flags: 0,
            provider: 0,
            count: 0,
            all: [Reading::default(); READINGS_MAX],
            calibration_time: 0,
        }
    }
}

impl Readings {
    /// The readings that there are.
    pub fn iter(&self) -> std::slice::Iter<'_, Reading> {
        self.all[..self.count.min(READINGS_MAX)].iter()
    }

    fn push(&mut self, word: u32, time: u32) -> Option<()> {
        let slot = self.all.get_mut(self.count)?;
        *slot = Reading {
            sensor: (word >> 24 & 0x3F) as u8,
            bits: word & 0xFF_FFFF,
            time,
        };
        self.count += 1;
        Some(())
    }

    /// Bits 11 to 15 of the flags are the number of readings; early receivers leave them at zero.
    pub(super) fn measured(reader: &mut BinaryReader<'_>) -> Option<Self> {
        let mut readings = Self::default();
        reader.u32(&mut readings.time)?;
        reader.u16(&mut readings.flags)?;
        reader.u16(&mut readings.provider)?;
        let words = reader.0.len() / 4;
        let calibrated = readings.flags & 1 << 3 != 0;
        let stated = usize::from(readings.flags >> 11);
        let count = if stated > 0 {
            stated
        } else {
            words.checked_sub(usize::from(calibrated))?
        };
        let mut word = 0;
        for _ in 0..count {
            reader.u32(&mut word)?;
            readings.push(word, readings.time)?;
        }
        if calibrated {
            reader.u32(&mut readings.calibration_time)?;
        }
        Some(readings)
    }

    pub(super) fn raw(reader: &mut BinaryReader<'_>) -> Option<Self> {
        let mut readings = Self::default();
        reader.u32(&mut 0)?;
        while !reader.0.is_empty() {
            let (mut word, mut time) = (0, 0);
            reader.u32(&mut word)?;
            reader.u32(&mut time)?;
            readings.push(word, time)?;
        }
        Some(readings)
    }

    pub(super) fn write_measured(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u32(&mut self.time)?;
        let mut flags = self.flags & 0x07FF | (self.count as u16) << 11;
        c.u16(&mut flags)?;
        c.u16(&mut self.provider)?;
        for reading in self.iter() {
            c.u32(&mut reading.word())?;
        }
        match self.flags & 1 << 3 {
            0 => Some(()),
            _ => c.u32(&mut self.calibration_time),
        }
    }

    pub(super) fn write_raw(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u32(&mut 0)?;
        for reading in self.iter() {
            c.u32(&mut reading.word())?;
            c.u32(&mut { reading.time })?;
        }
        Some(())
    }
}

impl Reading {
    fn word(self) -> u32 {
        u32::from(self.sensor) << 24 | self.bits & 0xFF_FFFF
    }
}
