//! Short summary of the losses and faults of a log.

use std::collections::BTreeMap;

use sample::text::printable;
use store::Missing;

/// Most items of a kind that have a line of their own.
const LINES_MAX: usize = 4;

/// A line for each of the first items of a kind, and a line with the number of the others.
pub fn summary(missing: &[Missing]) -> Vec<String> {
    let mut lines = Vec::new();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for one in missing {
        let count = counts.entry(kind(one)).or_default();
        *count += 1;
        if *count <= LINES_MAX {
            lines.push(printable(&one.to_string()).into_owned());
        }
    }
    for (kind, count) in counts {
        if count > LINES_MAX {
            lines.push(format!(
                "and {} more {kind}; --json lists all",
                count - LINES_MAX
            ));
        }
    }
    lines
}

fn kind(missing: &Missing) -> &'static str {
    match missing {
        Missing::Unfinished { .. } => "files that were not closed",
        Missing::Cut { .. } => "files that were cut short",
        Missing::Damaged { .. } => "damaged parts",
        Missing::Unconfirmed { .. } => "records without a checksum",
        Missing::Changed { .. } => "wrong checksums",
        Missing::BadMessage { .. } => "malformed messages",
        Missing::Parts { .. } => "gaps between the parts",
        Missing::NoSchema { .. } => "channels without a schema",
        Missing::Unwritten { .. } => "files with losses",
        Missing::Arrivals { .. } => "gaps in the sequence of arrivals",
        _ => "losses",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sample::LogTime;

    #[test]
    fn many_items_of_a_kind_are_counted() {
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
        assert_eq!(lines.len(), LINES_MAX + 2);
        assert!(lines[0].contains("/imu/imu") && lines[LINES_MAX].contains("3 arrivals"));
        assert!(lines[LINES_MAX + 1].starts_with("and 96 more malformed messages"));
    }
}
