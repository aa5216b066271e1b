use sample::{
    Attitude, FixQuality, GnssAttitude, GnssPosition, GnssVelocity, ImuSample, Measurement,
};

use super::{
    AttitudeCovariance, Block, Body, Covariance, EulerAttitude, ExternalSensor, InsNavigation,
};
use crate::Measurements;
use crate::geodesy::{Geodetic, yaw_from_heading_deg};

/// How old a covariance may be to go with a solution, ms.
const COVARIANCE_AGE_MS: u32 = 2000;

/// Septentrio sends a solution first and its covariances in blocks of their own after it. Waiting
/// for them would delay the solution; the last ones, an epoch old, go with it instead.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    place: Option<Geodetic>,
    position_sigma: Option<(u32, [f64; 3])>,
    velocity_sigma: Option<(u32, [f64; 3])>,
    attitude_sigma: Option<(u32, [f64; 3])>,
}

/// The parts that both generations' PVT blocks share.
struct Solution {
    quality: FixQuality,
    satellites: Option<u8>,
    position: [Option<f64>; 3],
    velocity_m_s: [Option<f32>; 3],
}

impl Memory {
    /// What a block measured, in SI and the project's axes.
    pub fn measurements(&mut self, block: &Block) -> Measurements {
        let time = block.time_of_week_ms;
        match &block.body {
            Body::PvtCartesian(b) => self.cartesian(time, &b.into()),
            Body::PvtCartesianV1(b) => self.cartesian(time, &b.into()),
            Body::PvtGeodetic(b) => self.geodetic(time, &b.into()),
            Body::PvtGeodeticV1(b) => self.geodetic(time, &b.into()),
            Body::AttEuler(b) => Measurements::one(self.attitude(time, b)),
            Body::PosCovCartesian(b) => {
                self.position_sigma = time.zip(self.place.and_then(|p| b.sigma_cartesian(p)));
                Measurements::none()
            }
            Body::VelCovCartesian(b) => {
                self.velocity_sigma = time.zip(self.place.and_then(|p| b.sigma_cartesian(p)));
                Measurements::none()
            }
            Body::PosCovGeodetic(b) => {
                self.position_sigma = time.zip(b.sigma_geodetic());
                Measurements::none()
            }
            Body::VelCovGeodetic(b) => {
                self.velocity_sigma = time.zip(b.sigma_geodetic());
                Measurements::none()
            }
            Body::AttCovEuler(b) => {
                self.attitude_sigma = time.zip(b.sigma());
                Measurements::none()
            }
            Body::InsNavCart(b) => b.measurements(false),
            Body::InsNavGeod(b) => b.measurements(true),
            Body::ExtSensorMeas { count, sensors } => {
                inertial(&sensors[..usize::from(*count).min(sensors.len())])
            }
            Body::ReceiverTime { .. } | Body::XppsOffset { .. } => Measurements::none(),
        }
    }

    fn cartesian(&mut self, time: Option<u32>, s: &Solution) -> Measurements {
        let place = all(s.position).and_then(Geodetic::from_ecef);
        let velocity = all(s.velocity_m_s.map(|v| v.map(f64::from)));
        let velocity = place.zip(velocity).map(|(p, v)| p.rotate_to_enu(v));
        self.solution(time, s, place, velocity)
    }

    fn geodetic(&mut self, time: Option<u32>, s: &Solution) -> Measurements {
        let place = all(s.position).map(|[latitude_rad, longitude_rad, height_m]| Geodetic {
            latitude_rad,
            longitude_rad,
            height_m,
        });
        let velocity = all(s.velocity_m_s.map(|v| v.map(f64::from))).map(|[n, e, u]| [e, n, u]);
        self.solution(time, s, place, velocity)
    }

    fn solution(
        &mut self,
        time: Option<u32>,
        s: &Solution,
        place: Option<Geodetic>,
        velocity: Option<[f64; 3]>,
    ) -> Measurements {
        self.place = place.or(self.place);
        let good = |there: bool| if there { s.quality } else { FixQuality::None };
        let p = place.unwrap_or_default();
        Measurements::two(
            Measurement::GnssPosition(GnssPosition {
                quality: good(place.is_some()),
                latitude_rad: p.latitude_rad,
                longitude_rad: p.longitude_rad,
                height_m: p.height_m,
                sigma_enu_m: recent(self.position_sigma, time),
                satellites: s.satellites,
            }),
            Measurement::GnssVelocity(GnssVelocity {
                quality: good(velocity.is_some()),
                velocity_enu_m_s: velocity.unwrap_or_default(),
                sigma_enu_m_s: recent(self.velocity_sigma, time),
                latency_s: None,
            }),
        )
    }

    fn attitude(&self, time: Option<u32>, b: &EulerAttitude) -> Measurement {
        let quality = match (b.error, b.mode) {
            (0, 1 | 3) => FixQuality::Float,
            (0, 2 | 4) => FixQuality::Fixed,
            _ => FixQuality::None,
        };
        let radians = |degrees: Option<f32>| degrees.map(|d| f64::from(d).to_radians());
        Measurement::GnssAttitude(GnssAttitude {
            quality,
            yaw_rad: b.heading_deg.map(|h| yaw_from_heading_deg(f64::from(h))),
            pitch_rad: radians(b.pitch_deg).map(|pitch| -pitch),
            roll_rad: radians(b.roll_deg),
            sigma_rad: recent(self.attitude_sigma, time),
        })
    }
}

impl InsNavigation {
    fn measurements(&self, geodetic: bool) -> Measurements {
        let quality = match quality(self.error, self.mode) {
            // The inertial unit alone.
            FixQuality::None if self.error == 0 => FixQuality::DeadReckoning,
            quality => quality,
        };
        let wide = |values: [Option<f32>; 3]| all(values.map(|v| v.map(f64::from)));
        let squared = |s: [f64; 3]| s.map(|v| v * v);
        let (place, velocity, sigmas);
        if geodetic {
            place = all(self.position).map(|[latitude_rad, longitude_rad, height_m]| Geodetic {
                latitude_rad,
                longitude_rad,
                height_m,
            });
            velocity = wide(self.velocity_m_s);
            // Latitude first, but east first.
            let of_position = wide(self.position_sigma_m).map(|[n, e, u]| [e, n, u]);
            sigmas = [of_position, wide(self.velocity_sigma_m_s)];
        } else {
            place = all(self.position).and_then(Geodetic::from_ecef);
            velocity = place
                .zip(wide(self.velocity_m_s))
                .map(|(p, v)| p.rotate_to_enu(v));
            let turned = |v: [Option<f32>; 3]| {
                let (place, [xx, yy, zz]) = place.zip(wide(v).map(squared))?;
                Some(place.sigma_enu([xx, yy, zz, 0.0, 0.0, 0.0]))
            };
            sigmas = [
                turned(self.position_sigma_m),
                turned(self.velocity_sigma_m_s),
            ];
        }
        let good = |there: bool| if there { quality } else { FixQuality::None };
        let p = place.unwrap_or_default();
        let position = Measurement::GnssPosition(GnssPosition {
            quality: good(place.is_some()),
            latitude_rad: p.latitude_rad,
            longitude_rad: p.longitude_rad,
            height_m: p.height_m,
            sigma_enu_m: sigmas[0],
            satellites: None,
        });
        let velocity = Measurement::GnssVelocity(GnssVelocity {
            quality: good(velocity.is_some()),
            velocity_enu_m_s: velocity.unwrap_or_default(),
            sigma_enu_m_s: sigmas[1],
            latency_s: None,
        });
        let attitude = wide(self.attitude_deg).filter(|_| quality.is_solved());
        match attitude {
            Some([heading, pitch, roll]) => Measurements::three(
                position,
                velocity,
                Measurement::Attitude(Attitude {
                    roll_rad: roll.to_radians(),
                    pitch_rad: -pitch.to_radians(),
                    yaw_rad: yaw_from_heading_deg(heading),
                }),
            ),
            None => Measurements::two(position, velocity),
        }
    }
}

/// Acceleration and angular rate of one block, in the axes of the sensor.
fn inertial(sensors: &[ExternalSensor]) -> Measurements {
    let of = |kind: u8| sensors.iter().find(|sensor| sensor.kind == kind);
    let valid = |kind: u8| {
        of(kind)
            .filter(|s| s.info & 1 != 0)
            .and_then(|s| all(s.values))
    };
    let (Some(force), Some(rate)) = (valid(0), valid(1)) else {
        return Measurements::none();
    };
    let temperature = of(3).map(|sensor| f64::from(sensor.temperature_cc) * 0.01);
    Measurements::one(Measurement::Imu(ImuSample {
        specific_force_m_s2: force,
        angular_rate_rad_s: rate.map(f64::to_radians),
        temperature_c: temperature,
        interval_s: 0.0,
        status: 0,
        valid: true,
    }))
}

fn recent(stored: Option<(u32, [f64; 3])>, now: Option<u32>) -> Option<[f64; 3]> {
    let ((then, sigma), now) = stored.zip(now)?;
    (now.abs_diff(then) <= COVARIANCE_AGE_MS).then_some(sigma)
}

fn all<T: Copy>(values: [Option<T>; 3]) -> Option<[T; 3]> {
    Some([values[0]?, values[1]?, values[2]?])
}

fn quality(error: u8, mode: u8) -> FixQuality {
    if error != 0 {
        return FixQuality::None;
    }
    match mode & 0x0F {
        1 => FixQuality::Single,
        2 | 6 => FixQuality::Differential,
        3 | 4 | 7 => FixQuality::Fixed,
        5 | 8 | 10 => FixQuality::Float,
        _ => FixQuality::None,
    }
}

impl From<&super::Pvt> for Solution {
    fn from(b: &super::Pvt) -> Self {
        Self {
            quality: quality(b.error, b.mode),
            satellites: b.satellites,
            position: b.position,
            velocity_m_s: b.velocity_m_s,
        }
    }
}

impl From<&super::PvtV1> for Solution {
    fn from(b: &super::PvtV1) -> Self {
        Self {
            quality: quality(b.error, b.mode),
            satellites: b.satellites,
            position: b.position,
            velocity_m_s: b.velocity_m_s,
        }
    }
}

impl Covariance {
    fn element(&self, index: usize) -> Option<f64> {
        self.elements[index].map(f64::from)
    }

    fn sigma_cartesian(&self, place: Geodetic) -> Option<[f64; 3]> {
        let [xx, yy, zz] = all([self.element(0), self.element(1), self.element(2)])?;
        let [xy, xz, yz] = all([self.element(4), self.element(5), self.element(7)])?;
        Some(place.sigma_enu([xx, yy, zz, xy, xz, yz]))
    }

    fn sigma_geodetic(&self) -> Option<[f64; 3]> {
        let variances = all([self.element(1), self.element(0), self.element(2)])?;
        Some(variances.map(|v| v.max(0.0).sqrt()))
    }
}

impl AttitudeCovariance {
    /// Yaw, pitch, roll; infinite where not measured.
    fn sigma(&self) -> Option<[f64; 3]> {
        self.variances_deg2[0]?;
        Some(self.variances_deg2.map(|variance| {
            variance.map_or(f64::INFINITY, |v| f64::from(v).max(0.0).sqrt().to_radians())
        }))
    }
}
