//! Which multiplexor selects which signal.

use std::collections::HashMap;
use std::ops::RangeInclusive;

use can_dbc::{Message, MultiplexIndicator};

use super::index::key;
use super::load::Loader;
use super::{RawKind, Selector, SignalDef};

/// Longest list of values of a multiplexor that select one signal, ranges.
const RANGES_MAX: usize = 4_096;

impl Loader<'_> {
    /// Gives the multiplexed signals of a message their selectors.
    pub(super) fn select(&mut self, message: &Message, signals: &mut [SignalDef]) {
        let id = key(message.id);
        let positions: HashMap<String, usize> = signals
            .iter()
            .enumerate()
            .rev()
            .map(|(position, signal)| (signal.name.clone(), position))
            .collect();
        let switches: Vec<usize> = (0..message.signals.len())
            .filter(|index| {
                message.signals[*index].multiplexer_indicator == MultiplexIndicator::Multiplexor
            })
            .collect();
        for (index, signal) in message.signals.iter().enumerate() {
            let entry = self
                .index
                .selectors
                .get(&(id, signal.name.as_str()))
                .copied();
            let selector = if let Some(entry) = entry {
                let name = &entry.multiplexor_signal_name;
                let Some(multiplexor) = positions.get(name).copied() else {
                    let text = format!("is selected by {name}, which the message does not have");
                    self.signal_error(&message.name, &signal.name, text);
                    continue;
                };
                let values = entry.mappings.iter().map(|m| m.min_value..=m.max_value);
                let values = merged(values.collect());
                if values.len() > RANGES_MAX {
                    let text = format!(
                        "is selected by {} ranges; it may be {RANGES_MAX}",
                        values.len()
                    );
                    self.signal_error(&message.name, &signal.name, text);
                }
                Selector {
                    multiplexor,
                    values,
                }
            } else {
                let (MultiplexIndicator::MultiplexedSignal(value)
                | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value)) =
                    signal.multiplexer_indicator
                else {
                    continue;
                };
                let [multiplexor] = switches[..] else {
                    let text = format!(
                        "is multiplexed, but its message has {} multiplexors marked M; say which \
                         one selects it with SG_MUL_VAL_",
                        switches.len()
                    );
                    self.signal_error(&message.name, &signal.name, text);
                    continue;
                };
                Selector {
                    multiplexor,
                    values: vec![value..=value],
                }
            };
            signals[index].selector = Some(selector);
        }
        self.check_multiplexors(message, signals);
    }

    /// Multiplexors must be integers and must not select each other in a ring.
    fn check_multiplexors(&mut self, message: &Message, signals: &mut [SignalDef]) {
        for index in 0..signals.len() {
            let Some(selector) = &signals[index].selector else {
                continue;
            };
            let multiplexor = &signals[selector.multiplexor];
            if matches!(multiplexor.kind, RawKind::Float | RawKind::Double) {
                let text = "is floating-point and cannot be a multiplexor".to_owned();
                let name = multiplexor.name.clone();
                self.signal_error(&message.name, &name, text);
            }
        }
        for index in rings(signals) {
            let text = "selects itself through its multiplexors".to_owned();
            let name = signals[index].name.clone();
            self.signal_error(&message.name, &name, text);
        }
    }
}

/// The same values in the fewest ranges, in order.
fn merged(mut ranges: Vec<RangeInclusive<u64>>) -> Vec<RangeInclusive<u64>> {
    ranges.retain(|range| !range.is_empty());
    ranges.sort_unstable_by_key(|range| *range.start());
    let mut merged: Vec<RangeInclusive<u64>> = Vec::new();
    for range in ranges {
        match merged.last_mut() {
            Some(last) if *range.start() <= last.end().saturating_add(1) => {
                *last = *last.start()..=*last.end().max(range.end());
            }
            _ => merged.push(range),
        }
    }
    merged
}

/// The signals that select themselves through their multiplexors.
fn rings(signals: &[SignalDef]) -> Vec<usize> {
    // 0: not seen; else the walk that saw it first.
    let mut seen = vec![0; signals.len()];
    let mut found = Vec::new();
    let next = |at: usize| {
        signals[at]
            .selector
            .as_ref()
            .map(|selector| selector.multiplexor)
    };
    for start in 0..signals.len() {
        let walk = start + 1;
        let mut at = Some(start);
        while let Some(index) = at.filter(|index| seen[*index] == 0) {
            seen[index] = walk;
            at = next(index);
        }
        // A walk that meets itself has met a ring: every signal of it is one.
        let Some(entry) = at.filter(|index| seen[*index] == walk) else {
            continue;
        };
        let mut at = entry;
        loop {
            found.push(at);
            match next(at) {
                Some(index) if index != entry => at = index,
                _ => break,
            }
        }
    }
    found.sort_unstable();
    found
}
