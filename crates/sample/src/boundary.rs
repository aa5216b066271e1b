//! Panics of a dependency become errors at the place where the dependency is called.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use crate::text::printable;

thread_local! {
    /// Whether this thread is inside [`guarded`].
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Installs the hook that prints nothing for a panic inside [`guarded`].
static HOOK: Once = Once::new();

/// Calls a parser of a dependency and gives what it returns.
///
/// # Errors
/// The message of the panic, if the call panics. The panic hook prints nothing in that case. The
/// caller drops the values that the call could have left half changed.
pub fn guarded<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    HOOK.call_once(|| {
        let earlier = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !GUARDED.get() {
                earlier(info);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(call));
    GUARDED.set(outer);
    result.map_err(|panic| printable(&message(panic.as_ref())).into_owned())
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "panic without a message".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_message() {
        let number = guarded(|| 7);
        assert_eq!(number, Ok(7));
        let values: [i32; 0] = [];
        let index = values.len();
        let error = guarded(|| panic!("row {} \u{1b}[2J", index + 3) as i32);
        assert_eq!(error, Err("row 3 \\u001b[2J".to_owned()));
        let error = guarded(|| guarded(|| panic!("inner")).map(|()| 1));
        assert_eq!(error, Ok(Err("inner".to_owned())));
    }
}
