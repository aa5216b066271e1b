//! Events of the configuration.

use sample::{Event, EventKind, LogTime};

use crate::mistakes::Described;

/// What the estimator does after a correction.
pub(super) const CORRECTED: &str = "the estimator uses the corrected value from now on";

/// The event of a mistake, with what the estimator does then.
pub(super) fn mistake(now: LogTime, described: &Described, then: &str) -> Event {
    Event {
        time: now,
        onset: now,
        kind: EventKind::Mistake(described.subject.clone()),
        probability: None,
        load_transfer_ratio: None,
        text: format!(
            "the configuration contradicts the drive: {}: {}; {}; {then}",
            described.subject, described.cause, described.remedy
        ),
    }
}

/// The event that the readings contradict exact parameters, with the factor on the tolerances.
pub(super) fn inexact(now: LogTime, factor: f64) -> Event {
    Event {
        time: now,
        onset: now,
        kind: EventKind::InexactParameters(factor),
        probability: None,
        load_transfer_ratio: None,
        text: format!(
            "the readings contradict exact parameters of vehicle file and sensors file, as errors of about {factor:.1} \
             times the tolerances of a careful workshop do; the standard deviations of the forces contain such errors \
             from now on; give both files a table [tolerances], so that they contain them from the start"
        ),
    }
}
