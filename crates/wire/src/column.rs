//! Columns of a table, whatever its format: which quantity each holds, in which unit, and the
//! measurements that a row of them makes.

mod quantity;
mod row;

use crate::WireError;

pub use quantity::{Quantity, Truth};
pub use row::{measurements, of_values};

/// One column: value = (number * scale + offset) * factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name in the map; the name of a [`Quantity::Signal`].
    pub name: String,
    /// What it holds.
    pub quantity: Quantity,
    /// Unit of the file.
    pub unit: String,
    /// Takes the file's unit to SI.
    pub factor: f64,
    /// Applied to the number, in the file's unit.
    pub scale: f64,
    /// Added to it, in the file's unit.
    pub offset: f64,
    /// How long before the row's time the value was true, s.
    pub latency_s: f64,
    /// Rows for which a table holds one value; 1 if each row has a new value.
    pub held_rows: u32,
}

impl Column {
    /// Whether the column gives finite values.
    ///
    /// # Errors
    /// [`WireError::Setting`] with the numbers that cannot work.
    pub fn check(&self) -> Result<(), WireError> {
        let numbers = [self.scale, self.offset, self.factor, self.latency_s];
        if numbers.iter().all(|value| value.is_finite()) && self.scale != 0.0 {
            return Ok(());
        }
        Err(WireError::Setting {
            what: "scale, offset or latency",
            got: format!("{numbers:?} in {}", self.name),
            expected: "finite numbers, scale not 0",
        })
    }

    /// The value of a number of the file, SI.
    #[must_use]
    pub fn value(&self, number: f64) -> f64 {
        (number * self.scale + self.offset) * self.factor
    }
}

/// Quantities that make no measurement because others beside them are absent: position in `columns`
/// and the first set of absent quantities.
#[must_use]
pub fn incomplete(columns: &[&Column]) -> Vec<(usize, Vec<Quantity>)> {
    let has = |quantity: &Quantity| columns.iter().any(|column| column.quantity == *quantity);
    let mut found = Vec::new();
    for (index, column) in columns.iter().enumerate() {
        let sets = column.quantity.needs();
        let absent = |set: &Vec<Quantity>| -> Vec<Quantity> {
            set.iter().filter(|needed| !has(needed)).copied().collect()
        };
        if let Some(first) = sets.first()
            && sets.iter().all(|set| !absent(set).is_empty())
        {
            let nearest = sets.iter().map(absent).min_by_key(Vec::len);
            found.push((index, nearest.unwrap_or_else(|| absent(first))));
        }
    }
    found
}

/// Two columns of one quantity, of which a row keeps one only: their positions.
#[must_use]
pub fn twice(columns: &[&Column]) -> Option<[usize; 2]> {
    let same = |a: &Column, b: &Column| a.quantity == b.quantity && a.quantity != Quantity::Signal;
    (0..columns.len()).find_map(|second| {
        let first = (0..second).find(|first| same(columns[*first], columns[second]))?;
        Some([first, second])
    })
}

#[cfg(test)]
mod tests {
    use sample::{GroundSpeedSample, Measurement};

    use super::*;

    fn column(quantity: &str, unit: &str, latency_s: f64) -> Column {
        let quantity = Quantity::from_name(quantity).expect("a known quantity");
        Column {
            name: quantity.name(),
            quantity,
            unit: unit.to_owned(),
            factor: quantity.dimension().factor(unit).expect("a known unit"),
            scale: 1.0,
            offset: 0.0,
            latency_s,
            held_rows: 1,
        }
    }

    #[test]
    fn names_are_one_to_one() {
        let names: Vec<String> = Quantity::all().map(Quantity::name).collect();
        let mut unique = names.clone();
        unique.sort();
        unique.dedup();
        assert_eq!(names.len(), unique.len());
        for quantity in Quantity::all() {
            assert_eq!(Quantity::from_name(&quantity.name()), Some(quantity));
        }
    }

    #[test]
    fn units_and_latencies_make_measurements() {
        let yaw = column("rate.z", "deg/s", 0.0);
        let ay = column("acceleration.y", "g", 0.0);
        let speed = column("speed.forward", "km/h", 0.05);
        let row = [
            (&yaw, yaw.value(90.0)),
            (&ay, ay.value(1.0)),
            (&speed, speed.value(36.0)),
        ];
        let all = measurements(&row);
        assert_eq!(all.len(), 2);
        assert_eq!(all[0].0, 0.05);
        assert_eq!(
            all[0].1,
            Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s: 10.0,
                leftward_m_s: None
            })
        );
        let Measurement::Imu(imu) = &all[1].1 else {
            panic!("{all:?}");
        };
        assert!((imu.angular_rate_rad_s[2] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!((imu.specific_force_m_s2[1] - 9.806_65).abs() < 1e-12);
        assert!(imu.specific_force_m_s2[0].is_nan());
    }

    #[test]
    fn speed_and_course_are_a_velocity() {
        let speed = column("gnss.speed", "m/s", 0.0);
        let course = column("gnss.course", "deg", 0.0);
        let all = measurements(&[(&speed, 2.0), (&course, course.value(90.0))]);
        let Measurement::GnssVelocity(velocity) = &all[0].1 else {
            panic!("{all:?}");
        };
        let [east, north, up] = velocity.velocity_enu_m_s;
        assert!((east - 2.0).abs() < 1e-12 && north.abs() < 1e-12 && up == 0.0);
    }

    #[test]
    fn earth_centred_coordinates_are_a_place_and_a_velocity() {
        // A place at 45° north, 90° east, 100 m; the velocity is 3 east, 4 north, 5 up.
        let place = crate::geodesy::Geodetic {
            latitude_rad: std::f64::consts::FRAC_PI_4,
            longitude_rad: std::f64::consts::FRAC_PI_2,
            height_m: 100.0,
        };
        let rows = place.enu_from_ecef();
        let enu = [3.0, 4.0, 5.0];
        let axis = |axis: usize| (0..3).map(|row| rows[row][axis] * enu[row]).sum::<f64>();
        let ecef = place.to_ecef();
        let columns: Vec<(Column, f64)> = (0..3)
            .flat_map(|i| {
                let name = ["x", "y", "z"][i];
                [
                    (column(&format!("gnss.ecef_{name}"), "m", 0.1), ecef[i]),
                    (
                        column(&format!("gnss.ecef_velocity_{name}"), "m/s", 0.0),
                        axis(i),
                    ),
                ]
            })
            .collect();
        let row: Vec<(&Column, f64)> = columns.iter().map(|(c, v)| (c, *v)).collect();
        let all = measurements(&row);
        let [
            (_, Measurement::GnssPosition(found)),
            (_, Measurement::GnssVelocity(velocity)),
        ] = &all[..]
        else {
            panic!("{all:?}");
        };
        assert!((found.height_m - 100.0).abs() < 1e-6);
        assert!((found.latitude_rad - place.latitude_rad).abs() < 1e-12);
        for (found, expected) in velocity.velocity_enu_m_s.iter().zip(enu) {
            assert!((found - expected).abs() < 1e-9, "{velocity:?}");
        }
    }

    #[test]
    fn half_pairs_and_quantities_that_occur_twice_are_found() {
        let names = |quantities: &[&str]| -> Vec<Column> {
            let unit = |name: &str| match name {
                "gnss.speed" | "speed.leftward" | "gnss.velocity_up" => "m/s",
                _ => "rad",
            };
            quantities.iter().map(|q| column(q, unit(q), 0.0)).collect()
        };
        let halves = |quantities: &[&str]| {
            let columns = names(quantities);
            let columns: Vec<&Column> = columns.iter().collect();
            let found = incomplete(&columns).into_iter();
            found
                .map(|(index, absent)| (index, absent.iter().map(|q| q.name()).collect()))
                .collect::<Vec<(usize, Vec<String>)>>()
        };
        let needed = |name: &str| vec![name.to_owned()];
        assert_eq!(halves(&["gnss.speed"]), [(0, needed("gnss.course"))]);
        assert_eq!(
            halves(&["steer", "gnss.latitude"]),
            [(1, needed("gnss.longitude"))]
        );
        assert_eq!(halves(&["speed.leftward"]), [(0, needed("speed.forward"))]);
        assert_eq!(
            halves(&["gnss.velocity_up", "gnss.course"])
                .iter()
                .map(|(index, absent)| (*index, absent.len()))
                .collect::<Vec<_>>(),
            [(0, 1), (1, 1)]
        );
        assert!(halves(&["gnss.velocity_up", "gnss.course", "gnss.speed", "gnss.roll"]).is_empty());
        let columns = names(&["steer", "gnss.course", "steer"]);
        let columns: Vec<&Column> = columns.iter().collect();
        assert_eq!(twice(&columns), Some([0, 2]));
        assert_eq!(twice(&columns[..2]), None);
    }
}
