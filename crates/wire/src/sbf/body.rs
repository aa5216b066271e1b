use super::ins::{ExternalSensor, InsNavigation, SENSORS_MAX, walk_sensors};
use crate::codec::Codec;

/// PVTCartesian and PVTGeodetic of the current generation (4006, 4007).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pvt {
    /// Bits 0 to 3: 0 none, 1 stand-alone, 2 differential, 3 fixed location, 4 RTK fixed, 5 RTK
    /// float, 6 SBAS, 7 and 8 moving base fixed and float, 10 PPP. Bit 7: two dimensions only.
    pub mode: u8,
    /// 0 without an error.
    pub error: u8,
    /// X, Y, Z in m; or latitude, longitude in rad and height above the ellipsoid in m.
    pub position: [Option<f64>; 3],
    /// Height of the geoid above the ellipsoid, m.
    pub undulation_m: Option<f32>,
    /// Along X, Y, Z; or north, east, up, m/s.
    pub velocity_m_s: [Option<f32>; 3],
    /// Course over ground, degrees.
    pub course_deg: Option<f32>,
    /// Receiver clock bias, ms.
    pub clock_bias_ms: Option<f64>,
    /// Receiver clock drift, ppm.
    pub clock_drift_ppm: Option<f32>,
    /// Time system; 0 is GPS.
    pub time_system: Option<u8>,
    /// Datum; 0 is WGS 84.
    pub datum: Option<u8>,
    /// Satellites in the solution.
    pub satellites: Option<u8>,
    /// Corrections that were applied.
    pub corrections: u8,
    /// Base station.
    pub reference_id: Option<u16>,
    /// Mean age of the corrections, 0.01 s.
    pub correction_age_cs: Option<u16>,
    /// Signals in use.
    pub signal_info: u32,
    /// Integrity.
    pub alert: u8,
    /// Base stations (revision 1).
    pub bases: u8,
    /// Precise point positioning (revision 1).
    pub ppp_info: u16,
    /// From the time tag to the sending of the block, 0.1 ms (revision 2). The values themselves
    /// are valid at the time tag.
    pub latency_100us: Option<u16>,
    /// Horizontal accuracy, twice the root mean square, cm (revision 2).
    pub horizontal_accuracy_cm: Option<u16>,
    /// Vertical accuracy, two sigma, cm (revision 2).
    pub vertical_accuracy_cm: Option<u16>,
    /// Antenna reference flags (revision 2).
    pub miscellaneous: u8,
}

/// PVTCartesian and PVTGeodetic of the PolaRx2e (5903, 5904).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PvtV1 {
    /// Satellites in the solution.
    pub satellites: Option<u8>,
    /// 0 without an error.
    pub error: u8,
    /// As [`Pvt::mode`].
    pub mode: u8,
    /// Time system.
    pub system: u8,
    /// Further flags.
    pub info: u8,
    /// SBAS satellite in use.
    pub sbas_prn: u8,
    /// X, Y, Z in m; or latitude, longitude in rad and height above the ellipsoid in m.
    pub position: [Option<f64>; 3],
    /// Along X, Y, Z; or north, east, up, m/s.
    pub velocity_m_s: [Option<f32>; 3],
    /// Receiver clock bias, s.
    pub clock_bias_s: Option<f64>,
    /// Receiver clock drift, s/s.
    pub clock_drift: Option<f32>,
    /// Height of the geoid above the ellipsoid, m (geodetic block only).
    pub undulation_m: Option<f32>,
    /// Mean age of the corrections, 0.01 s.
    pub correction_age_cs: Option<u16>,
    /// Base station.
    pub reference_id: Option<u16>,
    /// Course over ground, degrees.
    pub course_deg: Option<f32>,
}

/// The four covariance blocks (5905 to 5908).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Covariance {
    /// As [`Pvt::mode`].
    pub mode: u8,
    /// 0 without an error.
    pub error: u8,
    /// xx, yy, zz, bb, xy, xz, xb, yz, yb, zb with b the clock; x, y, z are the block's axes:
    /// earth-fixed, or north, east, up. m^2 or (m/s)^2.
    pub elements: [Option<f32>; 10],
}

/// AttEuler (5938).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EulerAttitude {
    /// Satellites in the solution.
    pub satellites: Option<u8>,
    /// 0 without an error.
    pub error: u8,
    /// 0 none; 1, 2 heading and pitch, float and fixed; 3, 4 with roll.
    pub mode: u16,
    /// Reserved.
    pub reserved: u16,
    /// Clockwise from true north, degrees.
    pub heading_deg: Option<f32>,
    /// Nose up positive, degrees.
    pub pitch_deg: Option<f32>,
    /// Right side down positive, degrees.
    pub roll_deg: Option<f32>,
    /// Three angular rates, degrees/s, in the order sent: the guides disagree on their meaning.
    pub rates_deg_s: [Option<f32>; 3],
}

/// AttCovEuler (5939).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AttitudeCovariance {
    /// Reserved.
    pub reserved: u8,
    /// 0 without an error.
    pub error: u8,
    /// Variances of heading, pitch, roll, degrees^2.
    pub variances_deg2: [Option<f32>; 3],
    /// Covariances heading-pitch, heading-roll, pitch-roll, degrees^2; an old short form of the
    /// block has none.
    pub covariances_deg2: [Option<f32>; 3],
}

/// The content of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Body {
    /// PVT in earth-fixed axes, current generation.
    PvtCartesian(Pvt),
    /// Geodetic PVT, current generation.
    PvtGeodetic(Pvt),
    /// PVT in earth-fixed axes, PolaRx2e.
    PvtCartesianV1(PvtV1),
    /// Geodetic PVT, PolaRx2e.
    PvtGeodeticV1(PvtV1),
    /// Position covariance, earth-fixed axes.
    PosCovCartesian(Covariance),
    /// Position covariance, north, east, up.
    PosCovGeodetic(Covariance),
    /// Velocity covariance, earth-fixed axes.
    VelCovCartesian(Covariance),
    /// Velocity covariance, north, east, up.
    VelCovGeodetic(Covariance),
    /// Attitude.
    AttEuler(EulerAttitude),
    /// Attitude covariance.
    AttCovEuler(AttitudeCovariance),
    /// Satellites and inertial unit, earth-fixed axes.
    InsNavCart(InsNavigation),
    /// Satellites and inertial unit, geodetic.
    InsNavGeod(InsNavigation),
    /// Readings of the inertial unit.
    ExtSensorMeas {
        /// How many readings there are.
        count: u8,
        /// The readings.
        sensors: [ExternalSensor; SENSORS_MAX],
    },
    /// UTC year (two digits), month, day, hour, minute, second; leap seconds; sync level.
    ReceiverTime {
        /// Year to second; -128 when not known.
        utc: [i8; 6],
        /// GPS minus UTC, s; -128 when not known.
        leap_seconds: i8,
        /// Bits: week known, time of week known, fine time.
        sync_level: u8,
    },
    /// Offset of the pulse per second.
    XppsOffset {
        /// Seconds since the last synchronisation.
        sync_age: u8,
        /// 1 GPS, 2 UTC, 3 receiver.
        time_scale: u8,
        /// True minus sent pulse, ns.
        offset_ns: f32,
    },
}

impl Body {
    pub(super) fn empty(number: u16) -> Option<Self> {
        Some(match number {
            4050 => Self::ExtSensorMeas {
                count: 0,
                sensors: [ExternalSensor::default(); SENSORS_MAX],
            },
            4225 => Self::InsNavCart(InsNavigation::default()),
            4226 => Self::InsNavGeod(InsNavigation::default()),
            4006 => Self::PvtCartesian(Pvt::default()),
            4007 => Self::PvtGeodetic(Pvt::default()),
            5903 => Self::PvtCartesianV1(PvtV1::default()),
            5904 => Self::PvtGeodeticV1(PvtV1::default()),
            5905 => Self::PosCovCartesian(Covariance::default()),
            5906 => Self::PosCovGeodetic(Covariance::default()),
            5907 => Self::VelCovCartesian(Covariance::default()),
            5908 => Self::VelCovGeodetic(Covariance::default()),
            5911 => Self::XppsOffset {
                sync_age: 0,
                time_scale: 0,
                offset_ns: 0.0,
            },
            5914 => Self::ReceiverTime {
                utc: [-128; 6],
                leap_seconds: -128,
                sync_level: 0,
            },
            5938 => Self::AttEuler(EulerAttitude::default()),
            5939 => Self::AttCovEuler(AttitudeCovariance::default()),
            _ => return None,
        })
    }

    pub(super) fn walk(&mut self, c: &mut impl Codec, revision: u8) -> Option<()> {
        match self {
            Self::PvtCartesian(b) | Self::PvtGeodetic(b) => b.walk(c, revision),
            Self::PvtCartesianV1(b) => b.walk(c, false),
            Self::PvtGeodeticV1(b) => b.walk(c, true),
            Self::PosCovCartesian(b)
            | Self::PosCovGeodetic(b)
            | Self::VelCovCartesian(b)
            | Self::VelCovGeodetic(b) => b.walk(c),
            Self::InsNavCart(b) => b.walk(c, false),
            Self::InsNavGeod(b) => b.walk(c, true),
            Self::ExtSensorMeas { count, sensors } => walk_sensors(c, count, sensors),
            Self::AttEuler(b) => b.walk(c),
            Self::AttCovEuler(b) => b.walk(c),
            Self::ReceiverTime {
                utc,
                leap_seconds,
                sync_level,
            } => {
                utc.iter_mut().try_for_each(|v| signed(c, v))?;
                signed(c, leap_seconds)?;
                c.u8(sync_level)
            }
            Self::XppsOffset {
                sync_age,
                time_scale,
                offset_ns,
            } => {
                c.u8(sync_age)?;
                c.u8(time_scale)?;
                c.f32(offset_ns, 3)
            }
        }
    }
}

fn signed(c: &mut impl Codec, value: &mut i8) -> Option<()> {
    let mut raw = value.cast_unsigned();
    c.u8(&mut raw)?;
    *value = raw.cast_signed();
    Some(())
}

impl Pvt {
    fn walk(&mut self, c: &mut impl Codec, revision: u8) -> Option<()> {
        c.u8(&mut self.mode)?;
        c.u8(&mut self.error)?;
        self.position
            .iter_mut()
            .try_for_each(|v| c.optional_f64(v))?;
        c.optional_f32(&mut self.undulation_m)?;
        self.velocity_m_s
            .iter_mut()
            .try_for_each(|v| c.optional_f32(v))?;
        c.optional_f32(&mut self.course_deg)?;
        c.optional_f64(&mut self.clock_bias_ms)?;
        c.optional_f32(&mut self.clock_drift_ppm)?;
        c.optional_u8(&mut self.time_system)?;
        c.optional_u8(&mut self.datum)?;
        c.optional_u8(&mut self.satellites)?;
        c.u8(&mut self.corrections)?;
        c.optional_u16(&mut self.reference_id)?;
        c.optional_u16(&mut self.correction_age_cs)?;
        c.u32(&mut self.signal_info)?;
        c.u8(&mut self.alert)?;
        if revision >= 1 {
            c.u8(&mut self.bases)?;
            c.u16(&mut self.ppp_info)?;
        }
        if revision >= 2 {
            c.optional_u16(&mut self.latency_100us)?;
            c.optional_u16(&mut self.horizontal_accuracy_cm)?;
            c.optional_u16(&mut self.vertical_accuracy_cm)?;
            c.u8(&mut self.miscellaneous)?;
        }
        Some(())
    }
}

impl PvtV1 {
    fn walk(&mut self, c: &mut impl Codec, geodetic: bool) -> Option<()> {
        c.optional_u8(&mut self.satellites)?;
        c.u8(&mut self.error)?;
        c.u8(&mut self.mode)?;
        c.u8(&mut self.system)?;
        c.u8(&mut self.info)?;
        c.u8(&mut self.sbas_prn)?;
        self.position
            .iter_mut()
            .try_for_each(|v| c.optional_f64(v))?;
        self.velocity_m_s
            .iter_mut()
            .try_for_each(|v| c.optional_f32(v))?;
        c.optional_f64(&mut self.clock_bias_s)?;
        c.optional_f32(&mut self.clock_drift)?;
        if geodetic {
            c.optional_f32(&mut self.undulation_m)?;
        }
        c.optional_u16(&mut self.correction_age_cs)?;
        c.optional_u16(&mut self.reference_id)?;
        c.optional_f32(&mut self.course_deg)
    }
}

impl Covariance {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u8(&mut self.mode)?;
        c.u8(&mut self.error)?;
        self.elements.iter_mut().try_for_each(|v| c.optional_f32(v))
    }
}

impl EulerAttitude {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.optional_u8(&mut self.satellites)?;
        c.u8(&mut self.error)?;
        c.u16(&mut self.mode)?;
        c.u16(&mut self.reserved)?;
        c.optional_f32(&mut self.heading_deg)?;
        c.optional_f32(&mut self.pitch_deg)?;
        c.optional_f32(&mut self.roll_deg)?;
        self.rates_deg_s
            .iter_mut()
            .try_for_each(|v| c.optional_f32(v))
    }
}

impl AttitudeCovariance {
    fn walk(&mut self, c: &mut impl Codec) -> Option<()> {
        c.u8(&mut self.reserved)?;
        c.u8(&mut self.error)?;
        self.variances_deg2
            .iter_mut()
            .try_for_each(|v| c.optional_f32(v))?;
        // The short form ends here; in the long form all three are there.
        let _ = self
            .covariances_deg2
            .iter_mut()
            .try_for_each(|v| c.optional_f32(v));
        Some(())
    }
}
