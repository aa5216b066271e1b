//! Values at times between those of a column.

use super::Method;
use crate::{Column, Values};

/// Where the value of each target is.
pub(super) struct Places(Vec<Option<Place>>);

/// Rows before and after a target, with the part of the way between them.
#[derive(Clone, Copy)]
struct Place {
    before: usize,
    after: usize,
    /// In [0, 1].
    part: f64,
}

impl Place {
    const fn at(row: usize) -> Self {
        Self {
            before: row,
            after: row,
            part: 0.0,
        }
    }
}

impl Places {
    /// The arguments are those of [`super::align`]; `rows` are the rows with a value in the order of time.
    pub fn new(
        times_ns: &[i64],
        rows: &[usize],
        targets_ns: &[i64],
        method: Method,
        max_gap_ns: i64,
    ) -> Self {
        let mut next = 0;
        let places = targets_ns.iter().map(|target_ns| {
            while rows
                .get(next)
                .is_some_and(|row| times_ns[*row] <= *target_ns)
            {
                next += 1;
            }
            let before = next.checked_sub(1).map(|at| rows[at]);
            let after = rows.get(next).copied();
            let since_ns = |row: usize| target_ns.abs_diff(times_ns[row]);
            let limit_ns = max_gap_ns.unsigned_abs();
            match method {
                Method::Previous => before
                    .filter(|row| since_ns(*row) <= limit_ns)
                    .map(Place::at),
                Method::Nearest => {
                    let both = [before, after].into_iter().flatten();
                    let nearest = both.min_by_key(|row| since_ns(*row));
                    nearest
                        .filter(|row| since_ns(*row) <= limit_ns / 2)
                        .map(Place::at)
                }
                Method::Linear => match (before, after) {
                    (Some(row), _) if since_ns(row) == 0 => Some(Place::at(row)),
                    (Some(before), Some(after)) => {
                        let interval_ns = times_ns[after].abs_diff(times_ns[before]);
                        (interval_ns <= limit_ns).then(|| Place {
                            before,
                            after,
                            part: since_ns(before) as f64 / interval_ns as f64,
                        })
                    }
                    _ => None,
                },
            }
        });
        Self(places.collect())
    }

    /// Which targets have a value.
    pub fn present(&self) -> Vec<bool> {
        self.0.iter().map(Option::is_some).collect()
    }

    /// A value for each target: `between` for those that have one.
    fn each<T>(&self, absent: &T, between: impl Fn(Place) -> T) -> Vec<T>
    where
        T: Clone,
    {
        let places = self.0.iter();
        places
            .map(|place| place.map_or_else(|| absent.clone(), &between))
            .collect()
    }
}

/// The values of a column at the places, and whether they are floating-point numbers.
pub(super) fn values(column: &Column, places: &Places) -> (Values, bool) {
    let values = match &column.values {
        Values::F64(list) => {
            let circle = circle(column);
            let between =
                |place: Place| number(list[place.before], list[place.after], place, circle);
            return (Values::F64(places.each(&f64::NAN, between)), true);
        }
        Values::I32(list) => Values::I32(places.each(&0, |place| {
            let [a, b] = [place.before, place.after].map(|row| list[row].into());
            // Between two values of the type.
            i32::try_from(integer(a, b, place)).unwrap_or_default()
        })),
        Values::I64(list) => Values::I64(places.each(&0, |place| {
            let [a, b] = [place.before, place.after].map(|row| list[row].into());
            i64::try_from(integer(a, b, place)).unwrap_or_default()
        })),
        Values::U32(list) => Values::U32(places.each(&0, |place| {
            let [a, b] = [place.before, place.after].map(|row| list[row].into());
            u32::try_from(integer(a, b, place)).unwrap_or_default()
        })),
        Values::U64(list) => Values::U64(places.each(&0, |place| {
            let [a, b] = [place.before, place.after].map(|row| list[row].into());
            u64::try_from(integer(a, b, place)).unwrap_or_default()
        })),
        Values::Bool(list) => Values::Bool(places.each(&false, |place| list[place.before])),
        Values::Text(list) => {
            Values::Text(places.each(&String::new(), |place| list[place.before].clone()))
        }
        Values::Bytes(list) => {
            Values::Bytes(places.each(&Vec::new(), |place| list[place.before].clone()))
        }
        Values::List { values, .. } => Values::List {
            ends: vec![0; places.0.len()],
            values: Box::new(values.empty(0)),
        },
    };
    (values, false)
}

/// A number between two others. The numbers at both ends keep their bits.
fn number(a: f64, b: f64, place: Place, circle: Option<f64>) -> f64 {
    if place.part == 0.0 || a.to_bits() == b.to_bits() {
        return a;
    }
    let difference = b - a;
    let Some(circle) = circle.filter(|circle| difference.abs() > circle / 2.0) else {
        return a + difference * place.part;
    };
    let shorter = difference - (difference / circle).round() * circle;
    let lowest = if a >= 0.0 && b >= 0.0 {
        0.0
    } else {
        -circle / 2.0
    };
    (a + shorter * place.part - lowest).rem_euclid(circle) + lowest
}

/// An integer between two others, rounded.
fn integer(a: i128, b: i128, place: Place) -> i128 {
    if place.part == 0.0 {
        return a;
    }
    a + ((b - a) as f64 * place.part).round() as i128
}

/// The circle of a column of angles, in its unit.
fn circle(column: &Column) -> Option<f64> {
    let is_angle = |unit| column.unit == unit || column.name.ends_with(&format!("_{unit}"));
    if is_angle("rad") {
        Some(std::f64::consts::TAU)
    } else if is_angle("deg") {
        Some(360.0)
    } else {
        None
    }
}
