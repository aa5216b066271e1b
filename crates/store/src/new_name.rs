//! Gives files their final names without replacing others.

use std::io::{Error, ErrorKind, Result};
use std::path::Path;

/// Renames `from` to `to` in one step, on one file system. A file `to` is not replaced.
///
/// On file systems that cannot rename in this way, a hard link is made. On those without links, such as
/// FAT on old kernels, the function checks that `to` does not exist before an ordinary rename.
///
/// # Errors
/// [`ErrorKind::AlreadyExists`] if there is a file `to`; otherwise the error of the operating system.
pub fn rename_without_replacing(from: &Path, to: &Path) -> Result<()> {
    match rename_exclusively(from, to) {
        Err(error) if !is_unsupported(&error) => return Err(error),
        Ok(()) => return Ok(()),
        Err(_) => {}
    }
    match std::fs::hard_link(from, to) {
        Ok(()) => std::fs::remove_file(from),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(error),
        Err(_) if to.symlink_metadata().is_ok() => Err(ErrorKind::AlreadyExists.into()),
        Err(_) => std::fs::rename(from, to),
    }
}

#[cfg(target_os = "linux")]
fn rename_exclusively(from: &Path, to: &Path) -> Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE)?)
}

#[cfg(not(target_os = "linux"))]
fn rename_exclusively(_: &Path, _: &Path) -> Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// The file system or the kernel does not know the flag.
fn is_unsupported(error: &Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::Unsupported | ErrorKind::InvalidInput
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_exists_is_not_replaced() {
        let directory = tempfile::tempdir().expect("a directory");
        let [from, to] = ["from", "to"].map(|name| directory.path().join(name));
        std::fs::write(&from, "new").expect("written");
        std::fs::write(&to, "old").expect("written");
        let refused = rename_without_replacing(&from, &to).expect_err("refused");
        assert_eq!(refused.kind(), ErrorKind::AlreadyExists);
        assert_eq!(std::fs::read(&to).expect("there"), b"old");
        std::fs::remove_file(&to).expect("removed");
        rename_without_replacing(&from, &to).expect("renamed");
        assert_eq!(std::fs::read(&to).expect("there"), b"new");
        assert!(!from.exists());
    }
}
