//! One row for each instant, where the messages of a topic tell one wheel, or a part of one, each.

use sample::{Axle, Wheel};

use super::{Column, Table, Values};

impl Table {
    /// Joins consecutive rows that bring different entries of the same instant: the strain of four wheels
    /// comes in eight messages, and becomes one row.
    ///
    /// Rows are joined as long as no entry's column gets a second value, and the later row is at most half
    /// of the entry's interval after the first one. The joined row has the times and the other values of its
    /// last message. A table without columns of wheels or axles stays as it is.
    #[must_use]
    pub fn joined_by_instant(self) -> Self {
        let entries: Vec<usize> = (0..self.columns.len())
            .filter(|column| is_entry(&self.columns[*column].name))
            .collect();
        if entries.is_empty() || self.log_time_ns.len() < 2 {
            return self;
        }
        let starts = self.instants(&entries);
        if starts.len() == self.log_time_ns.len() {
            return self;
        }
        let last: Vec<usize> = ends(&starts, self.log_time_ns.len())
            .map(|end| end - 1)
            .collect();
        let joined = self.columns.iter().map(|column| {
            let rows = if is_entry(&column.name) {
                rows_with_value(column, &starts)
            } else {
                last.clone()
            };
            column.rows(&rows)
        });
        Self {
            columns: joined.collect(),
            log_time_ns: last.iter().map(|row| self.log_time_ns[*row]).collect(),
            publish_time_ns: last.iter().map(|row| self.publish_time_ns[*row]).collect(),
            missing: self.missing,
        }
    }

    /// Adds the rows of `later`, a batch of the same topic.
    pub fn append(&mut self, mut later: Self) {
        self.pad(&later.columns_without_rows());
        later.pad(&self.columns_without_rows());
        self.log_time_ns.append(&mut later.log_time_ns);
        self.publish_time_ns.append(&mut later.publish_time_ns);
        self.missing.append(&mut later.missing);
        for (column, mut more) in self.columns.iter_mut().zip(later.columns) {
            column.values.append(&mut more.values);
            if let (Some(present), Some(mut more)) = (&mut column.present, more.present) {
                present.append(&mut more);
            }
        }
    }

    fn columns_without_rows(&self) -> Vec<Column> {
        self.columns.iter().map(|column| column.rows(&[])).collect()
    }

    /// First rows of the instants.
    fn instants(&self, entries: &[usize]) -> Vec<usize> {
        let times = &self.publish_time_ns;
        let mut span_ns = i64::MAX;
        // Of each row, the last earlier row that has a value in the same column.
        let mut conflict: Vec<Option<usize>> = vec![None; times.len()];
        for column in entries {
            let mut previous = None;
            let mut intervals = Vec::new();
            for row in 0..times.len() {
                if !self.columns[*column].has_value(row) {
                    continue;
                }
                if let Some(previous) = previous {
                    conflict[row] = conflict[row].max(Some(previous));
                    intervals.push(times[row].saturating_sub(times[previous]));
                }
                previous = Some(row);
            }
            let middle = intervals.len() / 2;
            if !intervals.is_empty() {
                span_ns = span_ns.min(*intervals.select_nth_unstable(middle).1 / 2);
            }
        }
        let mut starts = vec![0];
        let mut start = 0;
        for row in 1..times.len() {
            let is_late = times[row].saturating_sub(times[start]).saturating_abs() > span_ns;
            if is_late || conflict[row].is_some_and(|earlier| earlier >= start) {
                starts.push(row);
                start = row;
            }
        }
        starts
    }
}

impl Column {
    /// Whether a row has a value that a message told.
    fn has_value(&self, row: usize) -> bool {
        match (&self.present, &self.values) {
            (Some(present), _) => present[row],
            (None, Values::F64(list)) => !list[row].is_nan(),
            (None, Values::I32(list)) => list[row] != 0,
            (None, Values::I64(list)) => list[row] != 0,
            (None, Values::U32(list)) => list[row] != 0,
            (None, Values::U64(list)) => list[row] != 0,
            (None, Values::Bool(list)) => list[row],
            (None, Values::Text(list)) => !list[row].is_empty(),
            (None, Values::Bytes(list)) => !list[row].is_empty(),
            (None, Values::List { ends, .. }) => {
                let start = row.checked_sub(1).map_or(0, |before| ends[before]);
                ends[row] > start
            }
        }
    }

    /// The same column with these rows.
    fn rows(&self, rows: &[usize]) -> Self {
        let present = self.present.as_ref();
        Self {
            name: self.name.clone(),
            unit: self.unit.clone(),
            names: self.names.clone(),
            values: self.values.rows(rows),
            present: present.map(|present| rows.iter().map(|row| present[*row]).collect()),
        }
    }
}

/// Whether a column is that of a wheel or an axle, by its name.
fn is_entry(name: &str) -> bool {
    let Some((entry, _)) = name.split_once('.') else {
        return false;
    };
    let is = |known: &str| known.eq_ignore_ascii_case(entry);
    Wheel::ALL.into_iter().any(|wheel| is(wheel.abbreviation()))
        || Axle::ALL.into_iter().any(|axle| is(axle.name()))
        || entry.starts_with("axle")
}

/// For each instant, the row that has a value of the column; the last row where none has.
fn rows_with_value(column: &Column, starts: &[usize]) -> Vec<usize> {
    let pairs = starts.iter().zip(ends(starts, column.values.len()));
    let rows = pairs.map(|(start, end)| {
        let found = (*start..end).find(|row| column.has_value(*row));
        found.unwrap_or(end - 1)
    });
    rows.collect()
}

/// Ends of the instants that begin at these rows.
fn ends(starts: &[usize], rows: usize) -> impl Iterator<Item = usize> {
    starts.iter().skip(1).copied().chain([rows])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str, values: &[f64]) -> Column {
        Column {
            name: name.to_owned(),
            unit: String::new(),
            names: Vec::new(),
            values: Values::F64(values.to_vec()),
            present: None,
        }
    }

    fn table(times_us: &[i64], columns: Vec<Column>) -> Table {
        let times: Vec<i64> = times_us.iter().map(|time| time * 1_000).collect();
        Table {
            log_time_ns: times.iter().map(|time| time + 1).collect(),
            publish_time_ns: times,
            columns,
            missing: Vec::new(),
        }
    }

    fn numbers(table: &Table, column: usize) -> Vec<f64> {
        match &table.columns[column].values {
            Values::F64(list) => list.clone(),
            other => panic!("{other:?}"),
        }
    }

    const NONE: f64 = f64::NAN;

    #[test]
    fn messages_of_an_instant_become_a_row() {
        let found = table(
            &[0, 200, 10_000, 10_200, 20_000, 20_200],
            vec![
                column("fl.raw_counts", &[1.0, NONE, 2.0, NONE, 3.0, NONE]),
                column("rr.raw_counts", &[NONE, 4.0, NONE, 5.0, NONE, 6.0]),
                column("device_time.ms", &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
            ],
        )
        .joined_by_instant();
        assert_eq!(found.publish_time_ns, [200_000, 10_200_000, 20_200_000]);
        assert_eq!(found.log_time_ns, [200_001, 10_200_001, 20_200_001]);
        assert_eq!(numbers(&found, 0), [1.0, 2.0, 3.0]);
        assert_eq!(numbers(&found, 1), [4.0, 5.0, 6.0]);
        assert_eq!(numbers(&found, 2), [1.0, 3.0, 5.0]);
    }

    #[test]
    fn a_lost_message_leaves_a_hole_and_not_a_shift() {
        let found = table(
            &[0, 200, 10_000, 20_000, 20_200, 30_000, 30_200],
            vec![
                column("fl.z_n", &[1.0, NONE, 2.0, 3.0, NONE, 4.0, NONE]),
                column("fr.z_n", &[NONE, 5.0, NONE, NONE, 6.0, NONE, 7.0]),
            ],
        )
        .joined_by_instant();
        assert_eq!(numbers(&found, 0), [1.0, 2.0, 3.0, 4.0]);
        let right = numbers(&found, 1);
        assert!(right[1].is_nan());
        assert_eq!([right[0], right[2], right[3]], [5.0, 6.0, 7.0]);
    }

    #[test]
    fn a_log_that_begins_within_an_instant_is_joined_by_time() {
        let found = table(
            &[200, 10_000, 10_200, 20_000, 20_200],
            vec![
                column("fl.z_n", &[NONE, 1.0, NONE, 2.0, NONE]),
                column("fr.z_n", &[3.0, NONE, 4.0, NONE, 5.0]),
            ],
        )
        .joined_by_instant();
        assert_eq!(numbers(&found, 1), [3.0, 4.0, 5.0]);
        assert!(numbers(&found, 0)[0].is_nan());
    }

    #[test]
    fn topics_without_entries_keep_equal_times() {
        let before = table(&[0, 0, 5], vec![column("speed_m_s", &[1.0, NONE, 2.0])]);
        assert_eq!(
            before.clone().joined_by_instant().log_time_ns,
            before.log_time_ns
        );
    }

    #[test]
    fn batches_are_appended_although_columns_were_added() {
        let mut first = table(&[0], vec![column("fl.z_n", &[1.0])]);
        let columns = vec![column("fl.z_n", &[2.0]), column("axle3_left.z_n", &[3.0])];
        first.append(table(&[10], columns));
        assert_eq!(numbers(&first, 0), [1.0, 2.0]);
        let third = numbers(&first, 1);
        assert!(third[0].is_nan());
        assert_eq!(third[1..], [3.0]);
    }
}
