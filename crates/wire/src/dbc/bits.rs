//! Bit fields of a frame.

/// Byte order of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Intel: the start bit is the least significant one.
    Little,
    /// Motorola: the start bit is the most significant one.
    Big,
}

/// How the bits of a signal make a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawKind {
    /// Without sign.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bits.
    Float,
    /// IEEE 754, 64 bits.
    Double,
}

/// Where a signal's bits are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    pub order: ByteOrder,
    /// First byte touched.
    first: usize,
    /// Last byte touched.
    last: usize,
    /// How far the value is shifted up within these bytes.
    shift: u32,
    /// Number of bits, 1 to 64.
    pub width: u32,
}

impl Field {
    /// The field of `width` bits from `start`, counted as DBC files do. `None` unless it has 1 to
    /// 64 bits and starts within 2048 bytes.
    pub fn new(order: ByteOrder, start: u64, width: u64) -> Option<Self> {
        let width = u32::try_from(width).ok().filter(|w| (1..=64).contains(w))?;
        let start = usize::try_from(start).ok().filter(|s| *s < 2048 * 8)?;
        let first = start / 8;
        let (last, shift) = match order {
            ByteOrder::Little => {
                let end = start + width as usize - 1;
                (end / 8, start % 8)
            }
            ByteOrder::Big => {
                let from_top = first * 8 + 7 - start % 8;
                let end = from_top + width as usize - 1;
                (end / 8, 7 - end % 8)
            }
        };
        Some(Self {
            order,
            first,
            last,
            shift: shift as u32,
            width,
        })
    }

    /// Bytes that a frame must have for the field to be whole.
    pub const fn bytes_needed(&self) -> usize {
        self.last + 1
    }

    /// Its bits, right-aligned; `None` if the data is too short.
    pub fn extract(&self, data: &[u8]) -> Option<u64> {
        let bytes = data.get(self.first..=self.last)?;
        let word = match self.order {
            ByteOrder::Little => bytes.iter().rev().fold(0_u128, push_byte),
            ByteOrder::Big => bytes.iter().fold(0_u128, push_byte),
        };
        Some((word >> self.shift) as u64 & self.mask())
    }

    /// Writes the low bits of `value`; `false` if the data is too short.
    pub fn insert(&self, data: &mut [u8], value: u64) -> bool {
        let Some(bytes) = data.get_mut(self.first..=self.last) else {
            return false;
        };
        let mut mask = u128::from(self.mask()) << self.shift;
        let mut word = u128::from(value & self.mask()) << self.shift;
        let mut write = |byte: &mut u8| {
            *byte = *byte & !(mask as u8) | word as u8;
            mask >>= 8;
            word >>= 8;
        };
        match self.order {
            ByteOrder::Little => bytes.iter_mut().for_each(&mut write),
            ByteOrder::Big => bytes.iter_mut().rev().for_each(&mut write),
        }
        true
    }

    /// Data in which exactly its bits are set.
    pub fn mask_bytes(&self) -> Vec<u8> {
        let mut marked = vec![0; self.bytes_needed()];
        self.insert(&mut marked, u64::MAX);
        marked
    }

    const fn mask(&self) -> u64 {
        u64::MAX >> (64 - self.width)
    }
}

fn push_byte(word: u128, byte: &u8) -> u128 {
    word << 8 | u128::from(*byte)
}

/// Two's complement of `width` bits.
pub const fn sign_extend(raw: u64, width: u32) -> i64 {
    let unused = 64 - width;
    ((raw << unused) as i64) >> unused
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Bit by bit, as the file format's description puts it.
    fn reference(order: ByteOrder, start: usize, width: usize, data: &[u8]) -> Option<u64> {
        let mut value = 0;
        let mut position = start;
        for index in 0..width {
            let bit = u64::from(data.get(position / 8)? >> (position % 8) & 1);
            match order {
                ByteOrder::Little => {
                    value |= bit << index;
                    position += 1;
                }
                ByteOrder::Big => {
                    value = value << 1 | bit;
                    position = if position.is_multiple_of(8) {
                        position + 15
                    } else {
                        position - 1
                    };
                }
            }
        }
        Some(value)
    }

    proptest! {
        #[test]
        fn fields_equal_the_bitwise_definition(
            big in any::<bool>(),
            start in 0_u64..512,
            width in 1_u64..=64,
            data in proptest::collection::vec(any::<u8>(), 0..=64),
            value in any::<u64>(),
        ) {
            let order = if big { ByteOrder::Big } else { ByteOrder::Little };
            let field = Field::new(order, start, width).expect("within bounds");
            let expected = reference(order, start as usize, width as usize, &data);
            prop_assert_eq!(field.extract(&data), expected);
            let mut written = data.clone();
            prop_assert_eq!(field.insert(&mut written, value), expected.is_some());
            if expected.is_some() {
                prop_assert_eq!(field.extract(&written), Some(value & field.mask()));
                let marked: u32 = field.mask_bytes().iter().map(|byte| byte.count_ones()).sum();
                prop_assert_eq!(u64::from(marked), width);
                field.insert(&mut written, expected.unwrap_or_default());
                prop_assert_eq!(written, data);
            }
        }
    }

    #[test]
    fn impossible_fields_are_refused() {
        assert_eq!(Field::new(ByteOrder::Little, 0, 0), None);
        assert_eq!(Field::new(ByteOrder::Big, 0, 65), None);
        assert_eq!(Field::new(ByteOrder::Little, u64::MAX, 1), None);
    }

    #[test]
    fn signs_extend() {
        assert_eq!(sign_extend(0b100, 3), -4);
        assert_eq!(sign_extend(0b011, 3), 3);
        assert_eq!(sign_extend(u64::MAX, 64), -1);
    }
}
