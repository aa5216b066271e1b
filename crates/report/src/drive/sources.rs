//! Rates and latencies of the sensors, and the places of the receivers.

use sample::ControlSample;
use store::{Column, Table, Values};

/// Beginning of the names of the inflation pressures of the tyres, Pa.
pub const TYRE_PRESSURE: &str = "tyre_pressure_";

/// Radius of the earth, m: good to 0.5 % of a distance, which is enough for a picture.
const MEAN_RADIUS_M: f64 = 6_371_008.8;

/// Samples and latency of a topic in each second, or in each longer time of a long drive.
#[derive(Clone, Debug)]
pub struct SourceRates {
    /// Length of a time, s.
    width_s: f64,
    /// Number of the time from the start of the drive, samples in it, and the greatest latency, s.
    times: Vec<(i64, u32, f64)>,
}

impl SourceRates {
    /// For times of a length, s.
    pub const fn new(width_s: f64) -> Self {
        let times = Vec::new();
        Self { width_s, times }
    }

    /// Adds the rows of a table.
    pub fn add(&mut self, table: &Table, start_ns: u64) {
        let width_ns = (self.width_s * 1e9) as i64;
        let times = table.log_time_ns.iter().zip(&table.publish_time_ns);
        for (arrived, valid) in times {
            let time = (arrived - start_ns.cast_signed()).div_euclid(width_ns);
            let latency_s = (arrived - valid) as f64 * 1e-9;
            match self.times.last_mut() {
                Some((last, count, most)) if *last == time => {
                    *count += 1;
                    *most = most.max(latency_s);
                }
                _ => self.times.push((time, 1, latency_s)),
            }
        }
    }

    /// Middle of each time, s.
    pub fn time_s(&self) -> Vec<f64> {
        let times = self.times.iter();
        times
            .map(|(time, _, _)| (*time as f64 + 0.5) * self.width_s)
            .collect()
    }

    /// Samples in a second of each time.
    pub fn per_second(&self) -> Vec<f32> {
        let times = self.times.iter();
        times
            .map(|(_, count, _)| (f64::from(*count) / self.width_s) as f32)
            .collect()
    }

    /// Greatest latency of each time, ms.
    pub fn latency_ms(&self) -> Vec<f32> {
        let times = self.times.iter();
        times.map(|time| (time.2 * 1e3) as f32).collect()
    }
}

/// A place by longitude and latitude, rad, in metres east and north of another one.
pub fn local_m([longitude, latitude]: [f64; 2], origin: [f64; 2]) -> [f64; 2] {
    [
        (longitude - origin[0]) * math::cos(origin[1]) * MEAN_RADIUS_M,
        (latitude - origin[1]) * MEAN_RADIUS_M,
    ]
}

/// Longitude and latitude of a place in metres east and north of another one, rad.
pub fn place_of([east_m, north_m]: [f64; 2], origin: [f64; 2]) -> [f64; 2] {
    [
        origin[0] + east_m / (math::cos(origin[1]) * MEAN_RADIUS_M),
        origin[1] + north_m / MEAN_RADIUS_M,
    ]
}

/// Replaces geographic positions by metres east and north of the first one that the receiver solved,
/// which 32 bits can hold. Positions that are not solved become NaN.
pub fn to_local(table: &mut Table, origin: &mut Option<[f64; 2]>) {
    let column = |name: &str| table.columns.iter().position(|column| column.name == name);
    let [Some(longitude), Some(latitude), Some(quality)] =
        ["longitude_rad", "latitude_rad", "quality"].map(column)
    else {
        return;
    };
    let (Values::F64(longitudes), Values::F64(latitudes), Values::I32(qualities)) = (
        &table.columns[longitude].values,
        &table.columns[latitude].values,
        &table.columns[quality].values,
    ) else {
        return;
    };
    let mut local = [Vec::new(), Vec::new()];
    for ((longitude, latitude), quality) in longitudes.iter().zip(latitudes).zip(qualities) {
        let [east, north] = if *quality > 0 {
            let here = [*longitude, *latitude];
            local_m(here, *origin.get_or_insert(here))
        } else {
            [f64::NAN; 2]
        };
        local[0].push(east);
        local[1].push(north);
    }
    for (name, values) in ["east_m", "north_m"].into_iter().zip(local) {
        table.columns.push(Column {
            name: name.to_owned(),
            unit: String::new(),
            names: Vec::new(),
            values: Values::F64(values),
            present: None,
        });
    }
}

/// Whether the values of a sensor's column are drawn.
pub fn is_drawn(name: &str) -> bool {
    name == "steering_wheel_rad"
        || ControlSample::WHEEL_ANGLE.contains(&name)
        || name.starts_with(TYRE_PRESSURE)
        || name.starts_with("velocity_m_s.")
        || matches!(name, "east_m" | "north_m")
}

/// Whether a column is the travel of a wheel's suspension, in metres or in counts.
pub fn is_travel(name: &str) -> bool {
    let ends = [".deflection_m", ".raw_counts", ".equivalent_counts"];
    ends.iter().any(|end| name.ends_with(end))
}
