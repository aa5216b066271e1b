//! Who may use the server.
//!
//! Any web page can open a connection to 127.0.0.1, and can have its own name resolved to it. So the
//! header `Host` must name this server, and a request of another origin needs the token, on loopback
//! too. On another address than loopback, everything needs the token. Whatever writes (marks, start,
//! stop) needs it everywhere.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Mutex, PoisonError};

use axum::http::{HeaderMap, Uri, header};

/// Name of the cookie of a session.
const COOKIE: &str = "atvrec";
/// Most sessions; the oldest ends.
const SESSIONS_MAX: usize = 256;
/// Shortest token, characters.
pub const TOKEN_MIN: usize = 16;

/// Rules of a server.
pub struct Access {
    address: SocketAddr,
    hosts: Vec<String>,
    token: Option<String>,
    sessions: Mutex<VecDeque<String>>,
}

/// What a request may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// Read.
    Read,
    /// Read, and set marks, start and stop.
    Write,
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The header `Host` names another server.
    Host,
    /// The request comes from a page of another server, without the token.
    Origin,
    /// There is no token.
    NoToken,
    /// The token is wrong.
    WrongToken,
}

impl Refusal {
    /// Text for people.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Host => {
                "this server does not have that name; use its address, or add the name to live.hosts \
                 of the configuration\n"
            }
            Self::Origin => "pages of other servers need the token of this one\n",
            Self::NoToken => {
                "open the page once with ?token=TOKEN behind its address; the token is in the file \
                 live.token_file of the configuration\n"
            }
            Self::WrongToken => {
                "the token is wrong; it is in the file live.token_file of the configuration, or of \
                 --token-file, and `atvrec live` in a terminal prints it\n"
            }
        }
    }
}

impl Access {
    /// Rules of a server at `address` with the further names `hosts`.
    #[must_use]
    pub fn new(address: SocketAddr, hosts: Vec<String>, token: Option<String>) -> Self {
        Self {
            address,
            hosts,
            token,
            sessions: Mutex::default(),
        }
    }

    /// What a request may do.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn check(&self, headers: &HeaderMap, uri: &Uri) -> Result<Permission, Refusal> {
        let host = text(headers, header::HOST).unwrap_or_default();
        if !self.is_own(host) {
            return Err(Refusal::Host);
        }
        let given = given_token(headers, uri);
        let has_token = match (&given, &self.token) {
            (Some(given), Some(token)) if same(given, token) => true,
            (Some(_), _) => return Err(Refusal::WrongToken),
            (None, _) => false,
        };
        let origin = text(headers, header::ORIGIN);
        let is_same_origin = origin.is_none_or(|origin| {
            let rest = origin.split_once("://").map(|(_, rest)| rest);
            rest.is_some_and(|rest| rest.eq_ignore_ascii_case(host))
        });
        if has_token {
            return Ok(Permission::Write);
        }
        if !is_same_origin {
            return Err(Refusal::Origin);
        }
        if self.has_session(headers) {
            return Ok(Permission::Write);
        }
        if self.address.ip().is_loopback() {
            return Ok(Permission::Read);
        }
        Err(Refusal::NoToken)
    }

    /// Whether a host (with or without port) names this server. An address cannot be resolved to
    /// another one, so that any address is allowed if the server listens on all.
    fn is_own(&self, host: &str) -> bool {
        let name = match host.rsplit_once(':') {
            Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) => {
                if port.parse() != Ok(self.address.port()) {
                    return false;
                }
                name
            }
            _ => host,
        };
        let bare = name.trim_start_matches('[').trim_end_matches(']');
        let own = self.address.ip();
        match bare.parse::<IpAddr>() {
            Ok(ip) => ip == own || ip.is_loopback() || own.is_unspecified(),
            Err(_) => {
                let is_named = |known: &String| known.eq_ignore_ascii_case(bare);
                bare.eq_ignore_ascii_case("localhost") || self.hosts.iter().any(is_named)
            }
        }
    }

    /// Begins a session and returns the value of the header `Set-Cookie`.
    ///
    /// # Errors
    /// If the operating system gives no random bytes.
    pub fn begin_session(&self, secure: bool) -> std::io::Result<String> {
        let id = random_token()?;
        let mut sessions = self.sessions.lock().unwrap_or_else(PoisonError::into_inner);
        if sessions.len() == SESSIONS_MAX {
            sessions.pop_front();
        }
        sessions.push_back(id.clone());
        let secure = if secure { "; Secure" } else { "" };
        Ok(format!(
            "{COOKIE}={id}; Path=/; HttpOnly; SameSite=Strict; Max-Age=2592000{secure}"
        ))
    }

    fn has_session(&self, headers: &HeaderMap) -> bool {
        let cookies = text(headers, header::COOKIE).unwrap_or_default();
        let mut given = cookies
            .split(';')
            .filter_map(|cookie| cookie.trim().split_once('='))
            .filter(|(name, _)| *name == COOKIE)
            .map(|(_, id)| id);
        let sessions = self.sessions.lock().unwrap_or_else(PoisonError::into_inner);
        given.any(|id| sessions.iter().any(|known| same(id, known)))
    }
}

/// Token of the address or of the header `Authorization`.
fn given_token(headers: &HeaderMap, uri: &Uri) -> Option<String> {
    let bearer = text(headers, header::AUTHORIZATION).and_then(|h| h.strip_prefix("Bearer "));
    bearer.map(str::to_owned).or_else(|| token_of(uri))
}

/// Token in the query of an address.
pub(crate) fn token_of(uri: &Uri) -> Option<String> {
    let mut pairs = uri.query()?.split('&');
    pairs.find_map(|pair| pair.strip_prefix("token=").map(str::to_owned))
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// Compares in a time that does not depend on where the texts differ.
fn same(a: &str, b: &str) -> bool {
    let differences = a
        .bytes()
        .zip(b.bytes())
        .fold(0, |sum, (a, b)| sum | (a ^ b));
    a.len() == b.len() && differences == 0
}

/// A random token of 32 hexadecimal digits.
///
/// # Errors
/// If the operating system gives no random bytes.
pub fn random_token() -> std::io::Result<String> {
    let mut bytes = [0_u8; 16];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "0123456789abcdef";

    fn check(address: &str, headers: &[(&str, &str)], uri: &str) -> Result<Permission, Refusal> {
        let address = address.parse().expect("an address");
        let access = Access::new(
            address,
            vec!["vehicle.local".to_owned()],
            Some(TOKEN.to_owned()),
        );
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            let name: header::HeaderName = name.parse().expect("a name");
            map.insert(name, value.parse().expect("a value"));
        }
        access.check(&map, &uri.parse().expect("an address"))
    }

    #[test]
    fn host_and_origin_are_checked_on_loopback_too() {
        let local = "127.0.0.1:8765";
        let with_token = format!("/?token={TOKEN}");
        for (headers, uri, expected) in [
            (vec![("host", local)], "/", Ok(Permission::Read)),
            (vec![("host", "localhost:8765")], "/", Ok(Permission::Read)),
            (vec![("host", "[::1]:8765")], "/", Ok(Permission::Read)),
            (
                vec![("host", "vehicle.local:8765")],
                "/",
                Ok(Permission::Read),
            ),
            (vec![], "/", Err(Refusal::Host)),
            (vec![("host", "evil.example:8765")], "/", Err(Refusal::Host)),
            (vec![("host", "127.0.0.1:80")], "/", Err(Refusal::Host)),
            (
                vec![("host", local), ("origin", "http://127.0.0.1:8765")],
                "/",
                Ok(Permission::Read),
            ),
            (
                vec![("host", local), ("origin", "https://evil.example")],
                "/ws",
                Err(Refusal::Origin),
            ),
            (
                vec![("host", local), ("origin", "null")],
                "/ws",
                Err(Refusal::Origin),
            ),
            (
                vec![("host", local), ("origin", "https://evil.example")],
                &with_token,
                Ok(Permission::Write),
            ),
            (
                vec![("host", local)],
                "/?token=wrong",
                Err(Refusal::WrongToken),
            ),
        ] {
            assert_eq!(check(local, &headers, uri), expected, "{headers:?} {uri}");
        }
    }

    #[test]
    fn another_address_needs_the_token_for_everything() {
        let host = ("host", "192.168.1.5:8765");
        let any = "0.0.0.0:8765";
        assert_eq!(check(any, &[host], "/"), Err(Refusal::NoToken));
        let bearer = format!("Bearer {TOKEN}");
        let bearer = ("authorization", bearer.as_str());
        assert_eq!(check(any, &[host, bearer], "/"), Ok(Permission::Write));
        assert_eq!(
            check(any, &[host, ("authorization", "Bearer x")], "/"),
            Err(Refusal::WrongToken)
        );
    }

    #[test]
    fn a_session_replaces_the_token() {
        let address = "0.0.0.0:8765".parse().expect("an address");
        let access = Access::new(address, Vec::new(), Some(TOKEN.to_owned()));
        let cookie = access.begin_session(false).expect("random bytes");
        assert!(cookie.contains("HttpOnly") && !cookie.contains(TOKEN));
        let value = cookie.split(';').next().expect("a value");
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, "10.0.0.1:8765".parse().expect("a host"));
        headers.insert(header::COOKIE, value.parse().expect("a cookie"));
        let uri = "/ws".parse().expect("an address");
        assert_eq!(access.check(&headers, &uri), Ok(Permission::Write));
        headers.insert(header::COOKIE, "atvrec=0".parse().expect("a cookie"));
        assert_eq!(access.check(&headers, &uri), Err(Refusal::NoToken));
    }
}
