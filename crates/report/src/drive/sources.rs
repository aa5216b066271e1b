//! Rates and latencies of the sensors, and the places of the receivers.

use store::{Column, Table, Values};

/// Radius of the earth, m: good to 0.5 % of a distance, which is enough for a picture.
const MEAN_RADIUS_M: f64 = 6_371_008.8;

/// Samples and latency of a topic in each second.
#[derive(Clone, Debug, Default)]
pub struct SourceRates {
    /// The second of the drive, samples in it, and the greatest latency, s.
    seconds: Vec<(i64, u32, f64)>,
}

impl SourceRates {
    /// Adds the rows of a table.
    pub fn add(&mut self, table: &Table, start_ns: u64) {
        let times = table.log_time_ns.iter().zip(&table.publish_time_ns);
        for (arrived, valid) in times {
            let second = (arrived - start_ns.cast_signed()).div_euclid(1_000_000_000);
            let latency_s = (arrived - valid) as f64 * 1e-9;
            match self.seconds.last_mut() {
                Some((last, count, most)) if *last == second => {
                    *count += 1;
                    *most = most.max(latency_s);
                }
                _ => self.seconds.push((second, 1, latency_s)),
            }
        }
    }

    /// Middle of each second, s.
    pub fn time_s(&self) -> Vec<f64> {
        let seconds = self.seconds.iter();
        seconds.map(|(second, _, _)| *second as f64 + 0.5).collect()
    }

    /// Samples of each second.
    pub fn per_second(&self) -> Vec<f32> {
        self.seconds.iter().map(|second| second.1 as f32).collect()
    }

    /// Greatest latency of each second, ms.
    pub fn latency_ms(&self) -> Vec<f32> {
        let seconds = self.seconds.iter();
        seconds.map(|second| (second.2 * 1e3) as f32).collect()
    }
}

/// A place by longitude and latitude, rad, in metres east and north of another one.
pub fn local_m([longitude, latitude]: [f64; 2], origin: [f64; 2]) -> [f64; 2] {
    [
        (longitude - origin[0]) * math::cos(origin[1]) * MEAN_RADIUS_M,
        (latitude - origin[1]) * MEAN_RADIUS_M,
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
        || name.starts_with("velocity_m_s.")
        || matches!(name, "east_m" | "north_m")
}

/// Whether a column is the travel of a wheel's suspension, in metres or in counts.
pub fn is_travel(name: &str) -> bool {
    name.ends_with(".deflection_m") || name.ends_with(".raw_counts")
}
