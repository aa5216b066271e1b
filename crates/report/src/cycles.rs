//! Cycles of a load for counts of fatigue.

/// A cycle between two turning points of a load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// 1 for a closed cycle, 0.5 for a half cycle.
    pub count: f64,
    /// Positions in the load of its turning points.
    pub turns: [usize; 2],
}

/// Rainflow cycles of a load by ASTM E1049-85, section 5.4.4. Values that are not finite are left out; the
/// ends of the load count as turning points. What does not close a cycle is counted as half cycles.
#[must_use]
pub fn rainflow(load: &[f64]) -> Vec<Cycle> {
    let mut cycles = Vec::new();
    let mut stack: Vec<usize> = Vec::new();
    let range = |a: usize, b: usize| (load[a] - load[b]).abs();
    for turn in turning_points(load) {
        stack.push(turn);
        while let [.., start, middle, end] = stack[..] {
            if range(middle, end) < range(start, middle) {
                break;
            }
            let is_first = stack.len() == 3;
            cycles.push(Cycle {
                count: if is_first { 0.5 } else { 1.0 },
                turns: [start, middle],
            });
            if is_first {
                stack.remove(0);
            } else {
                let place = stack.len() - 3;
                stack.drain(place..place + 2);
            }
        }
    }
    cycles.extend(stack.windows(2).map(|pair| Cycle {
        count: 0.5,
        turns: [pair[0], pair[1]],
    }));
    cycles
}

/// Positions at which the load turns around, with both ends.
fn turning_points(load: &[f64]) -> Vec<usize> {
    let mut points: Vec<usize> = Vec::new();
    for row in (0..load.len()).filter(|row| load[*row].is_finite()) {
        match points[..] {
            // A value that goes on in the same direction takes the place of the one before.
            [.., start, before]
                if (load[row] - load[before]) * (load[before] - load[start]) >= 0.0 =>
            {
                let place = points.len() - 1;
                points[place] = row;
            }
            [before] if load[row].total_cmp(&load[before]).is_eq() => {}
            _ => points.push(row),
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of ASTM E1049-85, figure 6.
    #[test]
    fn the_example_of_the_standard() {
        let load = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0];
        let mut found: Vec<(f64, f64)> = rainflow(&load)
            .into_iter()
            .map(|cycle| {
                let [start, end] = cycle.turns.map(|row| load[row]);
                ((start - end).abs(), cycle.count)
            })
            .collect();
        found.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let expected = [
            (3.0, 0.5),
            (4.0, 0.5),
            (4.0, 1.0),
            (6.0, 0.5),
            (8.0, 0.5),
            (8.0, 0.5),
            (9.0, 0.5),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn values_between_turns_equal_values_and_holes_do_not_matter() {
        let plain = [0.0, 4.0, 1.0, 6.0];
        let full = [0.0, 0.0, 2.0, f64::NAN, 4.0, 4.0, 3.0, 1.0, 5.0, 6.0, 6.0];
        let ranges = |load: &[f64]| -> Vec<(f64, f64)> {
            let cycles = rainflow(load).into_iter();
            cycles
                .map(|cycle| (load[cycle.turns[0]] - load[cycle.turns[1]], cycle.count))
                .collect()
        };
        assert_eq!(ranges(&plain), ranges(&full));
        assert_eq!(ranges(&plain), [(3.0, 1.0), (-6.0, 0.5)]);
        assert!(rainflow(&[1.0, 1.0]).is_empty());
        assert!(rainflow(&[]).is_empty());
    }
}
