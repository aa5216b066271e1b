//! What a Parquet file declares, looked at before a reader believes it.
//!
//! Headers of pages and the footer are structures of Thrift's compact protocol ("Thrift compact
//! protocol encoding", `doc/specs/thrift-compact-protocol.md` of Apache Thrift): a byte for the
//! distance to the field's number and its type, numbers as variable-length zigzag integers.

/// Deepest structure that is followed.
const DEPTH_MAX: usize = 32;

const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BYTE: u8 = 3;
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const SET: u8 = 10;
const MAP: u8 = 11;
const STRUCT: u8 = 12;

/// Sizes that the header of a page declares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PageHeader {
    /// Bytes after decompression.
    pub inflated: i64,
    /// Bytes in the file.
    pub stored: i64,
    /// Values of a dictionary.
    pub dictionary_values: i64,
}

/// A position in bytes; `None` where they end or are no such structure.
pub struct Cursor<'b> {
    bytes: &'b [u8],
}

impl<'b> Cursor<'b> {
    /// At the beginning.
    pub const fn new(bytes: &'b [u8]) -> Self {
        Self { bytes }
    }

    /// Whether nothing follows.
    pub const fn is_at_end(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Goes on by so many bytes.
    pub fn advance(&mut self, count: i64) -> Option<()> {
        let count = usize::try_from(count).ok()?;
        self.bytes = self.bytes.get(count..)?;
        Some(())
    }

    /// Reads the header of a page.
    pub fn page_header(&mut self) -> Option<PageHeader> {
        let mut header = PageHeader::default();
        let mut field = 0;
        while let Some(kind) = self.field(&mut field)? {
            match (field, kind) {
                (2, I32) => header.inflated = self.number()?,
                (3, I32) => header.stored = self.number()?,
                (7, STRUCT) => {
                    let mut inner = 0;
                    while let Some(kind) = self.field(&mut inner)? {
                        match (inner, kind) {
                            (1, I32) => header.dictionary_values = self.number()?,
                            _ => self.skip(kind, 1)?,
                        }
                    }
                }
                _ => self.skip(kind, 1)?,
            }
        }
        Some(header)
    }

    /// Deepest level of the schema in a footer, where it is followed that far.
    pub fn schema_depth(&mut self) -> Option<usize> {
        let (mut field, mut deepest) = (0, 0);
        while let Some(kind) = self.field(&mut field)? {
            if (field, kind) == (2, LIST) {
                let (count, _) = self.list()?;
                // How many elements are still to come on each level.
                let mut open: Vec<i64> = Vec::new();
                for _ in 0..count {
                    let children = self.schema_element()?;
                    while let Some(left) = open.last_mut() {
                        if *left > 0 {
                            *left -= 1;
                            break;
                        }
                        open.pop();
                    }
                    if children > 0 {
                        open.push(children);
                        deepest = deepest.max(open.len());
                    }
                    if deepest > DEPTH_MAX {
                        return None;
                    }
                }
            } else {
                self.skip(kind, 1)?;
            }
        }
        Some(deepest)
    }

    /// Number of children of a schema's element.
    fn schema_element(&mut self) -> Option<i64> {
        let (mut field, mut children) = (0, 0);
        while let Some(kind) = self.field(&mut field)? {
            match (field, kind) {
                (5, I32) => children = self.number()?,
                _ => self.skip(kind, 2)?,
            }
        }
        Some(children)
    }

    /// The type of the next field, whose number `field` becomes; `Some(None)` at the end.
    fn field(&mut self, field: &mut i64) -> Option<Option<u8>> {
        let byte = self.byte()?;
        if byte == 0 {
            return Some(None);
        }
        *field = match byte >> 4 {
            0 => self.number()?,
            distance => field.checked_add(i64::from(distance))?,
        };
        Some(Some(byte & 15))
    }

    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        if depth > DEPTH_MAX {
            return None;
        }
        match kind {
            TRUE | FALSE => Some(()),
            BYTE => self.advance(1),
            I16 | I32 | I64 => self.number().map(drop),
            DOUBLE => self.advance(8),
            BINARY => {
                let length = self.varint()?;
                self.advance(i64::try_from(length).ok()?)
            }
            LIST | SET => {
                let (count, kind) = self.list()?;
                (0..count).try_for_each(|_| self.skip_element(kind, depth))
            }
            MAP => {
                let count = self.varint()?;
                let kinds = if count > 0 { self.byte()? } else { 0 };
                (0..count).try_for_each(|_| {
                    self.skip_element(kinds >> 4, depth)?;
                    self.skip_element(kinds & 15, depth)
                })
            }
            STRUCT => {
                let mut field = 0;
                while let Some(kind) = self.field(&mut field)? {
                    self.skip(kind, depth + 1)?;
                }
                Some(())
            }
            _ => None,
        }
    }

    /// In a list a truth value has a byte of its own.
    fn skip_element(&mut self, kind: u8, depth: usize) -> Option<()> {
        match kind {
            TRUE | FALSE => self.advance(1),
            _ => self.skip(kind, depth + 1),
        }
    }

    /// Length and type of a list.
    fn list(&mut self) -> Option<(u64, u8)> {
        let byte = self.byte()?;
        let count = match byte >> 4 {
            15 => self.varint()?,
            count => u64::from(count),
        };
        // Every element takes a byte at least.
        (count <= self.bytes.len() as u64).then_some((count, byte & 15))
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(*first)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn number(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -((value & 1).cast_signed()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_header_is_read_and_its_end_is_found() {
        // type 2, inflated 800, stored 100, dictionary { values 100, encoding 0 }
        let bytes = [
            0x15, 4, 0x15, 0xC0, 0x0C, 0x15, 0xC8, 0x01, 0x4C, 0x15, 0xC8, 0x01, 0x15, 0, 0, 0,
        ];
        let mut cursor = Cursor::new(&bytes);
        let expected = PageHeader {
            inflated: 800,
            stored: 100,
            dictionary_values: 100,
        };
        assert_eq!(cursor.page_header(), Some(expected));
        assert!(cursor.is_at_end());
        for cut in 0..bytes.len() {
            assert_eq!(Cursor::new(&bytes[..cut]).page_header(), None, "{cut}");
        }
    }

    #[test]
    fn a_schema_within_a_schema_within_a_schema_ends() {
        let element = [0x55, 2, 0];
        let schema = |count: u8| {
            let mut bytes = vec![0x29, 0xFC, count];
            bytes.extend(element.repeat(usize::from(count)));
            bytes.push(0);
            bytes
        };
        assert_eq!(Cursor::new(&schema(10)).schema_depth(), Some(10));
        assert_eq!(Cursor::new(&schema(100)).schema_depth(), None);
    }
}
