//! Columns of a topic on one time grid.

mod instants;

use std::collections::BTreeMap;
use std::sync::Arc;

use store::{Table, Values};

pub use instants::CommonInstants;

/// Longest gap between samples that a curve crosses, s.
pub const GAP_S: f64 = 1.0;

/// Longest drive of which every sample is kept, s ...
const WHOLE_S: f64 = 3700.0;
/// ... and most samples of a topic in a longer one.
const WHOLE: usize = 370_000;
/// Samples that are kept of a longer drive.
const KEPT: f64 = 270_000.0;
/// Kept samples to a stretch whose least and greatest values are kept.
const KEPT_TO_STRETCH: f64 = 10.0;

/// Which samples of a drive are kept. Of a long drive one in each slot of time is kept, and the least and
/// the greatest of all samples in each stretch, so that the memory does not grow with its length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thinning {
    begin_s: f64,
    /// Length of a slot, s; zero: every sample is kept.
    slot_s: f64,
}

impl Thinning {
    /// For a part of a drive, s, in which no topic has more samples than `most`.
    pub fn of([begin_s, end_s]: [f64; 2], most: usize) -> Self {
        let duration_s = end_s - begin_s;
        let slot_s = if duration_s > WHOLE_S && most > WHOLE {
            duration_s / KEPT
        } else {
            0.0
        };
        Self { begin_s, slot_s }
    }

    /// Whether samples are left out.
    pub fn is_on(self) -> bool {
        self.slot_s > 0.0
    }

    /// What is left out, in words; `None` if every sample is kept.
    pub fn statement(self) -> Option<String> {
        self.is_on().then(|| {
            format!(
                "one in each {:.3} s, and the least and greatest of all in each {:.2} s",
                self.slot_s,
                self.stretch_s(0.0)
            )
        })
    }

    /// Most samples that are kept of `count`.
    pub fn kept_of(self, count: usize) -> usize {
        match self.is_on() {
            true => count.min(KEPT as usize + 2),
            false => count,
        }
    }

    /// `limit_s`, or two slots if that is more: samples so far apart have a gap between them.
    pub fn gap_s(self, limit_s: f64) -> f64 {
        limit_s.max(2.0 * self.slot_s)
    }

    /// `least_s`, or the length of a stretch if that is more.
    pub fn stretch_s(self, least_s: f64) -> f64 {
        least_s.max(KEPT_TO_STRETCH * self.slot_s)
    }

    fn slot(self, time_s: f64) -> i64 {
        ((time_s - self.begin_s) / self.slot_s).floor() as i64
    }
}

/// Columns of a topic, in 32 bits: an hour of all curves must fit into the memory of a small computer.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Seconds since the start of the drive; frames of the same instants share them. Complete after
    /// [`Frame::finish`].
    pub time_s: Arc<Vec<f64>>,
    /// While the log is read: instants of several frames, and how many of them this frame has. `None`:
    /// `time_s` has them.
    common: Option<(CommonInstants, usize)>,
    columns: BTreeMap<String, Vec<f32>>,
    /// Number of rows that are kept. Columns that grow in steps would leave holes in the memory.
    expected: usize,
    thinning: Thinning,
    /// Number of samples, kept or not.
    samples: usize,
    /// Slot of the last row.
    last_slot: Option<i64>,
    /// Least and greatest value of each stretch, of a frame that leaves samples out.
    stretches: BTreeMap<String, Vec<[f32; 2]>>,
}

impl Frame {
    /// A frame of a topic with a number of messages.
    pub fn expecting(expected: usize, thinning: Thinning) -> Self {
        Self {
            expected: thinning.kept_of(expected),
            thinning,
            ..Self::default()
        }
    }

    /// Shares instants with other frames while they are equal.
    pub fn sharing(mut self, instants: &CommonInstants) -> Self {
        self.common = Some((instants.clone(), 0));
        self
    }

    /// Which samples are kept.
    pub const fn thinning(&self) -> Thinning {
        self.thinning
    }

    /// Middle, least and greatest value of each stretch with a value; `None` if every sample is kept.
    pub fn stretches(&self, name: &str) -> Option<impl Iterator<Item = (f64, [f32; 2])>> {
        let Thinning { begin_s, slot_s } = self.thinning;
        let length_s = KEPT_TO_STRETCH * slot_s;
        let all = self.stretches.get(name)?.iter().enumerate();
        Some(
            all.filter(|(_, [low, _])| low.is_finite())
                .map(move |(index, values)| (begin_s + (index as f64 + 0.5) * length_s, *values)),
        )
    }

    /// Least and greatest of all samples of a column, kept or not.
    pub fn range(&self, name: &str) -> Option<[f32; 2]> {
        let add = |[least, greatest]: [f32; 2], [low, high]: [f32; 2]| {
            [least.min(low), greatest.max(high)]
        };
        let nothing = [f32::INFINITY, f32::NEG_INFINITY];
        let found = match self.stretches(name) {
            Some(all) => all.map(|(_, values)| values).fold(nothing, add),
            None => {
                let all = self.get(name)?.iter().filter(|value| value.is_finite());
                all.map(|value| [*value; 2]).fold(nothing, add)
            }
        };
        (found[0] <= found[1]).then_some(found)
    }

    /// The rows of a batch that are kept.
    fn keep(&mut self, times: &[f64]) -> Vec<usize> {
        self.samples += times.len();
        let thinning = self.thinning;
        let last = &mut self.last_slot;
        let is_kept = |row: &usize| {
            !thinning.is_on() || {
                let slot = Some(thinning.slot(times[*row]));
                std::mem::replace(last, slot) != slot
            }
        };
        (0..times.len()).filter(is_kept).collect()
    }

    /// Adds all samples of a batch to their stretches.
    fn widen(&mut self, name: &str, times: &[f64], values: &[f32]) {
        if !self.thinning.is_on() {
            return;
        }
        let most = (KEPT / KEPT_TO_STRETCH) as usize;
        let new = || Vec::with_capacity(most + 1);
        let stretches = self.stretches.entry(name.to_owned()).or_insert_with(new);
        let finite = times
            .iter()
            .zip(values)
            .filter(|(_, value)| value.is_finite());
        for (time_s, value) in finite {
            let place = self.thinning.slot(*time_s).max(0) / KEPT_TO_STRETCH as i64;
            let place = (place as usize).min(most);
            if place >= stretches.len() {
                stretches.resize(place + 1, [f32::NAN; 2]);
            }
            let [low, high] = &mut stretches[place];
            // A number replaces NaN.
            (*low, *high) = (low.min(*value), high.max(*value));
        }
    }

    /// Shares the times of another frame if they are the same.
    pub fn share_times(&mut self, times: &Arc<Vec<f64>>) {
        if self.time_s == *times {
            self.time_s = Arc::clone(times);
        }
    }

    /// Adds the times of new rows.
    fn add_times(&mut self, new: &[f64]) {
        if let Some((instants, count)) = &mut self.common {
            if instants.go_on(*count, new, self.expected) {
                *count += new.len();
                return;
            }
            self.leave_common();
        }
        let times = Arc::make_mut(&mut self.time_s);
        times.reserve_exact(self.expected.saturating_sub(times.len()));
        times.extend_from_slice(new);
    }

    /// From now on `time_s` has the instants.
    fn leave_common(&mut self) {
        if let Some((instants, count)) = self.common.take() {
            self.time_s = instants.first(count);
        }
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Samples, kept or not.
    pub const fn samples(&self) -> usize {
        self.samples
    }

    /// Samples that are kept.
    pub fn len(&self) -> usize {
        match &self.common {
            Some((_, count)) => *count,
            None => self.time_s.len(),
        }
    }

    /// Adds the rows of a table; `wants` chooses the columns.
    pub fn extend(&mut self, table: &Table, start_ns: u64, wants: impl Fn(&str) -> bool) {
        let before = self.len();
        let batch = batch_times(table, start_ns);
        let kept = self.keep(&batch);
        self.add_times(&chosen(&kept, &batch));
        for column in table.columns.iter().filter(|column| wants(&column.name)) {
            if !is_number(&column.values) {
                continue;
            }
            let mut values = Vec::new();
            extend(&mut values, &column.values);
            for (value, is_present) in values.iter_mut().zip(column.present.iter().flatten()) {
                if !is_present {
                    *value = f32::NAN;
                }
            }
            self.widen(&column.name, &batch, &values);
            if !self.columns.contains_key(&column.name) {
                let values = Vec::with_capacity(self.expected);
                self.columns.insert(column.name.clone(), values);
            }
            if let Some(sink) = self.columns.get_mut(&column.name) {
                sink.resize(before, f32::NAN);
                sink.extend(kept.iter().map(|row| values[*row]));
            }
        }
        let rows = self.len();
        for values in self.columns.values_mut() {
            values.resize(rows, f32::NAN);
        }
    }

    /// Adds the rows of a table in which a column has a value, with that column alone.
    pub fn extend_present(&mut self, table: &Table, start_ns: u64, name: &str) {
        let Some(column) = table.columns.iter().find(|column| column.name == name) else {
            return;
        };
        let mut all = Vec::new();
        extend(&mut all, &column.values);
        let (mut times, mut values) = (Vec::new(), Vec::new());
        let rows = batch_times(table, start_ns).into_iter().zip(all);
        for (row, (time_s, value)) in rows.enumerate() {
            let is_present = column.present.as_ref().is_none_or(|present| present[row]);
            if is_present && value.is_finite() {
                times.push(time_s);
                values.push(value);
            }
        }
        let kept = self.keep(&times);
        self.widen(name, &times, &values);
        let mut sink = self
            .columns
            .remove(name)
            .unwrap_or_else(|| Vec::with_capacity(self.expected));
        sink.extend(kept.iter().map(|row| values[*row]));
        self.add_times(&chosen(&kept, &times));
        self.columns.insert(name.to_owned(), sink);
    }

    /// Sorts the rows by time, if they are not, and removes columns without a finite value.
    pub fn finish(&mut self) {
        self.leave_common();
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
        let columns = &self.columns;
        self.stretches.retain(|name, _| columns.contains_key(name));
        for values in self.columns.values_mut() {
            values.shrink_to_fit();
        }
        if let Some(times) = Arc::get_mut(&mut self.time_s) {
            times.shrink_to_fit();
        }
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

    /// Frees the samples. Their number stays known.
    pub fn free(&mut self) {
        *self = Self {
            samples: self.samples,
            thinning: self.thinning,
            ..Self::default()
        };
    }

    /// The columns at the times of `grid`: by a straight line between neighbours that are at most
    /// [`GAP_S`] apart, else NaN.
    pub fn on(mut self, grid: &Arc<Vec<f64>>) -> Self {
        if self.time_s == *grid {
            return self;
        }
        let mut all = Self {
            time_s: Arc::clone(grid),
            ..Self::default()
        };
        // One column after the other, so that memory for one more is enough.
        while let Some((name, values)) = self.columns.pop_first() {
            let at = weights(&self.time_s, grid).map(|place| {
                let Some((index, part)) = place else {
                    return f32::NAN;
                };
                let next = values.get(index + 1).copied().unwrap_or(f32::NAN);
                match part {
                    0.0 => values[index],
                    part => values[index] + part * (next - values[index]),
                }
            });
            all.columns.insert(name, at.collect());
        }
        all
    }

    /// Positions after which a gap follows.
    pub fn gaps(&self) -> Vec<[f64; 2]> {
        let gap_s = self.thinning.gap_s(GAP_S);
        let pairs = self.time_s.windows(2);
        pairs
            .filter(|pair| pair[1] - pair[0] > gap_s)
            .map(|pair| [pair[0], pair[1]])
            .collect()
    }
}

fn chosen(kept: &[usize], times: &[f64]) -> Vec<f64> {
    kept.iter().map(|row| times[*row]).collect()
}

/// For each time of the grid the sample before it and the part of the way to the next one; `None` in a gap.
fn weights(times: &[f64], grid: &[f64]) -> impl Iterator<Item = Option<(usize, f32)>> {
    /// Times that are this near each other are the same, s.
    const SAME_S: f64 = 1e-6;
    let mut next = 0;
    grid.iter().map(move |time| {
        while next < times.len() && times[next] <= time + SAME_S {
            next += 1;
        }
        let index = next.checked_sub(1)?;
        let past = time - times[index];
        if past.abs() <= SAME_S {
            return Some((index, 0.0));
        }
        let after = times.get(next)?;
        let step_s = after - times[index];
        (step_s <= GAP_S).then(|| (index, (past / step_s) as f32))
    })
}

/// Seconds of the rows of a table since the start of the drive.
fn batch_times(table: &Table, start_ns: u64) -> Vec<f64> {
    let start = start_ns.cast_signed();
    let times = table.publish_time_ns.iter();
    times
        .map(|ns| ns.saturating_sub(start) as f64 * 1e-9)
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

    fn table(times_s: impl Iterator<Item = f64>, value: impl Fn(f64) -> f64) -> Table {
        let times: Vec<f64> = times_s.collect();
        Table {
            publish_time_ns: times.iter().map(|time_s| (time_s * 1e9) as i64).collect(),
            columns: vec![store::Column {
                name: "a".to_owned(),
                unit: String::new(),
                names: Vec::new(),
                values: Values::F64(times.iter().map(|time_s| value(*time_s)).collect()),
                present: None,
            }],
            ..Table::default()
        }
    }

    /// A peak of one sample is in the range and in its stretch, whether the sample is kept or not.
    #[test]
    fn a_long_drive_keeps_few_samples_and_every_peak() {
        const HOURS: f64 = 10.0;
        let thinning = Thinning::of([0.0, HOURS * 3600.0], 600_001);
        let is_on = |end_s, most| Thinning::of([0.0, end_s], most).is_on();
        assert!(thinning.is_on() && !is_on(3600.0, 720_000) && !is_on(86_400.0, 1000));
        let peak_s = 20_000.013;
        for own in [true, false] {
            let mut frame = Frame::expecting(3_600_000, thinning);
            for minute in 0..(60.0 * HOURS) as u32 {
                let begin_s = 60.0 * f64::from(minute);
                let times = (0..1000).map(|k| begin_s + 0.06 * f64::from(k));
                let times = times.chain(
                    (begin_s..begin_s + 60.0)
                        .contains(&peak_s)
                        .then_some(peak_s),
                );
                let batch = table(times, |t| if t == peak_s { -7.0 } else { 1.0 });
                match own {
                    true => frame.extend(&batch, 0, |_| true),
                    false => frame.extend_present(&batch, 0, "a"),
                }
            }
            frame.finish();
            let most = KEPT as usize + 2;
            let kept = frame.len();
            assert!((most * 95 / 100..=most).contains(&kept), "{kept}");
            assert_eq!(frame.samples(), 600_001);
            assert_eq!(frame.range("a"), Some([-7.0, 1.0]));
            let mut lows = frame
                .stretches("a")
                .unwrap()
                .filter(|(_, [low, _])| *low == -7.0);
            let (middle_s, [_, high]) = lows.next().unwrap();
            assert!(
                (middle_s - peak_s).abs() <= 0.5 * thinning.stretch_s(0.0) && high == 1.0,
                "{middle_s}"
            );
            assert!(lows.next().is_none() && frame.gaps().is_empty());
        }
    }

    #[test]
    fn columns_come_to_another_grid_and_do_not_cross_a_gap() {
        let mut frame = Frame {
            time_s: Arc::new(vec![0.0, 0.1, 5.0, 5.1]),
            ..Frame::default()
        };
        frame.set("a", vec![0.0, 1.0, 2.0, 3.0]);
        let on = frame
            .clone()
            .on(&Arc::new(vec![-1.0, 0.0, 0.05, 0.1, 2.0, 5.1, 6.0]));
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
