//! Columns of the raw messages: differences in an exponential Golomb code.

use crate::error::MessageError;
use crate::proto::atvrec::Column;

/// Differences between consecutive values; the first is the difference to `first`.
pub(crate) fn deltas(first: i64, values: impl Iterator<Item = i64>) -> Vec<i64> {
    let mut before = first;
    values
        .map(|value| value.wrapping_sub(std::mem::replace(&mut before, value)))
        .collect()
}

/// The inverse of [`deltas`].
pub(crate) fn sums(first: i64, deltas: Vec<i64>) -> impl Iterator<Item = i64> {
    deltas.into_iter().scan(first, |value, delta| {
        *value = value.wrapping_add(delta);
        Some(*value)
    })
}

/// Largest order of the code; the sum still fits its type.
const MAX_ORDER: u32 = 63;

fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// The order of the code with the fewest bits for zigzag-mapped values, or one near it. The code of a
/// value of `b` bits takes k + 1 bits up to b = k, and 2 b - 1 - k above, and up to 2 more if the sum
/// with 2^k carries (above b = k, each further bit halves the frequency of a carry).
fn best_order(mapped: &[u64]) -> u32 {
    let mut of_size = [0_u64; 65];
    for value in mapped {
        of_size[64 - value.leading_zeros() as usize] += 1;
    }
    // In 16ths of a bit.
    let cost = |bits: u32, k: u32| match bits.checked_sub(k + 1) {
        None => 16 * u64::from(k + 1),
        Some(above) => 16 * u64::from(2 * bits - 1 - k) + (32 >> above.min(6)),
    };
    let least = of_size.iter().position(|count| *count > 0).unwrap_or(0);
    let most = of_size.iter().rposition(|count| *count > 0).unwrap_or(0);
    let total = |k: &u32| -> u64 {
        let counts = (least as u32..).zip(&of_size[least..=most]);
        counts.map(|(bits, count)| count * cost(bits, *k)).sum()
    };
    let middle = mapped.len() as u64 / 2;
    let mut below = 0;
    let size = of_size.iter().position(|count| {
        below += count;
        below > middle
    });
    // The sum of the bits falls to one minimum, which is near the size of the middle value.
    let size = size.unwrap_or_default() as u32;
    (size.saturating_sub(4)..=(size + 2).min(MAX_ORDER))
        .min_by_key(total)
        .unwrap_or_default()
}

/// Values in the exponential Golomb code of the best order (see `Column` in the schema).
pub(crate) fn encode(values: &[i64]) -> Option<Column> {
    if values.is_empty() {
        return None;
    }
    let mut sorted = values.to_vec();
    let middle = sorted.len() / 2;
    let base = *sorted.select_nth_unstable(middle).1;
    let mapped: Vec<u64> = values
        .iter()
        .map(|value| zigzag(value.wrapping_sub(base)))
        .collect();
    let k = best_order(&mapped);
    let mut writer = BitWriter {
        // Jitter of some microseconds.
        bytes: Vec::with_capacity(2 * values.len()),
        ..BitWriter::default()
    };
    for value in mapped {
        writer.code(value, k);
    }
    Some(Column {
        k,
        base,
        bits: writer.finish(),
    })
}

/// The inverse of [`encode`].
pub(crate) fn decode(
    name: &'static str,
    column: Option<&Column>,
    count: usize,
) -> Result<Vec<i64>, MessageError> {
    let Some(column) = column else {
        expect_len(name, count, 0)?;
        return Ok(Vec::new());
    };
    if column.k > MAX_ORDER {
        return Err(MessageError::Range {
            field: "k",
            value: column.k.into(),
        });
    }
    // Each value takes at least one bit, so a wrong count allocates no memory.
    if count > column.bits.len() * 8 {
        return Err(MessageError::Absent(name));
    }
    let mut reader = BitReader {
        bytes: &column.bits,
        position: 0,
    };
    let mut values = Vec::with_capacity(count);
    for _ in 0..count {
        let value = reader.value(column.k).ok_or(MessageError::Absent(name))?;
        values.push(unzigzag(value).wrapping_add(column.base));
    }
    Ok(values)
}

/// Bits that the writer accepts at once: it may hold up to seven already.
const WORD: u32 = 56;

/// `count` bits in pieces of at most [`WORD`].
fn pieces(count: u32) -> impl Iterator<Item = u32> {
    (0..count.div_ceil(WORD)).map(move |piece| (count - piece * WORD).min(WORD))
}

/// Bits into bytes, first bit highest.
#[derive(Default)]
struct BitWriter {
    bytes: Vec<u8>,
    held: u64,
    count: u32,
}

impl BitWriter {
    /// One zigzag-mapped value in the code of order `k`.
    fn code(&mut self, value: u64, k: u32) {
        // Nearly all codes fit into one word.
        if let Some(sum) = value.checked_add(1 << k) {
            let width = 2 * (64 - sum.leading_zeros()) - 1 - k;
            if width <= WORD {
                return self.put(sum, width);
            }
        }
        let sum = u128::from(value) + (1 << k);
        let bits = 128 - sum.leading_zeros();
        let zeros = bits - 1 - k;
        // Zeros, then the sum from its highest bit, in pieces of one word.
        for width in pieces(zeros) {
            self.put(0, width);
        }
        let mut left = bits;
        for width in pieces(bits) {
            left -= width;
            self.put((sum >> left) as u64 & ((1 << width) - 1), width);
        }
    }

    /// Appends the lowest `count` bits of `value`, at most [`WORD`].
    fn put(&mut self, value: u64, count: u32) {
        self.held = self.held << count | value;
        self.count += count;
        while self.count >= 8 {
            self.count -= 8;
            self.bytes.push((self.held >> self.count) as u8);
        }
        self.held &= (1 << self.count) - 1;
    }

    fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            let padding = 8 - self.count;
            self.put(0, padding);
        }
        self.bytes
    }
}

struct BitReader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl BitReader<'_> {
    fn bit(&mut self) -> Option<u128> {
        let byte = self.bytes.get(self.position / 8)?;
        let bit = byte >> (7 - self.position % 8) & 1;
        self.position += 1;
        Some(bit.into())
    }

    /// One zigzag-mapped value of the code of order `k`.
    fn value(&mut self, k: u32) -> Option<u64> {
        let mut zeros = 0;
        while self.bit()? == 0 {
            zeros += 1;
        }
        let rest = zeros + k;
        if rest > 64 {
            return None;
        }
        let mut sum = 1;
        for _ in 0..rest {
            sum = sum << 1 | self.bit()?;
        }
        u64::try_from(sum - (1 << k)).ok()
    }
}

/// One bit each, first in the lowest bit of the first byte.
pub(crate) fn bits(flags: impl Iterator<Item = bool>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (index, flag) in flags.enumerate() {
        if index % 8 == 0 {
            bytes.push(0);
        }
        if let Some(last) = bytes.last_mut() {
            *last |= u8::from(flag) << (index % 8);
        }
    }
    bytes
}

/// Bit `index` of [`bits`]; a missing byte reads as zeros.
pub(crate) fn bit(bytes: &[u8], index: usize) -> bool {
    bytes
        .get(index / 8)
        .is_some_and(|byte| byte >> (index % 8) & 1 == 1)
}

/// Checks that a column has as many entries as the columns beside it.
pub(crate) fn expect_len(
    column: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), MessageError> {
    if expected == found {
        return Ok(());
    }
    Err(MessageError::Column {
        column,
        expected,
        found,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn columns_come_back(
            values in proptest::collection::vec(
                prop_oneof![any::<i64>(), -100_i64..100, Just(i64::MIN), Just(i64::MAX)],
                0..200,
            ),
        ) {
            let column = encode(&values);
            let read = decode("column", column.as_ref(), values.len());
            prop_assert_eq!(read.expect("its own code"), values);
        }

        #[test]
        fn any_bits_are_read_without_harm(
            k in 0_u32..70,
            base in any::<i64>(),
            bits in proptest::collection::vec(any::<u8>(), 0..60),
            count in 0_usize..1_000,
        ) {
            // Whatever comes out, it comes out as a value or as an error.
            let _ = decode("column", Some(&Column { k, base, bits }), count);
        }
    }

    /// The example of `docs/log.md`: 1 010 011, padded.
    #[test]
    fn the_documented_example_is_read_as_it_says() {
        let column = Column {
            k: 0,
            base: 10,
            bits: vec![0b1010_0110],
        };
        assert_eq!(
            decode("column", Some(&column), 3).expect("good"),
            [10, 9, 11]
        );
        assert_eq!(encode(&[10, 9, 11]), Some(column));
    }

    #[test]
    fn jitter_costs_little_more_than_its_logarithm() {
        let values: Vec<i64> = (0..1_000).map(|n| 250_000 + (n * 7_919) % 4_096).collect();
        let column = encode(&values).expect("not empty");
        let bits_each = column.bits.len() as f64 * 8.0 / 1_000.0;
        assert!(bits_each < 13.5, "{bits_each}");
    }
}
