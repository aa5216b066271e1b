use sample::{Attitude, FixQuality, GnssAttitude, GnssPosition, GnssVelocity, Measurement};

use super::{
    Body, Cartesian, Heading, Inertial, Log, Position, SOLUTION_COMPUTED, Solution, Velocity,
};
use crate::Measurements;
use crate::geodesy::{Geodetic, yaw_from_heading_deg};

impl Log {
    /// What the log measured, in SI and the project's axes. BESTUTM and TIME give nothing.
    #[must_use]
    pub fn measurements(&self) -> Measurements {
        match &self.body {
            Body::Position(b) => Measurements::one(Measurement::GnssPosition(b.to_sample())),
            Body::Velocity(b) => Measurements::one(Measurement::GnssVelocity(b.to_sample())),
            Body::Cartesian(b) => b.to_samples(),
            Body::Heading(b) => Measurements::one(Measurement::GnssAttitude(b.to_sample())),
            Body::Inertial(b) => b.to_samples(),
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
        if self.status != SOLUTION_COMPUTED {
            return FixQuality::None;
        }
        match self.kind {
            1 | 2 | 8 | 16 | 53 => FixQuality::Single,
            17 | 18 | 20 | 52 | 54 | 66 => FixQuality::Differential,
            19 | 51 => FixQuality::DeadReckoning,
            32..=34 | 55 | 64 | 65 | 68 | 69 | 73 | 74 => FixQuality::Float,
            48..=50 | 56 => FixQuality::Fixed,
            _ => FixQuality::None,
        }
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
