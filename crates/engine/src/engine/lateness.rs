//! Late messages of a source.

use std::collections::BTreeMap;

/// Delay from which a message counts as late, ns: what the estimator waits for measurements.
const LATE_NS: i64 = 5_000_000;

/// Increase of a usual delay with each message, ns: the fit of a device clock follows the drift.
const USUAL_RISE_NS: i64 = 1_000;

/// Numbers of late messages.
#[derive(Clone, Debug, Default)]
pub struct Lateness {
    /// Later than the estimator waits, and used at their own time.
    pub used: u64,
    /// Later than the estimator uses.
    pub unused: u64,
    /// Usual delay of each message that was measured, by name, ns: the line carries the messages of one
    /// instant one after another.
    usual_ns: BTreeMap<&'static str, i64>,
}

impl Lateness {
    /// The fit of the device clock has fallen: all delays are larger by this from now on, ns.
    pub fn fit_fell(&mut self, by_ns: i64) {
        if by_ns > 0 {
            self.usual_ns.values_mut().for_each(|ns| *ns += by_ns);
        }
    }

    /// Counts a message by its delay beyond the usual one. Returns whether it is too late to be used.
    pub fn count_named(&mut self, name: &'static str, delay_ns: i64, limit_ns: i64) -> bool {
        let usual_ns = self.usual_ns.entry(name).or_insert(delay_ns);
        *usual_ns = delay_ns.min(*usual_ns + USUAL_RISE_NS);
        let late_ns = delay_ns - *usual_ns;
        self.count(late_ns, limit_ns)
    }

    /// Counts a message by its lateness. Returns whether it is too late to be used.
    pub fn count(&mut self, late_ns: i64, limit_ns: i64) -> bool {
        let is_too_late = late_ns > limit_ns;
        self.used += u64::from(!is_too_late && late_ns > LATE_NS);
        self.unused += u64::from(is_too_late);
        is_too_late
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const LIMIT_NS: i64 = 100 * MS;

    #[test]
    fn a_message_is_compared_with_its_usual_delay() {
        let mut late = Lateness::default();
        for _ in 0..10 {
            assert!(!late.count_named("BESTVEL", 20 * MS, LIMIT_NS));
            assert!(!late.count_named("HEADING2", 160 * MS, LIMIT_NS));
        }
        assert!(!late.count_named("BESTVEL", 110 * MS, LIMIT_NS));
        assert!(late.count_named("BESTVEL", 130 * MS, LIMIT_NS));
        assert_eq!((late.used, late.unused), (1, 1));
    }

    /// The first message of a device sets the fit. If a faster one follows, the usual delay of the first
    /// one is no longer zero.
    #[test]
    fn a_fit_that_falls_makes_no_message_late() {
        let mut late = Lateness::default();
        late.count_named("HEADING2", 0, LIMIT_NS);
        late.fit_fell(140 * MS);
        assert!(!late.count_named("BESTVEL", 0, LIMIT_NS));
        assert!(!late.count_named("HEADING2", 140 * MS, LIMIT_NS));
        assert_eq!((late.used, late.unused), (0, 0));
    }
}
