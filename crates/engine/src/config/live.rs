//! `[live]`: where the live process listens.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use model::file::{ErrorCollector, Section};

/// Port by default.
const PORT: u16 = 8765;

/// Where the live process listens, and who may use it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Live {
    /// Address and port.
    pub address: SocketAddr,
    /// File with the token; `None`: no token.
    pub token_file: Option<PathBuf>,
    /// Names beside the address by which browsers may call the server.
    pub hosts: Vec<String>,
    /// Certificate chain and private key (PEM).
    pub tls: Option<[PathBuf; 2]>,
    /// Most clients at the same time.
    pub clients_max: usize,
}

impl Default for Live {
    fn default() -> Self {
        Self {
            address: SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), PORT),
            token_file: None,
            hosts: Vec::new(),
            tls: None,
            clients_max: 16,
        }
    }
}

impl Live {
    /// Reads the table.
    pub fn read(mut section: Section<'_>, collector: &mut ErrorCollector<'_>) -> Self {
        let defaults = Self::default();
        let address = section.optional::<String>("address", collector);
        let token_file = section.optional::<String>("token_file", collector);
        let hosts = section.or("hosts", Vec::new(), collector);
        let certificate = section.optional::<String>("certificate", collector);
        let key = section.optional::<String>("key", collector);
        let clients = section.number_in("clients_max", 1.0..=256.0, 16.0, collector);
        section.finish(collector);
        let address = match &address {
            None => defaults.address,
            Some(field) => match field.value.parse() {
                Ok(address) => address,
                Err(_) => {
                    let message = format!("\"{}\" is not an address with a port", field.value);
                    let help = "use an address such as \"127.0.0.1:8765\" or \"[::]:8765\"";
                    collector.add(&field.span, &field.name, message, help);
                    defaults.address
                }
            },
        };
        let tls = match (certificate, key) {
            (Some(certificate), Some(key)) => {
                Some([certificate, key].map(|field| PathBuf::from(field.value)))
            }
            (None, None) => None,
            (Some(field), None) | (None, Some(field)) => {
                let message = "a certificate needs its key, and a key its certificate";
                let help = "set both live.certificate and live.key to PEM files";
                collector.add(&field.span, &field.name, message, help);
                None
            }
        };
        Self {
            address,
            token_file: token_file.map(|field| PathBuf::from(field.value)),
            hosts,
            tls,
            clients_max: clients as usize,
        }
    }

    /// Resolves paths from the directory of the configuration.
    pub(super) fn look_from(&mut self, directory: &Path) {
        let paths = self
            .token_file
            .iter_mut()
            .chain(self.tls.iter_mut().flatten());
        for path in paths {
            *path = directory.join(&*path);
        }
    }
}
