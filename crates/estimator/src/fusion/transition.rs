//! The transition of all states over a step, as few rows.

use super::layout::{BEFORE, FORCE, LAGGED, RATE, SIZE, State};
use crate::trace::Term;

/// Rows that are sums of several states: five of each corner, and the body's angular rates.
pub const MIXED: usize = 23;
/// Most terms of a row: the balanced states and the rate itself.
const TERMS: usize = 49;
/// Forces that are handed on.
pub const FORCES: usize = RATE - FORCE;

/// A row that is a sum.
#[derive(Clone, Copy, Debug)]
pub struct Mixed {
    /// Its state.
    pub index: usize,
    terms: [(u8, f64); TERMS],
    count: usize,
}

impl Mixed {
    const EMPTY: Self = Self {
        index: 0,
        terms: [(0, 0.0); TERMS],
        count: 0,
    };

    /// States and gains.
    pub fn terms(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let terms = self.terms[..self.count].iter();
        terms.map(|(index, gain)| (usize::from(*index), *gain))
    }
}

/// x ← F x: mixed rows; others are kept in part, but for the forces of earlier steps, which are handed on.
#[derive(Clone, Debug)]
pub struct Transition {
    rows: [Mixed; MIXED],
    count: usize,
    /// Factor of each state that is not mixed.
    pub keep: State,
}

impl Transition {
    /// Nothing changes but that the forces of earlier steps are handed on.
    pub fn new() -> Self {
        Self {
            rows: [Mixed::EMPTY; MIXED],
            count: 0,
            keep: [1.0; SIZE],
        }
    }

    /// Adds a mixed row. No term may have an index from [`BEFORE`] on.
    pub fn mix(&mut self, index: usize, terms: impl IntoIterator<Item = (usize, f64)>) {
        let row = &mut self.rows[self.count];
        row.index = index;
        row.count = 0;
        for (state, gain) in terms {
            if gain != 0.0 {
                row.terms[row.count] = (state as u8, gain);
                row.count += 1;
            }
        }
        self.count += 1;
    }

    /// Mixed rows.
    pub fn rows(&self) -> &[Mixed] {
        &self.rows[..self.count]
    }

    /// The state after the transition.
    pub fn apply(&self, state: &State) -> State {
        let mut next: State = std::array::from_fn(|i| self.keep[i] * state[i]);
        for row in self.rows() {
            next[row.index] = row.terms().map(|(i, gain)| gain * state[i]).sum();
        }
        next[BEFORE..LAGGED].copy_from_slice(&state[FORCE..FORCE + FORCES]);
        next[LAGGED..LAGGED + FORCES].copy_from_slice(&state[BEFORE..LAGGED]);
        next
    }

    /// Elements of F - I.
    pub fn change(&self) -> Vec<Term> {
        let mut change = Vec::new();
        let mut mixed = [false; SIZE];
        let mut put = |row, column, value: f64| {
            if value != 0.0 {
                change.push(Term { row, column, value });
            }
        };
        for row in self.rows() {
            mixed[row.index] = true;
            let mut own = -1.0;
            for (column, gain) in row.terms() {
                if column == row.index {
                    own += gain;
                } else {
                    put(row.index, column, gain);
                }
            }
            put(row.index, row.index, own);
        }
        for k in 0..FORCES {
            for (to, from) in [(BEFORE, FORCE), (LAGGED, BEFORE)] {
                put(to + k, from + k, 1.0);
                put(to + k, to + k, -1.0);
                mixed[to + k] = true;
            }
        }
        for (i, keep) in self.keep.iter().enumerate() {
            if !mixed[i] {
                put(i, i, keep - 1.0);
            }
        }
        change
    }
}
