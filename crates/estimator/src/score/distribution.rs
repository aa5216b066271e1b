//! Quantiles of many values in constant memory.

/// Number of values that are kept as they are, unless another one is asked for.
const EXACT: usize = 8192;
/// Bits of the mantissa that tell the class of a value: 512 classes for each power of two.
const MANTISSA_BITS: u32 = 9;
/// Classes for each power of two.
const CLASSES: usize = 1 << MANTISSA_BITS;
/// Exponents with classes: values from 2^-80 to 2^48.
const EXPONENTS: [i32; 2] = [-80, 48];

/// Distribution of values that are not negative.
///
/// Quantiles of few values are exact. More values are counted in classes, whose width is at most 0.2 % of
/// the value.
#[derive(Clone, Debug)]
pub struct Distribution {
    exact: usize,
    values: Vec<f64>,
    classes: Counts,
    count: usize,
    /// Negative infinity without a value.
    largest: f64,
}

impl Default for Distribution {
    fn default() -> Self {
        Self::exact_up_to(EXACT)
    }
}

impl Distribution {
    /// A distribution that keeps up to `exact` values as they are.
    #[must_use]
    pub const fn exact_up_to(exact: usize) -> Self {
        Self {
            exact,
            values: Vec::new(),
            classes: Counts(Vec::new()),
            count: 0,
            largest: f64::NEG_INFINITY,
        }
    }

    /// Takes a value; NaN is left out.
    #[inline]
    pub fn push(&mut self, value: f64) {
        if value.is_nan() {
            return;
        }
        self.count += 1;
        if value > self.largest {
            self.largest = value;
        }
        if self.classes.is_empty() {
            self.keep(value);
        } else {
            self.classes.add(class(value));
        }
    }

    /// Takes one of the first values.
    fn keep(&mut self, value: f64) {
        self.values.push(value);
        if self.values.len() > self.exact {
            for value in std::mem::take(&mut self.values) {
                self.classes.add(class(value));
            }
        }
    }

    /// Number of values.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// The largest value.
    #[must_use]
    pub fn largest(&self) -> Option<f64> {
        (self.count > 0).then_some(self.largest)
    }

    /// The value with `rank` smaller ones; `None` without so many values.
    #[must_use]
    pub fn at_rank(&self, rank: usize) -> Option<f64> {
        if rank >= self.count {
            return None;
        }
        if self.classes.is_empty() {
            let mut values = self.values.clone();
            let (_, value, _) = values.select_nth_unstable_by(rank, f64::total_cmp);
            return Some(*value);
        }
        let mut smaller = 0;
        for (class, number) in self.classes.iter() {
            let number = number as usize;
            if rank < smaller + number {
                let part = ((rank - smaller) as f64 + 0.5) / number as f64;
                let [low, high] = [class, class + 1].map(lower_edge);
                return Some((low + part * (high - low)).min(self.largest));
            }
            smaller += number;
        }
        None
    }

    /// Median; `None` without a value.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        self.at_rank(self.count / 2)
    }

    /// Number of values up to `bound`.
    #[must_use]
    pub fn up_to(&self, bound: f64) -> f64 {
        self.counted(bound, |value| value <= bound)
    }

    /// Number of values below `bound`.
    #[must_use]
    pub fn below(&self, bound: f64) -> f64 {
        self.counted(bound, |value| value < bound)
    }

    /// Number of values with a property, which those below `bound` have and those above lack.
    fn counted(&self, bound: f64, has: impl Fn(f64) -> bool) -> f64 {
        if self.classes.is_empty() {
            return self.values.iter().filter(|value| has(**value)).count() as f64;
        }
        let own = class(bound);
        let below = self.classes.iter().take_while(|(class, _)| *class < own);
        let whole: u64 = below.map(|(_, number)| u64::from(number)).sum();
        let [low, high] = [own, own + 1].map(lower_edge);
        let part = ((bound - low) / (high - low)).clamp(0.0, 1.0);
        whole as f64 + part * f64::from(self.classes.of(own))
    }
}

/// Number of values of each class. Only the powers of two that have values take memory.
#[derive(Clone, Debug)]
struct Counts(Vec<Option<Box<[u32; CLASSES]>>>);

impl Counts {
    const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    #[inline]
    fn add(&mut self, class: usize) {
        let (power, place) = (class / CLASSES, class % CLASSES);
        match self.0.get_mut(power) {
            Some(Some(table)) => table[place] += 1,
            _ => self.new_table(power)[place] += 1,
        }
    }

    fn new_table(&mut self, power: usize) -> &mut [u32; CLASSES] {
        if power >= self.0.len() {
            self.0.resize(power + 1, None);
        }
        self.0[power].get_or_insert_with(|| Box::new([0; CLASSES]))
    }

    fn of(&self, class: usize) -> u32 {
        let table = self.0.get(class / CLASSES).and_then(Option::as_ref);
        table.map_or(0, |table| table[class % CLASSES])
    }

    /// The classes in order; those of a power of two without values are left out.
    fn iter(&self) -> impl Iterator<Item = (usize, u32)> {
        let tables = self.0.iter().enumerate();
        tables.flat_map(|(power, table)| {
            let numbers = table.iter().flat_map(|table| table.iter()).enumerate();
            numbers.map(move |(place, number)| (power * CLASSES + place, *number))
        })
    }
}

/// Class of a value: exponent and first bits of the mantissa.
#[inline]
fn class(value: f64) -> usize {
    let [least, most] = EXPONENTS.map(power_of_two);
    let shift = f64::MANTISSA_DIGITS - 1 - MANTISSA_BITS;
    let place = |value: f64| value.to_bits() >> shift;
    (place(value.clamp(least, most)) - place(least)) as usize
}

/// Lower edge of a class.
fn lower_edge(class: usize) -> f64 {
    let shift = f64::MANTISSA_DIGITS - 1 - MANTISSA_BITS;
    let first = power_of_two(EXPONENTS[0]).to_bits() >> shift;
    f64::from_bits((first + class as u64) << shift)
}

fn power_of_two(exponent: i32) -> f64 {
    2.0_f64.powi(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values whose rank is known: 1, 2, 3, and so on.
    fn filled(count: u32) -> Distribution {
        let mut all = Distribution::default();
        for k in 0..count {
            // The order of the values does not matter.
            all.push(f64::from(k * 7919 % count) + 1.0);
        }
        all
    }

    #[test]
    fn quantiles_of_few_values_are_exact_and_those_of_many_nearly() {
        let few = filled(1000);
        assert_eq!(few.at_rank(950), Some(951.0));
        assert_eq!([few.up_to(500.0), few.below(500.0)], [500.0, 499.0]);
        let many = filled(100_003);
        for rank in [0, 10, 50_001, 95_000, 100_002] {
            let exact = rank as f64 + 1.0;
            let found = many.at_rank(rank).unwrap();
            assert!((found / exact - 1.0).abs() < 2e-3, "{rank} {found} {exact}");
        }
        assert_eq!(many.count(), 100_003);
        assert_eq!(many.largest(), Some(100_003.0));
        let half = many.up_to(many.median().unwrap());
        assert!((half / 50_002.0 - 1.0).abs() < 1e-3, "{half}");
        assert_eq!(many.at_rank(100_003), None);
    }

    #[test]
    fn extreme_values_have_a_class() {
        let mut all = Distribution::default();
        for _ in 0..EXACT {
            for value in [0.0, 1e-300, 1e300, f64::NAN] {
                all.push(value);
            }
        }
        assert_eq!(all.count(), 3 * EXACT);
        assert!(all.at_rank(0).unwrap() < 1e-20 && all.at_rank(3 * EXACT - 1).unwrap() > 1e14);
    }
}
