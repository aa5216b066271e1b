//! The ledger of losses between the wire and the disk, by source and place.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sample::{Arrival, LossPlace, Notice, Payload, SourceId};

use crate::Session;

/// Losses, counted.
///
/// Items are frames on CAN, and reads on serial ports (bytes where the UART lost them).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    items: BTreeMap<(SourceId, LossPlace), u64>,
    /// Raw arrivals lost on the way to the disk, notices and ticks included.
    pub arrivals: u64,
    /// Decoded records lost on the way to the disk; a replay computes them again.
    pub records: u64,
}

impl Losses {
    /// Adds items lost at a place.
    pub fn add_items(&mut self, source: SourceId, place: LossPlace, count: u64) {
        if count > 0 {
            let sum = self.items.entry((source, place)).or_default();
            *sum = sum.saturating_add(count);
        }
    }

    /// Adds the loss that a notice of the stream states.
    pub fn add_notice(&mut self, source: SourceId, notice: &Notice) {
        if let Notice::Lost { place, count } = notice {
            self.add_items(source, *place, *count);
        }
    }

    /// Adds an arrival that is lost on the way to the disk. If it is a notice of a loss, that loss is
    /// added too, unless it is a loss on the way to the disk, which the recorder counts itself.
    pub fn add_arrival(&mut self, arrival: &Arrival) {
        self.arrivals += 1;
        let (place, items) = match &arrival.payload {
            Payload::Can(frames) => (LossPlace::Disk, frames.len() as u64),
            Payload::Bytes(_) => (LossPlace::Disk, 1),
            Payload::Notice(Notice::Lost { place, count }) if *place != LossPlace::Disk => {
                (*place, *count)
            }
            Payload::Tick | Payload::Notice(_) => return,
        };
        self.add_items(arrival.source, place, items);
    }

    /// Adds other losses.
    pub fn add(&mut self, other: &Self) {
        for ((source, place), count) in &other.items {
            self.add_items(*source, *place, *count);
        }
        self.arrivals = self.arrivals.saturating_add(other.arrivals);
        self.records = self.records.saturating_add(other.records);
    }

    /// Losses that were added since `before`, an earlier state of the same losses.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        let mut more = self.clone();
        for (key, count) in &before.items {
            if let Some(sum) = more.items.get_mut(key) {
                *sum = sum.saturating_sub(*count);
            }
        }
        more.items.retain(|_, count| *count > 0);
        more.arrivals = self.arrivals.saturating_sub(before.arrivals);
        more.records = self.records.saturating_sub(before.records);
        more
    }

    /// Items lost of a source, in the order of [`LossPlace::ALL`].
    #[must_use]
    pub fn of(&self, source: SourceId) -> [u64; LossPlace::ALL.len()] {
        LossPlace::ALL.map(|place| self.items.get(&(source, place)).copied().unwrap_or(0))
    }

    /// Items lost over all sources, in the order of [`LossPlace::ALL`].
    #[must_use]
    pub fn totals(&self) -> [u64; LossPlace::ALL.len()] {
        let total = |place| {
            let at_place = self.items.iter().filter(|((_, p), _)| *p == place);
            at_place.map(|(_, count)| count).sum()
        };
        LossPlace::ALL.map(total)
    }

    /// Items lost at a place, by source.
    #[must_use]
    pub fn at(&self, place: LossPlace) -> BTreeMap<SourceId, u64> {
        let at_place = self.items.iter().filter(|((_, p), _)| *p == place);
        at_place
            .map(|((source, _), count)| (*source, *count))
            .collect()
    }

    /// Whether nothing is lost.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether raw data is lost: something that no replay can compute again.
    #[must_use]
    pub fn has_raw(&self) -> bool {
        self.arrivals > 0 || !self.items.is_empty()
    }

    /// Keeps the losses at some places.
    pub(crate) fn retain(&mut self, keep: impl Fn(LossPlace) -> bool) {
        self.items.retain(|(_, place), _| keep(*place));
    }

    /// Adds the counters to a metadata record: `lost.<source>.<place>`, `lost_arrivals` and
    /// `lost_records`, each where it is not 0.
    pub(crate) fn put(&self, session: &Session, map: &mut BTreeMap<String, String>) {
        for (name, count) in [
            ("lost_arrivals", self.arrivals),
            ("lost_records", self.records),
        ] {
            if count > 0 {
                map.insert(name.to_owned(), count.to_string());
            }
        }
        for ((source, place), count) in &self.items {
            let key = format!("lost.{}.{}", session.source_name(*source), place.name());
            map.insert(key, count.to_string());
        }
    }
}

/// The one ledger of losses of a recorder. Clones share it.
///
/// Sources and queues enter their losses, and each run enters what does not reach the disk. The status,
/// the exit code and the counters in the log are read from the ledger. The account of a run
/// ([`LossLedger::account`]) contains the losses that the files of the run state.
#[derive(Clone, Debug, Default)]
pub struct LossLedger {
    own: Arc<Mutex<Losses>>,
    parent: Option<Arc<Mutex<Losses>>>,
}

impl LossLedger {
    /// The account of a run. An entry in the account is also an entry in this ledger.
    #[must_use]
    pub fn account(&self) -> Self {
        Self {
            own: Arc::default(),
            parent: Some(Arc::clone(self.parent.as_ref().unwrap_or(&self.own))),
        }
    }

    /// The losses up to now.
    #[must_use]
    pub fn losses(&self) -> Losses {
        lock(&self.own).clone()
    }

    /// Enters items lost at a place.
    pub fn enter_items(&self, source: SourceId, place: LossPlace, count: u64) {
        let mut losses = Losses::default();
        losses.add_items(source, place, count);
        self.enter(&losses);
    }

    /// Enters losses.
    pub fn enter(&self, losses: &Losses) {
        lock(&self.own).add(losses);
        if let Some(parent) = &self.parent {
            lock(parent).add(losses);
        }
    }

    /// Enters arrivals that did not reach the disk. Losses that lost notices state are entered in this
    /// account only, because the ledger has them since they happened.
    pub fn enter_unwritten(&self, losses: &Losses) {
        lock(&self.own).add(losses);
        if let Some(parent) = &self.parent {
            let mut on_disk = losses.clone();
            on_disk.retain(|place| place == LossPlace::Disk);
            lock(parent).add(&on_disk);
        }
    }

    /// Gives the sources other numbers. Losses of a source without a new number become losses of the
    /// recorder itself ([`SourceId::HOST`]), so that the sums do not change.
    pub fn renumber(&self, numbers: &BTreeMap<SourceId, SourceId>) {
        let mut own = lock(&self.own);
        for ((source, place), count) in std::mem::take(&mut own.items) {
            let number = numbers.get(&source).copied().unwrap_or(SourceId::HOST);
            own.add_items(number, place, count);
        }
    }
}

fn lock(losses: &Mutex<Losses>) -> MutexGuard<'_, Losses> {
    losses.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PORT: SourceId = SourceId(3);

    #[test]
    fn a_run_states_its_own_share_and_the_ledger_holds_the_sum() {
        let ledger = LossLedger::default();
        ledger.enter_items(PORT, LossPlace::Kernel, 5);
        let (first, second) = (ledger.account(), ledger.account());
        let mut unwritten = Losses::default();
        unwritten.add_items(PORT, LossPlace::Disk, 2);
        unwritten.add_items(PORT, LossPlace::Kernel, 5);
        unwritten.arrivals = 3;
        first.enter_unwritten(&unwritten);
        second.enter(&Losses {
            records: 7,
            ..Losses::default()
        });
        assert_eq!(first.losses(), unwritten);
        let all = ledger.losses();
        assert_eq!(all.of(PORT), [0, 5, 0, 2]);
        assert_eq!((all.arrivals, all.records), (3, 7));
    }

    #[test]
    fn sums_stay_when_sources_get_other_numbers() {
        let ledger = LossLedger::default();
        ledger.enter_items(PORT, LossPlace::Queue, 2);
        ledger.enter_items(SourceId(4), LossPlace::Queue, 3);
        ledger.renumber(&BTreeMap::from([(PORT, SourceId(0))]));
        let losses = ledger.losses();
        assert_eq!(losses.of(SourceId(0)), [0, 0, 2, 0]);
        assert_eq!(losses.totals(), [0, 0, 5, 0]);
    }

    #[test]
    fn what_was_added_is_the_difference() {
        let mut before = Losses::default();
        before.add_items(PORT, LossPlace::Disk, 2);
        let mut after = before.clone();
        assert!(after.since(&before).is_empty());
        after.add_items(PORT, LossPlace::Disk, 3);
        after.arrivals = 1;
        assert_eq!(after.since(&before).of(PORT), [0, 0, 0, 3]);
    }
}
