use sample::{
    Attitude, ControlSample, FixQuality, GnssAttitude, GnssPosition, GnssVelocity, Measurement,
};

use super::{
    Body, Cartesian, CorrectedImu, Heading, Inertial, InertialX, Log, Position, SOLUTION_COMPUTED,
    Solution, Velocity,
};
use crate::Measurements;
use crate::geodesy::{Geodetic, yaw_from_heading_deg};
use crate::item::values;

impl Log {
    /// What the log measured, in SI and the project's axes. BESTUTM and TIME give nothing.
    #[must_use]
    pub fn measurements(&self) -> Measurements {
        match &self.body {
            Body::Position(b) => Measurements::one(Measurement::GnssPosition(b.to_sample())),
            Body::Velocity(b) => Measurements::one(Measurement::GnssVelocity(b.to_sample())),
            Body::Cartesian(b) => b.to_samples(),
            Body::Heading(b) => Measurements::one(Measurement::GnssAttitude(b.to_sample())),
            Body::Heading2(b) => {
                Measurements::one(Measurement::GnssAttitude(b.heading.to_sample()))
            }
            Body::Inertial(b) => b.to_samples(),
            Body::InertialX(b) => b.to_samples(),
            Body::CorrectedImu(b) => Measurements::one(Measurement::Control(b.to_sample())),
            Body::Utm(_) | Body::Time(_) => Measurements::none(),
        }
    }

    /// How long before the time tag the velocity was true, s, where the log says so.
    #[must_use]
    pub fn latency_s(&self) -> Option<f64> {
        match &self.body {
            Body::Velocity(b) => Some(f64::from(b.latency_s)),
            Body::Cartesian(b) => Some(f64::from(b.latency_s)),
            _ => None,
        }
    }
}

impl Solution {
    fn quality(self) -> FixQuality {
        if self.status == SOLUTION_COMPUTED {
            quality_of(self.kind)
        } else {
            FixQuality::None
        }
    }
}

/// Quality of a position or velocity type (OEM7 manual, table of position and velocity types). Types 70
/// to 72 tell whether the user's limit of accuracy is kept, not how the solution was made.
const fn quality_of(kind: u32) -> FixQuality {
    match kind {
        1 | 2 | 8 | 16 | 53 | 70..=72 => FixQuality::Single,
        17 | 18 | 20 | 52 | 54 | 57 | 66 => FixQuality::Differential,
        19 | 51 | 67 => FixQuality::DeadReckoning,
        32..=34 | 55 | 58 | 59 | 64 | 65 | 68 | 69 | 73 | 74 | 77..=80 => FixQuality::Float,
        48..=50 | 56 => FixQuality::Fixed,
        _ => FixQuality::None,
    }
}

impl Position {
    fn to_sample(self) -> GnssPosition {
        let [north, east, up] = self.sigma_m.map(f64::from);
        GnssPosition {
            quality: self.solution.quality(),
            latitude_rad: self.latitude_deg.to_radians(),
            longitude_rad: self.longitude_deg.to_radians(),
            height_m: self.height_msl_m + f64::from(self.undulation_m),
            sigma_enu_m: Some([east, north, up]),
            satellites: Some(self.tail.satellites[1]),
        }
    }
}

impl Velocity {
    fn to_sample(self) -> GnssVelocity {
        let (east, north) = math::sin_cos(self.track_deg.to_radians());
        let speed = self.horizontal_m_s;
        GnssVelocity {
            quality: self.solution.quality(),
            velocity_enu_m_s: [speed * east, speed * north, self.vertical_m_s],
            sigma_enu_m_s: None,
            latency_s: Some(f64::from(self.latency_s)),
        }
    }
}

impl Cartesian {
    /// Without a position there are no local axes: both samples then say that there is no solution.
    fn to_samples(self) -> Measurements {
        let Some(place) = Geodetic::from_ecef(self.position_m) else {
            return Measurements::two(
                Measurement::GnssPosition(GnssPosition::default()),
                Measurement::GnssVelocity(GnssVelocity::default()),
            );
        };
        let sigma = |s: [f32; 3]| {
            let [xx, yy, zz] = s.map(|v| f64::from(v) * f64::from(v));
            Some(place.sigma_enu([xx, yy, zz, 0.0, 0.0, 0.0]))
        };
        Measurements::two(
            Measurement::GnssPosition(GnssPosition {
                quality: self.position_solution.quality(),
                latitude_rad: place.latitude_rad,
                longitude_rad: place.longitude_rad,
                height_m: place.height_m,
                sigma_enu_m: sigma(self.position_sigma_m),
                satellites: Some(self.tail.satellites[1]),
            }),
            Measurement::GnssVelocity(GnssVelocity {
                quality: self.velocity_solution.quality(),
                velocity_enu_m_s: place.rotate_to_enu(self.velocity_m_s),
                sigma_enu_m_s: sigma(self.velocity_sigma_m_s),
                latency_s: Some(f64::from(self.latency_s)),
            }),
        )
    }
}

impl Heading {
    /// The roll is not measured: its standard deviation is infinite.
    fn to_sample(self) -> GnssAttitude {
        let sigma = |degrees: f32| f64::from(degrees).to_radians();
        GnssAttitude {
            quality: self.solution.quality(),
            yaw_rad: Some(yaw_from_heading_deg(f64::from(self.heading_deg))),
            pitch_rad: Some(-f64::from(self.pitch_deg).to_radians()),
            roll_rad: None,
            sigma_rad: Some([
                sigma(self.heading_sigma_deg),
                sigma(self.pitch_sigma_deg),
                f64::INFINITY,
            ]),
        }
    }
}

impl Inertial {
    fn to_samples(self) -> Measurements {
        let quality = match self.status {
            3 | 6 | 7 => FixQuality::DeadReckoning,
            _ => FixQuality::None,
        };
        let [north, east, up] = self.velocity_neu_m_s;
        let position = GnssPosition {
            quality,
            latitude_rad: self.latitude_deg.to_radians(),
            longitude_rad: self.longitude_deg.to_radians(),
            height_m: self.height_m,
            sigma_enu_m: None,
            satellites: None,
        };
        let velocity = GnssVelocity {
            quality,
            velocity_enu_m_s: [east, north, up],
            sigma_enu_m_s: None,
            latency_s: None,
        };
        if quality == FixQuality::None {
            return Measurements::two(
                Measurement::GnssPosition(position),
                Measurement::GnssVelocity(velocity),
            );
        }
        Measurements::three(
            Measurement::GnssPosition(position),
            Measurement::GnssVelocity(velocity),
            Measurement::Attitude(Attitude {
                roll_rad: self.roll_deg.to_radians(),
                pitch_rad: -self.pitch_deg.to_radians(),
                yaw_rad: yaw_from_heading_deg(self.azimuth_deg),
            }),
        )
    }
}

impl InertialX {
    fn to_samples(self) -> Measurements {
        // Good and aligned solutions have the quality of their last update; a free one has had none
        // for long.
        let quality = match (self.status, quality_of(self.kind)) {
            (3 | 7, quality) if quality.is_solved() => quality,
            (3 | 6 | 7, _) => FixQuality::DeadReckoning,
            _ => FixQuality::None,
        };
        let [position_sigma, velocity_sigma, _] = self.sigma.map(|s| s.map(f64::from));
        let east_first = |[north, east, up]: [f64; 3]| [east, north, up];
        let position = Measurement::GnssPosition(GnssPosition {
            quality,
            latitude_rad: self.latitude_deg.to_radians(),
            longitude_rad: self.longitude_deg.to_radians(),
            height_m: self.height_msl_m + f64::from(self.undulation_m),
            sigma_enu_m: Some(east_first(position_sigma)),
            satellites: None,
        });
        let velocity = Measurement::GnssVelocity(GnssVelocity {
            quality,
            velocity_enu_m_s: east_first(self.velocity_neu_m_s),
            sigma_enu_m_s: Some(east_first(velocity_sigma)),
            latency_s: None,
        });
        if !quality.is_solved() {
            return Measurements::two(position, velocity);
        }
        let [roll, pitch, azimuth] = self.attitude_deg;
        let attitude = Measurement::Attitude(Attitude {
            roll_rad: roll.to_radians(),
            pitch_rad: -pitch.to_radians(),
            yaw_rad: yaw_from_heading_deg(azimuth),
        });
        Measurements::three(position, velocity, attitude)
    }
}

impl CorrectedImu {
    /// The increments by name: without the rate of the unit and without gravity they are no rates and no
    /// specific force.
    fn to_sample(self) -> ControlSample {
        let [right, forward, up] = self.rotation_rad;
        let [to_right, forwards, upwards] = self.velocity_m_s;
        values(&[
            ("imu_rotation_right_axis", right, "rad"),
            ("imu_rotation_forward_axis", forward, "rad"),
            ("imu_rotation_up_axis", up, "rad"),
            ("imu_velocity_right", to_right, "m/s"),
            ("imu_velocity_forward", forwards, "m/s"),
            ("imu_velocity_up", upwards, "m/s"),
        ])
    }
}
