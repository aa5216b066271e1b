//! Means of the readings over short intervals, as columns of equal length.

use estimator::calibration::Resolved;
use sample::{LogTime, Measurement, PerWheel, Sample, SourceId, StrainChannel, Wheel};

/// Length of an interval, s.
pub const INTERVAL_S: f64 = 0.1;
/// Longest recording that is used, s.
const LONGEST_S: f64 = 3600.0;
/// Intervals on each side that a smoothed value is the mean over.
const SMOOTHED: usize = 2;

/// A quantity over the intervals.
#[derive(Clone, Debug, Default)]
pub struct Column {
    sum: Vec<f64>,
    count: Vec<u32>,
}

impl Column {
    fn push(&mut self, row: usize, value: f64) {
        if !value.is_finite() {
            return;
        }
        if self.sum.len() <= row {
            self.sum.resize(row + 1, 0.0);
            self.count.resize(row + 1, 0);
        }
        self.sum[row] += value;
        self.count[row] += 1;
    }

    /// Whether there is any reading.
    pub fn is_known(&self) -> bool {
        !self.sum.is_empty()
    }

    /// Means over the interval and its neighbours; `NaN` without a reading.
    pub fn smoothed(&self, rows: usize) -> Vec<f64> {
        let at = |row: usize| {
            let from = row.saturating_sub(SMOOTHED).min(self.sum.len());
            let to = (row + SMOOTHED + 1).min(self.sum.len());
            let count: u32 = self.count[from..to].iter().sum();
            self.sum[from..to].iter().sum::<f64>() / f64::from(count)
        };
        (0..rows).map(at).collect()
    }
}

/// Readings of a recording, converted by sensors file and calibration.
#[derive(Debug, Default)]
pub struct Columns {
    start: Option<LogTime>,
    /// Number of intervals.
    pub rows: usize,
    /// Specific force of the first inertial unit, vehicle axes, m/s^2.
    pub force_m_s2: [Column; 3],
    /// Angular rate of the first inertial unit, vehicle axes, rad/s.
    pub rate_rad_s: [Column; 3],
    /// Velocity of the first receiver, east and north, m/s.
    pub velocity_m_s: [Column; 2],
    /// Forward speed of a device, m/s.
    pub ground_speed_m_s: Column,
    /// Steering wheel, rad.
    pub steer_rad: Column,
    /// Wheel speeds, rad/s.
    pub wheel_rad_s: PerWheel<Column>,
    /// Compression of the struts from the design length, m.
    pub compression_m: PerWheel<Column>,
    /// Strain channels, N or N m.
    pub strain: PerWheel<[Column; StrainChannel::COUNT]>,
    imu_source: Option<SourceId>,
    gnss_source: Option<SourceId>,
}

impl Columns {
    /// Takes a sample.
    pub fn push(&mut self, sample: &Sample, calibration: &Resolved) {
        let start = *self.start.get_or_insert(sample.log_time);
        let time_s = sample.valid_time.seconds_since(start).max(0.0);
        if time_s > LONGEST_S {
            return;
        }
        let row = (time_s / INTERVAL_S) as usize;
        self.rows = self.rows.max(row + 1);
        match &sample.measurement {
            Measurement::Imu(imu) => {
                let first = *self.imu_source.get_or_insert(sample.source);
                if first != sample.source {
                    return;
                }
                let turn = calibration.body_from_imu;
                let force = turn
                    * (model::nalgebra::Vector3::from(imu.specific_force_m_s2)
                        - calibration.accel_bias_m_s2);
                let rate = turn
                    * (model::nalgebra::Vector3::from(imu.angular_rate_rad_s)
                        - calibration.gyro_bias_rad_s);
                for axis in 0..3 {
                    self.force_m_s2[axis].push(row, force[axis]);
                    self.rate_rad_s[axis].push(row, rate[axis]);
                }
            }
            Measurement::GnssVelocity(gnss) if gnss.quality.is_measured() => {
                let first = *self.gnss_source.get_or_insert(sample.source);
                if first == sample.source {
                    let axes = self.velocity_m_s.iter_mut().zip(gnss.velocity_enu_m_s);
                    axes.for_each(|(column, value)| column.push(row, value));
                }
            }
            Measurement::GroundSpeed(speed) => self.ground_speed_m_s.push(row, speed.forward_m_s),
            Measurement::Steer(steer) => {
                let angle_rad = steer.steering_wheel_rad - calibration.steer_offset_rad;
                self.steer_rad.push(row, angle_rad);
            }
            Measurement::WheelSpeed(speeds) => {
                for wheel in Wheel::ALL {
                    if let Some(speed) = speeds.angular_speed_rad_s[wheel] {
                        self.wheel_rad_s[wheel].push(row, speed);
                    }
                }
            }
            Measurement::Corner(corner) => {
                let wheel = corner.wheel;
                let known = &calibration.corners[wheel];
                let compression = corner
                    .deflection_counts
                    .and_then(|counts| known.deflection.value(counts));
                if let Some(value) = compression {
                    self.compression_m[wheel].push(row, value);
                }
                for channel in 0..StrainChannel::COUNT {
                    let value = corner.strain_counts[channel]
                        .and_then(|counts| known.strain[channel].value(counts));
                    if let Some(value) = value {
                        self.strain[wheel][channel].push(row, value);
                    }
                }
            }
            _ => {}
        }
    }
}
