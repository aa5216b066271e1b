//! Columns of a topic on one time grid.

use std::collections::BTreeMap;
use std::sync::Arc;

use store::{Table, Values};

/// Longest gap between samples that a curve crosses, s.
pub const GAP_S: f64 = 1.0;

/// Columns of a topic, in 32 bits: an hour of all curves must fit into the memory of a small computer.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Seconds since the start of the drive; frames of the same instants share them.
    pub time_s: Arc<Vec<f64>>,
    columns: BTreeMap<String, Vec<f32>>,
    /// Number of rows that the log has. Columns that grow in steps would leave holes in the memory.
    expected: usize,
}

impl Frame {
    /// A frame of a topic with a number of messages.
    pub fn expecting(expected: usize) -> Self {
        Self {
            expected,
            ..Self::default()
        }
    }

    /// Shares the times of another frame if they are the same.
    pub fn share_times(&mut self, other: &Self) {
        if self.time_s == other.time_s {
            self.time_s = Arc::clone(&other.time_s);
        }
    }

    /// Times to which rows are added.
    fn times(&mut self) -> &mut Vec<f64> {
        let times = Arc::make_mut(&mut self.time_s);
        if times.is_empty() {
            times.reserve_exact(self.expected);
        }
        times
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Adds the rows of a table; `wants` chooses the columns.
    pub fn extend(&mut self, table: &Table, start_ns: u64, wants: impl Fn(&str) -> bool) {
        let before = self.time_s.len();
        let start = start_ns.cast_signed();
        let times = table.publish_time_ns.iter();
        self.times()
            .extend(times.map(|ns| ns.saturating_sub(start) as f64 * 1e-9));
        for column in table.columns.iter().filter(|column| wants(&column.name)) {
            if !is_number(&column.values) {
                continue;
            }
            if !self.columns.contains_key(&column.name) {
                let values = Vec::with_capacity(self.expected);
                self.columns.insert(column.name.clone(), values);
            }
            if let Some(values) = self.columns.get_mut(&column.name) {
                values.resize(before, f32::NAN);
                extend(values, &column.values);
                for (value, is_present) in values[before..]
                    .iter_mut()
                    .zip(column.present.iter().flatten())
                {
                    if !is_present {
                        *value = f32::NAN;
                    }
                }
            }
        }
        let rows = self.time_s.len();
        for values in self.columns.values_mut() {
            values.resize(rows, f32::NAN);
        }
    }

    /// Adds the rows of a table in which a column has a value, with that column alone.
    pub fn extend_present(&mut self, table: &Table, start_ns: u64, name: &str) {
        let Some(column) = table.columns.iter().find(|column| column.name == name) else {
            return;
        };
        let mut values = Vec::new();
        extend(&mut values, &column.values);
        let start = start_ns.cast_signed();
        let mut sink = self
            .columns
            .remove(name)
            .unwrap_or_else(|| Vec::with_capacity(self.expected));
        let times = self.times();
        for (row, (time_ns, value)) in table.publish_time_ns.iter().zip(values).enumerate() {
            let is_present = column.present.as_ref().is_none_or(|present| present[row]);
            if is_present && value.is_finite() {
                times.push(time_ns.saturating_sub(start) as f64 * 1e-9);
                sink.push(value);
            }
        }
        self.columns.insert(name.to_owned(), sink);
    }

    /// Sorts the rows by time, if they are not, and removes columns without a finite value.
    pub fn finish(&mut self) {
        if !self.time_s.is_sorted() {
            let mut order: Vec<usize> = (0..self.time_s.len()).collect();
            order.sort_by(|a, b| self.time_s[*a].total_cmp(&self.time_s[*b]));
            let times: Vec<f64> = order.iter().map(|row| self.time_s[*row]).collect();
            self.time_s = Arc::new(times);
            for values in self.columns.values_mut() {
                *values = order.iter().map(|row| values[*row]).collect();
            }
        }
        self.columns
            .retain(|_, values| values.iter().any(|value| value.is_finite()));
        for values in self.columns.values_mut() {
            values.shrink_to_fit();
        }
        Arc::make_mut(&mut self.time_s).shrink_to_fit();
    }

    /// A column, if it has a finite value.
    pub fn get(&self, name: &str) -> Option<&[f32]> {
        self.columns.get(name).map(Vec::as_slice)
    }

    /// A frame without columns.
    #[cfg(test)]
    pub fn at(time_s: Vec<f64>) -> Self {
        Self {
            time_s: Arc::new(time_s),
            ..Self::default()
        }
    }

    /// Adds a column.
    #[cfg(test)]
    pub fn set(&mut self, name: impl Into<String>, values: Vec<f32>) {
        self.columns.insert(name.into(), values);
    }

    /// The columns at the times of `grid`: by a straight line between neighbours that are at most
    /// [`GAP_S`] apart, else NaN.
    pub fn on(&self, grid: &[f64]) -> Self {
        if **self.time_s == *grid {
            return self.clone();
        }
        let weights = weights(&self.time_s, grid);
        let mut all = Self {
            time_s: Arc::new(grid.to_vec()),
            ..Self::default()
        };
        for (name, values) in &self.columns {
            let at = weights.iter().map(|(index, part)| {
                if *index == usize::MAX {
                    return f32::NAN;
                }
                let next = values.get(index + 1).copied().unwrap_or(f32::NAN);
                match *part {
                    0.0 => values[*index],
                    part => values[*index] + part * (next - values[*index]),
                }
            });
            all.columns.insert(name.clone(), at.collect());
        }
        all
    }

    /// Positions after which a gap follows.
    pub fn gaps(&self) -> Vec<[f64; 2]> {
        let pairs = self.time_s.windows(2);
        pairs
            .filter(|pair| pair[1] - pair[0] > GAP_S)
            .map(|pair| [pair[0], pair[1]])
            .collect()
    }
}

/// For each time of the grid the sample before it and the part of the way to the next one.
fn weights(times: &[f64], grid: &[f64]) -> Vec<(usize, f32)> {
    /// Times that are this near each other are the same, s.
    const SAME_S: f64 = 1e-6;
    let mut next = 0;
    grid.iter()
        .map(|time| {
            while next < times.len() && times[next] <= time + SAME_S {
                next += 1;
            }
            let Some(index) = next.checked_sub(1) else {
                return (usize::MAX, 0.0);
            };
            let past = time - times[index];
            if past.abs() <= SAME_S {
                return (index, 0.0);
            }
            match times.get(next) {
                Some(after) if after - times[index] <= GAP_S => {
                    (index, (past / (after - times[index])) as f32)
                }
                _ => (usize::MAX, 0.0),
            }
        })
        .collect()
}

const fn is_number(values: &Values) -> bool {
    matches!(
        values,
        Values::F64(_)
            | Values::I32(_)
            | Values::I64(_)
            | Values::U32(_)
            | Values::U64(_)
            | Values::Bool(_)
    )
}

fn extend(sink: &mut Vec<f32>, values: &Values) {
    match values {
        Values::F64(list) => sink.extend(list.iter().map(|value| *value as f32)),
        Values::I32(list) => sink.extend(list.iter().map(|value| *value as f32)),
        Values::I64(list) => sink.extend(list.iter().map(|value| *value as f32)),
        Values::U32(list) => sink.extend(list.iter().map(|value| *value as f32)),
        Values::U64(list) => sink.extend(list.iter().map(|value| *value as f32)),
        Values::Bool(list) => sink.extend(list.iter().map(|value| f32::from(u8::from(*value)))),
        Values::Text(_) | Values::Bytes(_) | Values::List { .. } => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_to_another_grid_and_do_not_cross_a_gap() {
        let mut frame = Frame {
            time_s: Arc::new(vec![0.0, 0.1, 5.0, 5.1]),
            ..Frame::default()
        };
        frame.set("a", vec![0.0, 1.0, 2.0, 3.0]);
        let on = frame.on(&[-1.0, 0.0, 0.05, 0.1, 2.0, 5.1, 6.0]);
        let found: Vec<String> = on
            .get("a")
            .unwrap()
            .iter()
            .map(|v| format!("{v:.2}"))
            .collect();
        assert_eq!(found, ["NaN", "0.00", "0.50", "1.00", "NaN", "3.00", "NaN"]);
        assert_eq!(frame.gaps(), [[0.1, 5.0]]);
    }
}
