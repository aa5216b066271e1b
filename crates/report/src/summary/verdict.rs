//! The verdict of a report in words.

use sample::{Event, EventKind};

use super::Summary;
use crate::drive::Drive;

/// Sentences, each on one subject.
pub fn of(drive: &Drive, summary: &Summary) -> Vec<String> {
    let mut verdict = vec![recording(drive, summary)];
    verdict.extend(lifts(drive));
    verdict.extend(faults(drive));
    let count = |is: fn(&EventKind) -> bool| drive.events.iter().filter(|e| is(&e.kind)).count();
    let changes = count(|kind| matches!(kind, EventKind::SurfaceChange(..)));
    if changes > 0 {
        verdict.push(many(changes, "change of surface", "changes of surface"));
    }
    verdict.extend(
        drive
            .events
            .iter()
            .filter_map(|event| configuration(drive, event)),
    );
    let resets = count(|kind| matches!(kind, EventKind::FilterReset));
    if resets > 0 {
        verdict.push(format!(
            "a filter was reset {}",
            many(resets, "time", "times")
        ));
    }
    if !summary.gaps_s.is_empty() {
        let longest = summary.gaps_s.iter().map(|[from, to]| to - from);
        let longest = longest.fold(0.0, f64::max);
        let gaps = many(summary.gaps_s.len(), "gap", "gaps");
        verdict.push(format!(
            "{gaps} in the estimates, the longest {longest:.1} s"
        ));
    }
    verdict.push(match summary.consistent {
        Some((inside, windows)) => format!(
            "innovations consistent in {:.0} % of {windows} windows",
            100.0 * inside
        ),
        None if drive.motion.is_empty() => "no estimates".to_owned(),
        None => "estimates without statistics of innovations".to_owned(),
    });
    verdict
}

/// What an event says of the configuration.
fn configuration(drive: &Drive, event: &Event) -> Option<String> {
    match &event.kind {
        EventKind::Mistake(subject) => Some(format!(
            "mistake of the configuration: {subject} (see the events)"
        )),
        EventKind::InexactParameters(_) => Some(format!(
            "readings contradict exact parameters: standard deviations of forces contain their errors from {:.0} s on",
            drive.seconds(event.time)
        )),
        _ => None,
    }
}

/// A count with its noun.
pub fn many(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

fn recording(drive: &Drive, summary: &Summary) -> String {
    let lost: u64 = summary.lost.iter().sum();
    match (drive.missing.is_empty(), lost) {
        (true, 0) => "recording complete, no loss".to_owned(),
        (true, lost) => format!("recording complete, {lost} items lost before the recorder"),
        (false, 0) => "recording incomplete (see below)".to_owned(),
        (false, lost) => format!("recording incomplete (see below), {lost} items lost"),
    }
}

fn lifts(drive: &Drive) -> Option<String> {
    let is_lift = |event: &&Event| matches!(event.kind, EventKind::Lift(_));
    let is_two = |event: &&Event| matches!(event.kind, EventKind::TwoWheelLift(_));
    let one = drive.events.iter().filter(is_lift).count();
    let two = drive.events.iter().filter(is_two).count();
    let text = many(one, "wheel lift", "wheel lifts");
    match (one, two) {
        (0, 0) if drive.forces.is_empty() => None,
        (_, 0) => Some(text),
        (_, two) => Some(format!("{text}, {two} of both wheels of a side")),
    }
}

/// Faults with their sensor and duration, at most three by name.
fn faults(drive: &Drive) -> Option<String> {
    let bands = spans(drive);
    if bands.is_empty() {
        return (!drive.motion.is_empty()).then(|| "no sensor fault".to_owned());
    }
    let mut names: Vec<String> = bands
        .iter()
        .take(3)
        .map(|(name, [from, to])| format!("{name} for {:.1} s", to - from))
        .collect();
    if bands.len() > 3 {
        names.push(format!("{} more", bands.len() - 3));
    }
    let faults = many(bands.len(), "sensor fault", "sensor faults");
    Some(format!("{faults} ({})", names.join(", ")))
}

/// Sensor faults: name, begin and end in s; one that does not end lasts to the end of the span.
pub fn spans(drive: &Drive) -> Vec<(String, [f64; 2])> {
    let mut spans: Vec<(String, [f64; 2])> = Vec::new();
    for event in &drive.events {
        let at_s = drive.seconds(event.time);
        match &event.kind {
            EventKind::SensorFault(name) => spans.push((name.clone(), [at_s, drive.span_s[1]])),
            EventKind::SensorRecovered(name) => {
                let open = spans.iter_mut().rev().find(|(other, _)| other == name);
                if let Some((_, [_, end])) = open {
                    *end = at_s;
                }
            }
            _ => {}
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use sample::LogTime;

    use super::*;

    /// The verdict of a drive of which nothing but one event is known.
    fn of_event(kind: EventKind) -> Vec<String> {
        let mut drive = Drive::default();
        drive.events.push(Event {
            time: LogTime(12_400_000_000),
            onset: LogTime(12_400_000_000),
            kind,
            probability: None,
            load_transfer_ratio: None,
            text: String::new(),
        });
        of(&drive, &Summary::default())
    }

    #[test]
    fn the_verdict_says_since_when_readings_contradict_exact_parameters() {
        let verdict = of_event(EventKind::InexactParameters(0.75));
        let found = verdict
            .iter()
            .find(|text| text.contains("exact parameters"));
        let text = found.expect("a sentence on the parameters");
        assert!(
            text.ends_with("contain their errors from 12 s on"),
            "{text}"
        );
        let verdict = of_event(EventKind::FilterRecovered);
        assert!(!verdict.iter().any(|text| text.contains("exact parameters")));
    }
}
