//! Instants that several frames have in common while a log is read.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

/// Instants of the frame that is furthest, s. The others have the first of them.
#[derive(Clone, Debug, Default)]
pub struct CommonInstants(Rc<RefCell<Arc<Vec<f64>>>>);

impl CommonInstants {
    /// Whether the instants that follow the first `count` are `new`. Instants of `new` beyond the last
    /// common one are added; `expected` is the number of all instants.
    pub fn go_on(&self, count: usize, new: &[f64], expected: usize) -> bool {
        let mut shared = self.0.borrow_mut();
        let known = &shared[count..];
        let (old, added) = new.split_at(known.len().min(new.len()));
        if known[..old.len()] != *old {
            return false;
        }
        if !added.is_empty() {
            let all = Arc::make_mut(&mut shared);
            if all.is_empty() {
                all.reserve_exact(expected);
            }
            all.extend_from_slice(added);
        }
        true
    }

    /// The first `count` instants.
    pub fn first(&self, count: usize) -> Arc<Vec<f64>> {
        let shared = self.0.borrow();
        match count == shared.len() {
            true => Arc::clone(&shared),
            false => Arc::new(shared[..count].to_vec()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_share_instants_until_they_differ() {
        let common = CommonInstants::default();
        // Two frames take turns; each is ahead once.
        assert!(common.go_on(0, &[0.0, 0.1], 4) && common.go_on(0, &[0.0, 0.1, 0.2], 4));
        assert!(common.go_on(2, &[0.2, 0.3], 4) && common.go_on(3, &[0.3], 4));
        assert!(Arc::ptr_eq(&common.first(4), &common.first(4)));
        // A third one has another instant: what it has so far stays, and nothing is added.
        assert!(common.go_on(0, &[0.0], 4) && !common.go_on(1, &[0.15, 0.2, 0.3, 0.4], 4));
        assert_eq!(*common.first(1), [0.0]);
        assert_eq!(*common.first(4), [0.0, 0.1, 0.2, 0.3]);
    }
}
