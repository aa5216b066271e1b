//! An allocator that counts: tests that a loop asks for no memory install it.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator with a count of its allocations for each thread:
/// `#[global_allocator] static COUNTING: testkit::Counting = testkit::Counting;`
pub struct Counting;

/// Allocations of the calling thread so far, where [`Counting`] is installed.
#[must_use]
pub fn allocations() -> u64 {
    COUNT.with(Cell::get)
}

// SAFETY: each call goes to the system's allocator as it came; the count is the thread's own.
#[allow(unsafe_code, reason = "an allocator cannot be written without it")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}
