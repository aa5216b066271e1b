//! Signals of a table that are not what they seem: values that are held to fill a faster grid, and
//! counters of 8 bits that overflow.

/// Fewest changes of a signal from which held values are recognised.
const CHANGES_MIN: usize = 20;
/// Part of the intervals between changes that must be multiples of the shortest usual one.
const MULTIPLES_MIN: f64 = 0.9;
/// Values of a counter of 8 bits.
const OVERFLOW: f64 = 256.0;
/// Largest usual step of a signal in which a jump of [`OVERFLOW`] is found, in its units.
const STEP_MAX: f64 = 32.0;

/// Rows for which each new value of a signal is repeated, if it is: the largest usual number.
///
/// A signal that is sampled with each row has changes after any number of rows. One that is held for
/// k rows has no interval between changes shorter than k, and the others are multiples of it.
pub fn held_rows(values: &[Option<f64>]) -> Option<u32> {
    let changes: Vec<usize> = changes(values);
    if changes.len() <= CHANGES_MIN {
        return None;
    }
    let mut steps: Vec<usize> = changes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_unstable();
    let part = |part: f64| steps[((steps.len() - 1) as f64 * part) as usize];
    let (shortest, median) = (part(0.05), part(0.5));
    if shortest < 2 || median > 2 * shortest {
        return None;
    }
    // The ratio of the two rates need not be an integer: an interval is up to one row longer.
    let is_multiple = |step: &usize| {
        let times = (step + shortest / 2) / shortest;
        let nearest = times.max(1) * shortest;
        step.abs_diff(nearest)
            <= times
                .max(1)
                .min(shortest / 2)
                .max(usize::from(shortest > 2))
    };
    let multiples = steps.iter().filter(|step| is_multiple(step)).count();
    if (multiples as f64) < MULTIPLES_MIN * steps.len() as f64 {
        return None;
    }
    let usual = steps.iter().filter(|step| **step <= shortest + 1);
    u32::try_from(usual.max().copied().unwrap_or(shortest)).ok()
}

/// Rows in which a signal has another value than in the row before.
fn changes(values: &[Option<f64>]) -> Vec<usize> {
    let mut last: Option<f64> = None;
    let mut changes = Vec::new();
    for (row, value) in values.iter().enumerate() {
        // A signal with empty cells states its own rate.
        let Some(value) = value else {
            return Vec::new();
        };
        if last.is_some_and(|last| last.to_bits() != value.to_bits()) {
            changes.push(row);
        }
        last = Some(*value);
    }
    changes
}

/// Jumps of a signal by 256 of its units.
#[derive(Debug, PartialEq)]
pub struct Overflow {
    /// Row of the first jump, from zero.
    pub row: usize,
    /// Number of jumps.
    pub count: usize,
    /// The unit: all differences are multiples of it.
    pub unit: f64,
}

/// The jumps of a signal that moves by few of its units otherwise; `values` are numbers of the file.
pub fn overflow(values: &[Option<f64>]) -> Option<Overflow> {
    let known: Vec<(usize, f64)> = values
        .iter()
        .enumerate()
        .filter_map(|(row, value)| Some((row, (*value)?)))
        .collect();
    let steps: Vec<(usize, f64)> = known
        .windows(2)
        .map(|pair| (pair[1].0, pair[1].1 - pair[0].1))
        .filter(|(_, step)| *step != 0.0)
        .collect();
    let unit = unit(&steps)?;
    let mut sizes: Vec<f64> = steps.iter().map(|(_, step)| step.abs() / unit).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes[(sizes.len() - 1) * 9 / 10];
    if usual > STEP_MAX {
        return None;
    }
    let is_jump = |step: f64| (step.abs() / unit - OVERFLOW).abs() <= 2.0 * usual.max(1.0);
    let jumps: Vec<usize> = steps
        .iter()
        .filter(|(_, step)| is_jump(*step))
        .map(|(row, _)| *row)
        .collect();
    Some(Overflow {
        row: *jumps.first()?,
        count: jumps.len(),
        unit,
    })
}

/// The step of which all steps are multiples, to 1e-9: a signal of a converter has it.
fn unit(steps: &[(usize, f64)]) -> Option<f64> {
    let divisor = steps.iter().fold(0, |divisor: u64, (_, step)| {
        let (mut a, mut b) = (divisor, (step.abs() * 1e9).round() as u64);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    });
    (divisor > 0).then_some(divisor as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(rows: usize, step: impl Fn(usize) -> usize) -> Vec<Option<f64>> {
        (0..rows)
            .map(|row| Some(math::sin(step(row) as f64 * 0.1)))
            .collect()
    }

    #[test]
    fn held_values_are_recognised() {
        assert_eq!(held_rows(&held(2000, |row| row / 10)), Some(10));
        // 12 Hz in rows of 100 Hz.
        assert_eq!(held_rows(&held(2000, |row| row * 12 / 100)), Some(9));
        assert_eq!(held_rows(&held(2000, |row| row)), None);
        // 5 Hz in rows of 10 Hz.
        assert_eq!(held_rows(&held(2000, |row| row / 2)), Some(2));
        // Rounded values of a slow signal repeat without a rate.
        let slow: Vec<Option<f64>> = (0..5000)
            .map(|row| Some((20.0 * math::sin(f64::from(row) * 0.003)).round()))
            .collect();
        assert_eq!(held_rows(&slow), None);
        // A signal with empty cells has its own rate.
        let sparse: Vec<Option<f64>> = (0..2000)
            .map(|row| (row % 10 == 0).then_some(f64::from(row)))
            .collect();
        assert_eq!(held_rows(&sparse), None);
    }

    #[test]
    fn overflows_of_eight_bits_are_found() {
        let rising = |wraps: bool| -> Vec<Option<f64>> {
            (0..1000)
                .map(|row| 3 * row)
                .map(|count| Some(0.1 * f64::from(if wraps { count % 256 } else { count })))
                .collect()
        };
        let found = overflow(&rising(true)).expect("an overflow");
        assert_eq!((found.row, found.count), (86, 11));
        assert_eq!(overflow(&rising(false)), None);
        let noise: Vec<Option<f64>> = (0..1000)
            .map(|i| Some(math::sin(f64::from(i) * 7.7)))
            .collect();
        assert_eq!(overflow(&noise), None);
        // A number that is switched between 0 and 256 is no overflow of a signal that moves.
        assert!(overflow(&[Some(0.0), Some(1.0)]).is_none());
    }
}
