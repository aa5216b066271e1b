//! Path, permissions and clients of the control socket.

use std::collections::VecDeque;
use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::net::{SocketAddr, UnixStream as BlockingStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use engine::Config;
use tokio::net::{UnixListener, UnixStream};
use tokio::task::{AbortHandle, JoinSet};

use super::ControlHandler;

/// Most clients that are connected at the same time. The oldest idle client is disconnected for a
/// new one.
const CLIENTS_MAX: usize = 64;
/// Directory of the sockets of system services, and name of the directory below `XDG_RUNTIME_DIR`.
const SYSTEM_DIRECTORY: &str = "/run/atvrec";
const USER_DIRECTORY: &str = "atvrec";
/// Name of the socket in the storage directory, which is used if there is no runtime directory.
const STORAGE_NAME: &str = "control";
/// Most characters of the storage directory's name that the name of a socket contains.
const NAME_MAX: usize = 24;
/// Mode of the socket: read and write for user and group.
const MODE: u32 = 0o660;

/// Possible paths of the socket of a recorder with this configuration: the path in the configuration
/// if it has one, else a path in the runtime directory of the system, of the user, and in the storage
/// directory, in this order. Recorders with different storage directories have different sockets.
pub fn paths(config: &Config) -> Vec<PathBuf> {
    if let Some(path) = &config.control {
        return vec![path.clone()];
    }
    let name = name_for(&config.storage.directory);
    let mut paths = vec![Path::new(SYSTEM_DIRECTORY).join(&name)];
    #[allow(
        clippy::disallowed_methods,
        reason = "the login session sets its runtime directory in the environment"
    )]
    let runtime = std::env::var_os("XDG_RUNTIME_DIR");
    if let Some(user) = runtime.filter(|path| !path.is_empty()) {
        paths.push(Path::new(&user).join(USER_DIRECTORY).join(&name));
    }
    paths.push(config.storage.directory.join(STORAGE_NAME));
    paths
}

/// Possible paths of the tap beside the control sockets.
pub fn tap_paths(control: &[PathBuf]) -> Vec<PathBuf> {
    let beside = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.strip_suffix(".socket").unwrap_or(&name);
        path.with_file_name(format!("{stem}.tap"))
    };
    control.iter().map(beside).collect()
}

/// `<name of the directory>-<hash of its whole path>.socket`
fn name_for(directory: &Path) -> String {
    let whole = directory
        .canonicalize()
        .or_else(|_| std::path::absolute(directory))
        .unwrap_or_else(|_| directory.to_owned());
    let last = whole.file_name().unwrap_or_default().to_string_lossy();
    let last: String = last
        .chars()
        .filter(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'))
        .take(NAME_MAX)
        .collect();
    // FNV-1a with 64 bits: the same in every version of the program.
    let bytes = whole.as_os_str().as_encoded_bytes();
    let hash = bytes.iter().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01B3)
    });
    format!("{last}-{hash:016x}.socket")
}

/// Listening socket; its file is removed when it is dropped.
pub struct Listener {
    listener: UnixListener,
    path: PathBuf,
    /// Device and inode of the socket.
    identity: (u64, u64),
    _lock: Lock,
}

impl Listener {
    /// Opens the socket at the first of these paths that works.
    pub fn open(paths: &[PathBuf]) -> anyhow::Result<Self> {
        let mut reasons = Vec::new();
        for path in paths {
            if paths.len() > 1 {
                create_directory(path);
            }
            match Self::open_at(path) {
                Ok(listener) => return Ok(listener),
                Err(error) => reasons.push(format!("{}: {error:#}", path.display())),
            }
        }
        bail!("{}", reasons.join("; "))
    }

    /// Opens the socket. Only a stale socket (without a listener) is replaced.
    fn open_at(path: &Path) -> anyhow::Result<Self> {
        SocketAddr::from_pathname(path)
            .context("the path is too long for a socket; set control.socket to a shorter one")?;
        let lock = Lock::take(path)?;
        match path.symlink_metadata() {
            Ok(found) if !found.file_type().is_socket() => {
                bail!(
                    "a file that is not a socket has this path and is not replaced; set \
                     control.socket to another path"
                );
            }
            Ok(_) => remove_stale(path)?,
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error).context("cannot read the file's type"),
        }
        let listener = bind(path).context(
            "cannot create the socket; set control.socket to a path on another file system",
        )?;
        let made = path
            .symlink_metadata()
            .context("cannot read the socket's identity")?;
        Ok(Self {
            listener,
            path: path.to_owned(),
            identity: (made.dev(), made.ino()),
            _lock: lock,
        })
    }

    /// Path of the socket.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Accepts the next client.
    pub async fn accept(&self) -> io::Result<UnixStream> {
        Ok(self.listener.accept().await?.0)
    }

    /// Serves clients until the future is dropped.
    pub async fn serve(&self, handler: ControlHandler) {
        let mut clients = Clients::default();
        loop {
            tokio::select! {
                accepted = self.listener.accept() => match accepted {
                    Ok((stream, _)) => clients.admit(stream, &handler),
                    Err(error) => {
                        tracing::warn!(%error, "the control socket cannot accept a client; the next attempt is in 1 s");
                        tokio::time::sleep(Duration::from_secs(1)).await;
                    }
                },
                Some(_) = clients.tasks.join_next(), if !clients.tasks.is_empty() => {}
            }
        }
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let identity = |found: std::fs::Metadata| (found.dev(), found.ino());
        if self.path.symlink_metadata().map(identity).ok() == Some(self.identity) {
            // The next start replaces a socket that could not be removed.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Creates the directory of a default path. A failure shows when the socket is created.
fn create_directory(path: &Path) {
    if let Some(directory) = path.parent() {
        let _ = DirBuilder::new().mode(0o750).create(directory);
    }
}

/// Removes a socket without a listener.
fn remove_stale(path: &Path) -> anyhow::Result<()> {
    match BlockingStream::connect(path) {
        Err(error) if error.kind() == ErrorKind::ConnectionRefused => {
            std::fs::remove_file(path).context("cannot remove the old socket")
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        _ => bail!(
            "another program listens on the socket; set storage.directory or control.socket to \
             another path"
        ),
    }
}

/// Binds a socket that has its final mode as soon as its path exists: the socket is bound in a private
/// directory beside the path and then linked to the path, which never replaces a file.
fn bind(path: &Path) -> io::Result<UnixListener> {
    let parent = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    let private = PrivateDirectory(parent.join(format!(".c{}", std::process::id())));
    DirBuilder::new().mode(0o700).create(&private.0)?;
    let name = private.socket();
    let listener = UnixListener::bind(&name)?;
    std::fs::set_permissions(&name, Permissions::from_mode(MODE))?;
    std::fs::hard_link(&name, path)?;
    Ok(listener)
}

/// A directory that only this user can enter; removed when dropped.
struct PrivateDirectory(PathBuf);

impl PrivateDirectory {
    fn socket(&self) -> PathBuf {
        self.0.join("s")
    }
}

impl Drop for PrivateDirectory {
    fn drop(&mut self) {
        // A directory that is left does no harm: its name contains the process id.
        let _ = std::fs::remove_file(self.socket());
        let _ = std::fs::remove_dir(&self.0);
    }
}

/// Lock of the recorder that owns the socket: if several recorders start at once, one gets it.
struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    fn take(socket: &Path) -> anyhow::Result<Self> {
        let name = socket.file_name().context("the path has no file name")?;
        let path = socket.with_file_name(format!(".{}.lock", name.to_string_lossy()));
        for _ in 0..16 {
            let file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .mode(0o600)
                .open(&path)
                .with_context(|| format!("cannot create {}", path.display()))?;
            let locked = file.try_lock();
            ensure!(
                locked.is_ok(),
                "another recorder owns the socket; set storage.directory or control.socket to \
                 another path"
            );
            // The last owner may have removed the file between the two calls.
            let identity = |found: std::fs::Metadata| (found.dev(), found.ino());
            if path.symlink_metadata().map(identity).ok() == file.metadata().map(identity).ok() {
                return Ok(Self { path, _file: file });
            }
        }
        bail!(
            "another process removes {} repeatedly; set control.socket to another path",
            path.display()
        )
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The connected clients, at most [`CLIENTS_MAX`].
#[derive(Default)]
struct Clients {
    tasks: JoinSet<()>,
    /// In the order of their connection; true while a request is handled.
    open: VecDeque<(AbortHandle, Arc<AtomicBool>)>,
}

impl Clients {
    fn admit(&mut self, stream: UnixStream, handler: &ControlHandler) {
        self.open.retain(|(task, _)| !task.is_finished());
        if self.open.len() >= CLIENTS_MAX {
            let idle = |(_, busy): &(_, Arc<AtomicBool>)| !busy.load(Ordering::Relaxed);
            let Some(oldest) = self.open.iter().position(idle) else {
                // Dropping the stream closes it.
                return;
            };
            if let Some((task, _)) = self.open.remove(oldest) {
                task.abort();
            }
        }
        let busy = Arc::new(AtomicBool::new(false));
        let (handler, shared) = (handler.clone(), Arc::clone(&busy));
        let task = self.tasks.spawn(async move {
            if let Err(error) = handler.serve_client(stream, &shared).await {
                tracing::debug!(%error, "no response was sent to a control client");
            }
        });
        self.open.push_back((task, busy));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runtime() -> tokio::runtime::Runtime {
        tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .expect("a runtime")
    }

    fn refused(path: &Path) -> String {
        match Listener::open(&[path.to_owned()]) {
            Ok(_) => panic!("{} was opened", path.display()),
            Err(error) => format!("{error:#}"),
        }
    }

    #[test]
    fn only_a_socket_without_a_listener_is_replaced() {
        let _guard = runtime();
        let _entered = _guard.enter();
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("control");
        let target = directory.path().join("atvrec.toml");
        std::fs::write(&target, "text").expect("written");
        std::os::unix::fs::symlink(&target, &path).expect("a link");
        assert!(refused(&path).contains("not a socket"));
        std::fs::remove_file(&path).expect("removed");
        std::fs::create_dir(&path).expect("a directory");
        assert!(refused(&path).contains("not a socket"));
        std::fs::remove_dir(&path).expect("removed");
        assert!(refused(&target).contains("not a socket"));
        assert_eq!(std::fs::read_to_string(&target).expect("there"), "text");

        // Stale: bound, never listened to again.
        drop(std::os::unix::net::UnixListener::bind(&path).expect("bound"));
        let first = Listener::open(std::slice::from_ref(&path)).expect("opened");
        assert!(refused(&path).contains("another recorder"));
        let mode = path.metadata().expect("there").permissions().mode();
        assert_eq!(mode & 0o777, 0o660);
        drop(first);
        let left: Vec<_> = std::fs::read_dir(directory.path())
            .expect("there")
            .map(|entry| entry.expect("an entry").file_name())
            .collect();
        assert_eq!(left, ["atvrec.toml"]);
    }

    #[test]
    fn an_unusable_path_is_an_error_with_the_next_step() {
        let directory = tempfile::tempdir().expect("a directory");
        let long = directory.path().join("n".repeat(120));
        assert!(refused(&long).contains("too long"));
        assert!(refused(&directory.path().join("absent/control")).contains("cannot create"));
    }

    #[test]
    fn one_of_many_simultaneous_starts_gets_the_socket() {
        let runtime = runtime();
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("control");
        drop(std::os::unix::net::UnixListener::bind(&path).expect("bound"));
        let barrier = std::sync::Barrier::new(8);
        let opened = std::thread::scope(|scope| {
            let start = || {
                let _entered = runtime.enter();
                barrier.wait();
                let mine = Listener::open(std::slice::from_ref(&path)).ok();
                barrier.wait();
                mine.is_some_and(|listener| BlockingStream::connect(listener.path()).is_ok())
            };
            let threads: Vec<_> = (0..8).map(|_| scope.spawn(start)).collect();
            let joined = threads.into_iter().map(|t| t.join().expect("no panic"));
            joined.filter(|opened| *opened).count()
        });
        assert_eq!(opened, 1);
    }

    #[test]
    fn socket_names_depend_on_the_whole_path() {
        let (a, b) = (
            name_for(Path::new("/a/logs")),
            name_for(Path::new("/b/logs")),
        );
        assert!(
            a.starts_with("logs-") && b.starts_with("logs-") && a != b,
            "{a} {b}"
        );
        assert_eq!(a, name_for(Path::new("/a/logs")));
        assert!(name_for(Path::new(&format!("/a/{}", "x/y ä".repeat(99)))).len() < 60);
    }
}
