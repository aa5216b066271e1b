//! Outputs that are not regular files.

#[cfg(unix)]
pub(super) use unix::Device;

#[cfg(not(unix))]
pub(super) use other::Device;

#[cfg(unix)]
mod unix {
    use std::fs::{File, OpenOptions};
    use std::io::{self, Write};
    use std::os::fd::AsFd;
    use std::os::unix::fs::FileTypeExt;
    use std::path::Path;

    use crate::Result;
    use crate::output::TargetError;

    /// A target that is not a regular file.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(in crate::output) enum Device {
        StandardOutput,
        StandardError,
        /// A character device, FIFO or socket.
        Other,
    }

    impl Device {
        /// The device of a name.
        pub(in crate::output) fn find(path: &Path) -> Result<Option<Self>> {
            match path.to_str() {
                Some("/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1") => {
                    return Ok(Some(Self::StandardOutput));
                }
                Some("/dev/stderr" | "/dev/fd/2" | "/proc/self/fd/2") => {
                    return Ok(Some(Self::StandardError));
                }
                _ => {}
            }
            let Ok(found) = std::fs::metadata(path) else {
                return Ok(None);
            };
            let of = found.file_type();
            if of.is_block_device() {
                let path = path.to_owned();
                return Err(TargetError::Disk { path }.into());
            }
            let other = of.is_char_device() || of.is_fifo() || of.is_socket();
            Ok(other.then_some(Self::Other))
        }

        pub(in crate::output) fn open(self, path: &Path) -> io::Result<File> {
            Ok(match self {
                Self::StandardOutput => {
                    let mut output = io::stdout().lock();
                    output.flush()?;
                    output.as_fd().try_clone_to_owned()?.into()
                }
                Self::StandardError => io::stderr().as_fd().try_clone_to_owned()?.into(),
                Self::Other => OpenOptions::new().write(true).open(path)?,
            })
        }
    }
}

/// Systems whose devices have no names among the files.
#[cfg(not(unix))]
mod other {
    use std::fs::File;
    use std::io;
    use std::path::Path;

    use crate::Result;

    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(in crate::output) enum Device {}

    impl Device {
        #[allow(
            clippy::unnecessary_wraps,
            reason = "the result is that of the other systems"
        )]
        pub(in crate::output) fn find(_: &Path) -> Result<Option<Self>> {
            Ok(None)
        }

        pub(in crate::output) fn open(self, _: &Path) -> io::Result<File> {
            match self {}
        }
    }
}
