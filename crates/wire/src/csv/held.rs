//! Values that a table repeats until it has new ones.

use super::Format;

/// Leaves out values that a table repeats in [`held_rows`](crate::column::Column::held_rows) rows.
#[derive(Clone, Debug, Default)]
pub struct Held(Vec<Last>);

/// The last value of a column that was handed on.
#[derive(Clone, Copy, Debug, Default)]
struct Last {
    bits: Option<u64>,
    repeats: u32,
}

impl Held {
    /// Takes the values of the next row; those that are no new ones become `None`. A value that stays
    /// the same for more rows is new: the vehicle stands, for example.
    pub fn leave_out(&mut self, format: &Format, values: &mut [Option<f64>]) {
        self.0.resize(format.columns.len(), Last::default());
        let columns = format.columns.iter().map(|(_, column)| column);
        for ((value, column), last) in values.iter_mut().zip(columns).zip(&mut self.0) {
            let Some(bits) = value.map(f64::to_bits).filter(|_| column.held_rows > 1) else {
                continue;
            };
            if last.bits == Some(bits) && last.repeats < column.held_rows {
                last.repeats += 1;
                *value = None;
            } else {
                *last = Last {
                    bits: Some(bits),
                    repeats: 1,
                };
            }
        }
    }
}
