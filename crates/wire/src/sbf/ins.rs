//! Blocks of receivers with an inertial unit (mosaic-X5 and AsteRx SBi3 reference guides): INSNavCart,
//! INSNavGeod and ExtSensorMeas.

use crate::codec::Codec;

/// Most readings of one ExtSensorMeas block that are decoded.
pub const SENSORS_MAX: usize = 8;
/// Bytes of a reading after its description.
const READING: usize = 24;

/// INSNavCart and INSNavGeod: position, velocity and attitude of satellites and inertial unit together.
/// The parts that `parts` does not announce are absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InsNavigation {
    /// As [`Pvt::mode`](super::Pvt::mode), of the last solution of the satellites.
    pub mode: u8,
    /// 0 without an error.
    pub error: u8,
    /// Flags of the integration.
    pub info: u16,
    /// Age of the last solution of the satellites, 0.01 s.
    pub gnss_age_cs: Option<u16>,
    /// X, Y, Z in m; or latitude, longitude in rad and height above the ellipsoid in m.
    pub position: [Option<f64>; 3],
    /// Height of the geoid above the ellipsoid, m (geodetic block only).
    pub undulation_m: Option<f32>,
    /// Accuracy, cm.
    pub accuracy_cm: Option<u16>,
    /// From the time tag to the sending of the block, 0.1 ms.
    pub latency_100us: Option<u16>,
    /// Datum; 0 is WGS 84.
    pub datum: Option<u8>,
    /// Reserved.
    pub reserved: u8,
    /// Which parts follow: bits 0 to 7 in the order of the members below.
    pub parts: u16,
    /// Standard deviations of X, Y, Z; or of latitude, longitude, height, m.
    pub position_sigma_m: [Option<f32>; 3],
    /// Heading (clockwise from true north), pitch (nose up), roll (right side down), degrees.
    pub attitude_deg: [Option<f32>; 3],
    /// Their standard deviations, degrees.
    pub attitude_sigma_deg: [Option<f32>; 3],
    /// Velocity along X, Y, Z; or east, north, up, m/s.
    pub velocity_m_s: [Option<f32>; 3],
    /// Its standard deviations, m/s.
    pub velocity_sigma_m_s: [Option<f32>; 3],
    /// Covariances of position, attitude and velocity.
    pub covariances: [[Option<f32>; 3]; 3],
}

impl InsNavigation {
    pub(super) fn walk(&mut self, c: &mut impl Codec, geodetic: bool) -> Option<()> {
        c.u8(&mut self.mode)?;
        c.u8(&mut self.error)?;
        c.u16(&mut self.info)?;
        c.optional_u16(&mut self.gnss_age_cs)?;
        self.position
            .iter_mut()
            .try_for_each(|v| c.optional_f64(v))?;
        if geodetic {
            c.optional_f32(&mut self.undulation_m)?;
        }
        c.optional_u16(&mut self.accuracy_cm)?;
        c.optional_u16(&mut self.latency_100us)?;
        c.optional_u8(&mut self.datum)?;
        c.u8(&mut self.reserved)?;
        c.u16(&mut self.parts)?;
        let [position, attitude, velocity] = &mut self.covariances;
        let parts = [
            &mut self.position_sigma_m,
            &mut self.attitude_deg,
            &mut self.attitude_sigma_deg,
            &mut self.velocity_m_s,
            &mut self.velocity_sigma_m_s,
            position,
            attitude,
            velocity,
        ];
        for (bit, part) in parts.into_iter().enumerate() {
            if self.parts >> bit & 1 != 0 {
                part.iter_mut().try_for_each(|v| c.optional_f32(v))?;
            }
        }
        Some(())
    }
}

/// A reading of ExtSensorMeas.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExternalSensor {
    /// Interface of the sensor.
    pub source: u8,
    /// Model of the sensor.
    pub model: u8,
    /// 0 acceleration, m/s^2; 1 angular rate, degrees/s; 2 velocity; 3 temperature; 20 zero velocity.
    pub kind: u8,
    /// Bit 0: the reading is valid.
    pub info: u8,
    /// Values along the axes of the sensor, of kinds 0 and 1.
    pub values: [Option<f64>; 3],
    /// Temperature of kind 3, 0.01 degrees Celsius.
    pub temperature_cc: i16,
}

impl ExternalSensor {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u8(&mut self.source)?;
        c.u8(&mut self.model)?;
        c.u8(&mut self.kind)?;
        c.u8(&mut self.info)?;
        if self.kind == 3 {
            let mut raw = self.temperature_cc.cast_unsigned();
            c.u16(&mut raw)?;
            self.temperature_cc = raw.cast_signed();
            return skip(c, READING - 2);
        }
        self.values.iter_mut().try_for_each(|v| c.optional_f64(v))
    }
}

/// Walks the readings of a block, of which `count` are used.
pub(super) fn walk_sensors(
    c: &mut impl Codec,
    count: &mut u8,
    sensors: &mut [ExternalSensor; SENSORS_MAX],
) -> Option<()> {
    c.u8(count)?;
    let mut length = (READING + 4) as u8;
    c.u8(&mut length)?;
    if usize::from(length) < READING + 4 {
        return None;
    }
    *count = (*count).min(SENSORS_MAX as u8);
    for sensor in &mut sensors[..usize::from(*count)] {
        sensor.walk(c)?;
        skip(c, usize::from(length) - READING - 4)?;
    }
    Some(())
}

fn skip(c: &mut impl Codec, count: usize) -> Option<()> {
    (0..count).try_for_each(|_| c.u8(&mut 0))
}
