use model::sensors::Sensors;
use model::steering::Toe;
use serde::{Deserialize, Serialize};

use crate::{Faults, HiddenErrors};

/// Options of the virtual vehicle beside vehicle and sensors: where and when it drives, and how
/// its devices deliver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Where the motion's origin lies.
    pub origin: Origin,
    /// GPS time of the motion's start.
    pub gps_start: GpsStart,
    /// Which generation of blocks the multi-antenna receiver sends.
    pub septentrio_blocks: SeptentrioBlocks,
    /// Protocol of the velocity receiver.
    pub velocity_receiver: VelocityReceiver,
    /// Protocol of the inertial unit.
    pub inertial_unit: InertialUnit,
    /// Serial line speed of the inertial unit, bit/s.
    pub imu_baud: u32,
    /// Serial line speed of the velocity receiver, bit/s.
    pub novatel_baud: u32,
    /// Serial line speed of the multi-antenna receiver, bit/s.
    pub septentrio_baud: u32,
    /// Serial line speed of the steering, throttle and brake controllers, bit/s.
    pub controller_baud: u32,
    /// Readings a second of each of these controllers.
    pub controller_rate_hz: f64,
    /// Bit rate of the CAN bus, bit/s; absent: the sensors file's.
    pub can_bit_rate: Option<u32>,
    /// From a solution's time tag to the message's first byte, velocity receiver, s.
    pub novatel_processing_s: f64,
    /// From a solution's time tag to the message's first byte, multi-antenna receiver, s.
    pub septentrio_processing_s: f64,
    /// Mean of the exponentially distributed extra delay of each receiver's messages, s.
    pub gnss_jitter_s: f64,
    /// How fast the inertial unit's clock runs, parts of a million above true.
    pub imu_clock_ppm: f64,
    /// Correlation time of the position error, s.
    pub position_correlation_s: f64,
    /// Toe compliance and play of the front wheels, instead of those of the vehicle file.
    pub toe: Option<Toe>,
    /// Inflation pressure of each tyre above that of the air, Pa, in the order front left, front right, rear left, rear
    /// right. The vehicle drives on tyres at these pressures, and a sensor in each wheel sends them. Absent: the tyres of
    /// the vehicle file, without sensors.
    pub tyre_pressure_pa: Option<[f64; 4]>,
    /// Errors of sensors and mounting that no file tells.
    pub hidden: HiddenErrors,
    /// What goes wrong on purpose.
    pub faults: Faults,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            origin: Origin::default(),
            gps_start: GpsStart::default(),
            septentrio_blocks: SeptentrioBlocks::PolaRx2e,
            velocity_receiver: VelocityReceiver::default(),
            inertial_unit: InertialUnit::default(),
            imu_baud: 57_600,
            novatel_baud: 115_200,
            septentrio_baud: 115_200,
            controller_baud: 9_600,
            controller_rate_hz: 50.0,
            can_bit_rate: None,
            novatel_processing_s: 0.025,
            septentrio_processing_s: 0.035,
            gnss_jitter_s: 0.002,
            imu_clock_ppm: 12.0,
            position_correlation_s: 60.0,
            toe: None,
            tyre_pressure_pa: None,
            hidden: HiddenErrors::default(),
            faults: Faults::default(),
        }
    }
}

impl Options {
    /// Bit rate of the CAN bus, bit/s.
    #[must_use]
    pub fn can_bit_rate(&self, sensors: &Sensors) -> u32 {
        self.can_bit_rate.unwrap_or(sensors.bus.bit_rate)
    }
}

/// WGS 84 position of the motion's origin. The motion's x axis points east, its y axis north.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Geodetic latitude, degrees north.
    pub latitude_deg: f64,
    /// Longitude, degrees east.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
    /// Height of the geoid above the ellipsoid, m.
    pub undulation_m: f64,
}

impl Default for Origin {
    /// The skid pad of the National Center for Asphalt Technology's track near Auburn, Alabama.
    fn default() -> Self {
        Self {
            latitude_deg: 32.595,
            longitude_deg: -85.295,
            height_m: 176.0,
            undulation_m: -29.0,
        }
    }
}

/// GPS time of an instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpsStart {
    /// Weeks since 1980-01-06.
    pub week: u16,
    /// Milliseconds since Sunday midnight, GPS time; a whole second keeps the receivers' epochs
    /// on whole multiples of their interval.
    pub time_of_week_ms: u32,
}

impl Default for GpsStart {
    /// Wednesday 2009-04-15, 17:00 GPS time.
    fn default() -> Self {
        Self {
            week: 1527,
            time_of_week_ms: (3 * 86_400 + 17 * 3_600) * 1_000,
        }
    }
}

/// Generation of Septentrio SBF blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SeptentrioBlocks {
    /// The ids of the PolaRx2e, the receiver of the thesis (PVTGeodetic 5904).
    #[default]
    PolaRx2e,
    /// The ids of today's receivers (PVTGeodetic 4007).
    Current,
}

/// Protocol of the velocity receiver, on the port `novatel`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VelocityReceiver {
    /// NovAtel binary: BESTPOS, BESTVEL and TIME.
    #[default]
    Novatel,
    /// u-blox UBX: NAV-PVT, and NAV-DOP on whole seconds.
    Ublox,
}

/// Protocol of the inertial unit, on the port `imu`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InertialUnit {
    /// Crossbow 440: S1 packets.
    #[default]
    Crossbow440,
    /// VectorNav: binary outputs with time since the start, acceleration, angular rate and temperature.
    Vectornav,
    /// VectorNav: VNIMU, ASCII.
    VectornavAscii,
}

impl InertialUnit {
    /// Bytes of a message.
    #[must_use]
    pub const fn message_bytes(self) -> f64 {
        match self {
            Self::Crossbow440 => 31.0,
            Self::Vectornav => 44.0,
            Self::VectornavAscii => 115.0,
        }
    }
}
