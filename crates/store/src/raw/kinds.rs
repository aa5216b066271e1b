//! The kinds of frames of a batch, numbered in the order of their first frame.

use std::collections::HashMap;

use sample::CanFrame;

/// Common properties of frames of one kind: identifier, flags, length, [`CanFrame::len8_dlc`].
pub(super) type Kind = (u32, u8, u8, u8);

/// More kinds than a bus has. Beyond this number all kinds are forgotten, so that a faulty bus cannot
/// fill the memory.
const KNOWN_MAX: usize = 4_096;

/// Numbers the kinds of each batch and keeps their usual order between batches.
#[derive(Default)]
pub(super) struct Kinds {
    known: Vec<Known>,
    index: HashMap<Kind, usize>,
    /// Kind of the last frame.
    last: usize,
    /// Kinds of this batch, as positions in `known`.
    order: Vec<usize>,
}

struct Known {
    kind: Kind,
    /// Its number in this batch.
    number: Option<u32>,
}

impl Kinds {
    pub fn begin(&mut self) {
        if self.known.len() > KNOWN_MAX {
            *self = Self::default();
        }
        for place in self.order.drain(..) {
            self.known[place].number = None;
        }
    }

    /// Number of a frame's kind in this batch.
    pub fn of(&mut self, frame: &CanFrame) -> u32 {
        let length = frame.len.min(64);
        let kind = (frame.id, frame.flags.to_bits(), length, frame.len8_dlc);
        let place = self.place(kind);
        self.last = place;
        if let Some(number) = self.known[place].number {
            return number;
        }
        let number = self.order.len() as u32;
        self.known[place].number = Some(number);
        self.order.push(place);
        number
    }

    /// The kinds of this batch, by number.
    pub fn in_batch(&self) -> impl Iterator<Item = Kind> {
        self.order.iter().map(|place| self.known[*place].kind)
    }

    fn place(&mut self, kind: Kind) -> usize {
        // Devices send in a fixed order, so the kind that followed the last one is tried first.
        let next = self.last + 1;
        let guess = if next < self.known.len() { next } else { 0 };
        if self
            .known
            .get(guess)
            .is_some_and(|known| known.kind == kind)
        {
            return guess;
        }
        *self.index.entry(kind).or_insert_with(|| {
            self.known.push(Known { kind, number: None });
            self.known.len() - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use sample::CanFlags;

    use super::*;

    fn numbers(kinds: &mut Kinds, ids: &[u32]) -> Vec<u32> {
        kinds.begin();
        let frame = |id: &u32| CanFrame::new(*id, CanFlags::default(), &[]).expect("a frame");
        ids.iter().map(|id| kinds.of(&frame(id))).collect()
    }

    #[test]
    fn each_batch_numbers_its_own_kinds_in_the_order_in_which_they_come() {
        let mut kinds = Kinds::default();
        assert_eq!(numbers(&mut kinds, &[7, 5, 7, 6]), [0, 1, 0, 2]);
        assert_eq!(numbers(&mut kinds, &[6, 7, 5, 6, 9]), [0, 1, 2, 0, 3]);
        let ids: Vec<u32> = kinds.in_batch().map(|kind| kind.0).collect();
        assert_eq!(ids, [6, 7, 5, 9]);
        assert!(numbers(&mut kinds, &[]).is_empty());
    }

    #[test]
    fn kinds_are_forgotten_beyond_a_limit() {
        let mut kinds = Kinds::default();
        for start in (0..200_000).step_by(1_000) {
            let ids: Vec<u32> = (start..start + 1_000).collect();
            let expected: Vec<u32> = (0..1_000).collect();
            assert_eq!(numbers(&mut kinds, &ids), expected);
            assert!(kinds.known.len() <= KNOWN_MAX + 1_000);
        }
    }
}
