use serde::{Deserialize, Serialize};

/// What a filter's innovation compares: a kind of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InnovationKind {
    /// Axial strain of a member.
    Strain,
    /// Bending of a lower arm.
    Bending,
    /// Strut force by its potentiometer.
    Strut,
    /// Specific force against the balance of forces.
    Accelerometer,
    /// Angular rate against the balance of moments.
    Gyro,
    /// GNSS velocity.
    GnssVelocity,
    /// GNSS attitude.
    GnssAttitude,
    /// Forward speed by the wheels, while GNSS velocity is silent.
    WheelSpeed,
}

impl InnovationKind {
    /// Number of kinds.
    pub const COUNT: usize = 8;

    /// All kinds, in the order of [`index`](Self::index).
    pub const ALL: [Self; Self::COUNT] = [
        Self::Strain,
        Self::Bending,
        Self::Strut,
        Self::Accelerometer,
        Self::Gyro,
        Self::GnssVelocity,
        Self::GnssAttitude,
        Self::WheelSpeed,
    ];

    /// Position in [`Self::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Name in JSON and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Strain => "strain",
            Self::Bending => "bending",
            Self::Strut => "strut",
            Self::Accelerometer => "accelerometer",
            Self::Gyro => "gyro",
            Self::GnssVelocity => "gnss_velocity",
            Self::GnssAttitude => "gnss_attitude",
            Self::WheelSpeed => "wheel_speed",
        }
    }
}

/// Innovations of one kind over an interval: y is what a sensor says beyond what the filter
/// foretold, S the variance that the filter expects of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Innovations {
    /// Scalar measurements that were taken in.
    pub count: u32,
    /// Mean of y^2/S over them: one where the filter's noise is the sensors'. Zero without any.
    pub mean_square: f64,
    /// Measurements that were left out because they contradict the state.
    pub rejected: u32,
}
