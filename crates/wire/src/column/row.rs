//! The measurements that a row of columns makes.

use std::collections::BTreeMap;

use sample::{
    ControlSample, CornerSample, Counts, FixQuality, GnssAttitude, GnssPosition, GnssVelocity,
    GroundSpeedSample, ImuSample, Measurement, PerWheel, Signal, SteerSample, StrainChannel, Wheel,
    WheelSpeedSample,
};

use super::{Column, Quantity};
use crate::geodesy::Geodetic;

/// The measurements of one row: pairs of latency in seconds and measurement, those of a longer latency
/// first. Columns without a value in this row are absent from `values`.
#[must_use]
pub fn measurements(values: &[(&Column, f64)]) -> Vec<(f64, Measurement)> {
    let mut groups: BTreeMap<u64, Row> = BTreeMap::new();
    let ecef = ecef_position(values);
    for (column, value) in values {
        // Latencies are not negative, so their bits sort as they do.
        groups
            .entry(column.latency_s.max(0.0).to_bits())
            .or_default()
            .take(column, *value);
    }
    let mut all = Vec::new();
    for (latency, row) in groups.into_iter().rev() {
        let latency_s = f64::from_bits(latency);
        all.extend(row.finish(ecef).into_iter().map(|m| (latency_s, m)));
    }
    all
}

/// The measurements that these values make, SI, all of one instant.
#[must_use]
pub fn of_values(values: BTreeMap<Quantity, f64>) -> Vec<Measurement> {
    let row = Row {
        values,
        signals: Vec::new(),
    };
    row.finish(None)
}

/// The earth-centred position of a row, whatever its latency: it gives the directions of an
/// earth-centred velocity.
fn ecef_position(values: &[(&Column, f64)]) -> Option<Geodetic> {
    let coordinate = |axis| {
        let quantity = Quantity::EcefPosition(axis);
        let found = values
            .iter()
            .find(|(column, _)| column.quantity == quantity);
        found.map(|(_, value)| *value)
    };
    Geodetic::from_ecef([coordinate(0)?, coordinate(1)?, coordinate(2)?])
}

/// What a row holds, by quantity.
#[derive(Default)]
struct Row {
    values: BTreeMap<Quantity, f64>,
    signals: Vec<Signal>,
}

impl Row {
    fn take(&mut self, column: &Column, value: f64) {
        match column.quantity {
            Quantity::Truth(_) => {}
            Quantity::Signal => self.signals.push(Signal {
                name: column.name.as_str().into(),
                value,
                unit: column.unit.as_str().into(),
            }),
            quantity => {
                self.values.insert(quantity, value);
            }
        }
    }

    fn get(&self, quantity: Quantity) -> Option<f64> {
        self.values.get(&quantity).copied()
    }

    fn axes(&self, quantity: fn(usize) -> Quantity) -> [Option<f64>; 3] {
        [0, 1, 2].map(|axis| self.get(quantity(axis)))
    }

    fn finish(self, ecef: Option<Geodetic>) -> Vec<Measurement> {
        let mut all: Vec<Measurement> = Vec::new();
        all.extend(self.imu());
        let steer = self.get(Quantity::Steer);
        all.extend(
            steer.map(|steering_wheel_rad| Measurement::Steer(SteerSample { steering_wheel_rad })),
        );
        let speeds = PerWheel::from_fn(|wheel| self.get(Quantity::WheelSpeed(wheel)));
        if speeds.0.iter().any(Option::is_some) {
            all.push(Measurement::WheelSpeed(WheelSpeedSample {
                angular_speed_rad_s: speeds,
            }));
        }
        if let Some(forward_m_s) = self.get(Quantity::ForwardSpeed) {
            all.push(Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s,
                leftward_m_s: self.get(Quantity::LeftwardSpeed),
            }));
        }
        all.extend(self.gnss(ecef));
        all.extend(
            Wheel::ALL
                .into_iter()
                .filter_map(|wheel| self.corner(wheel)),
        );
        if !self.signals.is_empty() {
            all.push(Measurement::Control(ControlSample {
                values: self.signals,
            }));
        }
        all
    }

    /// Axes that the file does not have are `NaN`.
    fn imu(&self) -> Option<Measurement> {
        let force = self.axes(Quantity::Acceleration);
        let rate = self.axes(Quantity::Rate);
        let any = force.iter().chain(&rate).any(Option::is_some);
        any.then(|| {
            Measurement::Imu(ImuSample {
                specific_force_m_s2: force.map(|value| value.unwrap_or(f64::NAN)),
                angular_rate_rad_s: rate.map(|value| value.unwrap_or(f64::NAN)),
                valid: true,
                ..ImuSample::default()
            })
        })
    }

    fn gnss(&self, ecef: Option<Geodetic>) -> Vec<Measurement> {
        let mut all = Vec::new();
        let quality = FixQuality::Single;
        if let Some(place) = self.place(ecef) {
            all.push(Measurement::GnssPosition(GnssPosition {
                quality,
                latitude_rad: place.latitude_rad,
                longitude_rad: place.longitude_rad,
                height_m: place.height_m,
                ..GnssPosition::default()
            }));
        }
        let [east, north, up] = self.ecef_velocity(ecef).map_or_else(
            || self.axes(Quantity::Velocity),
            |velocity| velocity.map(Some),
        );
        let (speed, course) = (
            self.get(Quantity::GroundTrackSpeed),
            self.get(Quantity::Course),
        );
        let level = east.zip(north).or_else(|| {
            let (speed, course) = speed.zip(course)?;
            Some((speed * math::sin(course), speed * math::cos(course)))
        });
        if let Some((east, north)) = level {
            all.push(Measurement::GnssVelocity(GnssVelocity {
                quality,
                velocity_enu_m_s: [east, north, up.unwrap_or(0.0)],
                ..GnssVelocity::default()
            }));
        }
        let heading = self.get(Quantity::Heading);
        let attitude = GnssAttitude {
            quality,
            yaw_rad: self
                .get(Quantity::Yaw)
                .or(heading.map(|heading| std::f64::consts::FRAC_PI_2 - heading)),
            pitch_rad: self.get(Quantity::Pitch),
            roll_rad: self.get(Quantity::Roll),
            sigma_rad: None,
        };
        let angles = [attitude.yaw_rad, attitude.pitch_rad, attitude.roll_rad];
        if angles.iter().any(Option::is_some) {
            all.push(Measurement::GnssAttitude(attitude));
        }
        all
    }

    /// The position: geodetic, else from the earth-centred coordinates of the same latency.
    fn place(&self, ecef: Option<Geodetic>) -> Option<Geodetic> {
        let level = self
            .get(Quantity::Latitude)
            .zip(self.get(Quantity::Longitude));
        match level {
            Some((latitude_rad, longitude_rad)) => Some(Geodetic {
                latitude_rad,
                longitude_rad,
                height_m: self.get(Quantity::Height).unwrap_or(f64::NAN),
            }),
            None => ecef.filter(|_| self.get(Quantity::EcefPosition(0)).is_some()),
        }
    }

    /// Velocity east, north and up from an earth-centred one at `place`.
    fn ecef_velocity(&self, place: Option<Geodetic>) -> Option<[f64; 3]> {
        let [x, y, z] = self.axes(Quantity::EcefVelocity);
        let velocity = [x?, y?, z?];
        let rows = place?.enu_from_ecef();
        Some(rows.map(|row| (0..3).map(|axis| row[axis] * velocity[axis]).sum()))
    }

    fn corner(&self, wheel: Wheel) -> Option<Measurement> {
        let counts = |quantity| {
            self.get(quantity)
                .map(|value| Counts::Converter(value.round() as i32))
        };
        let strain_counts = StrainChannel::ALL.map(|c| counts(Quantity::Strain(wheel, c)));
        let deflection_counts = counts(Quantity::Deflection(wheel));
        let any = deflection_counts.is_some() || strain_counts.iter().any(Option::is_some);
        any.then_some(Measurement::Corner(CornerSample {
            wheel,
            strain_counts,
            deflection_counts,
        }))
    }
}
