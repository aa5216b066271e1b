//! Data that the recorder has taken and not written yet.

use std::sync::atomic::Ordering;

use super::{Files, Sink, Tally};

impl Files {
    /// Removes the data from the account that is now in the log or in its journal.
    pub(super) fn account(&mut self) {
        let Sink::Open(file) = &mut self.sink else {
            return;
        };
        let records = std::mem::take(&mut self.fresh.losses.records);
        if file.take_left_out() {
            if !self.shared.raw_only.swap(true, Ordering::Relaxed) {
                tracing::warn!(
                    log = %file.writer.path().display(),
                    "the disk is nearly full: raw data is written, decoded records are left out \
                     (a replay computes them again); make room on the disk"
                );
            }
            self.shared.lose_tally(&Tally::records(records));
        } else if file.writer.has_decoded() {
            self.fresh.losses.records = records;
        } else if records > 0 {
            self.shared.raw_only.store(false, Ordering::Relaxed);
            self.shared.written(&Tally::records(records));
        }
        let records = std::mem::take(&mut self.fresh.losses.records);
        if let Some(unwritten) = file.unwritten() {
            let rest = Tally::of(unwritten);
            let before = std::mem::replace(&mut self.fresh, rest);
            let written = before.since(&self.fresh);
            if written.losses.arrivals > 0 {
                self.shared.written(&written);
            }
        }
        self.fresh.losses.records = records;
    }
}
