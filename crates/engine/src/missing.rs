//! What a log turned out not to hold, in few lines.

use std::collections::BTreeMap;

use sample::text::printable;
use store::Missing;

/// How many of one sort are told one by one.
const TOLD: usize = 4;

/// One line each for the first few of each sort, one with a count for the rest of it.
pub fn summary(missing: &[Missing]) -> Vec<String> {
    let mut lines = Vec::new();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for one in missing {
        let count = counts.entry(sort(one)).or_default();
        *count += 1;
        if *count <= TOLD {
            lines.push(printable(&one.to_string()).into_owned());
        }
    }
    for (sort, count) in counts {
        if count > TOLD {
            lines.push(format!(
                "and {} more {sort}; --json lists them all",
                count - TOLD
            ));
        }
    }
    lines
}

fn sort(missing: &Missing) -> &'static str {
    match missing {
        Missing::Unfinished { .. } => "files that were not closed",
        Missing::Cut { .. } => "cut files",
        Missing::Damaged { .. } => "damaged parts",
        Missing::Unconfirmed { .. } => "records without a checksum",
        Missing::Changed { .. } => "wrong checksums",
        Missing::BadMessage { .. } => "malformed messages",
        Missing::Parts { .. } => "holes in the row of parts",
        Missing::NoSchema { .. } => "channels without a schema",
        Missing::Unwritten { .. } => "files that state losses",
        Missing::Arrivals { .. } => "gaps in the sequence of arrivals",
        _ => "losses",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sample::LogTime;

    #[test]
    fn many_of_one_sort_become_a_count() {
        let mut missing: Vec<Missing> = (0..100)
            .map(|second| Missing::BadMessage {
                topic: "/imu/imu".to_owned(),
                log_time: LogTime(second * 1_000_000_000),
                text: "cut".to_owned(),
            })
            .collect();
        missing.push(Missing::Arrivals {
            first_sequence: 7,
            count: 3,
        });
        let lines = summary(&missing);
        assert_eq!(lines.len(), TOLD + 2);
        assert!(lines[0].contains("/imu/imu") && lines[TOLD].contains("3 arrivals"));
        assert!(lines[TOLD + 1].starts_with("and 96 more malformed messages"));
    }
}
