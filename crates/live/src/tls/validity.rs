//! Dates of a certificate.

use rustls_pki_types::{CertificateDer, UnixTime};
use tokio_rustls::rustls::client::verify_server_cert_signed_by_trust_anchor;
use tokio_rustls::rustls::server::ParsedCertificate;
use tokio_rustls::rustls::{CertificateError, Error, RootCertStore};
use wire::gps_time::Utc;

/// What is wrong with the dates of the certificates of a chain at `now`. Other properties of the
/// certificates are not examined.
pub(super) fn problem(chain: &[CertificateDer<'_>], now: UnixTime) -> Option<String> {
    chain.iter().find_map(|certificate| {
        let parsed = ParsedCertificate::try_from(certificate).ok()?;
        // The dates are compared before a trusted issuer is looked for, and there is none.
        let none = RootCertStore::empty();
        let checked = verify_server_cert_signed_by_trust_anchor(&parsed, &none, &[], now, &[]);
        match checked {
            Err(Error::InvalidCertificate(CertificateError::ExpiredContext {
                not_after, ..
            })) => Some(format!("expired on {}", date(not_after))),
            Err(Error::InvalidCertificate(CertificateError::NotValidYetContext {
                not_before,
                ..
            })) => Some(format!(
                "is not valid before {}, and this computer's clock shows {}",
                date(not_before),
                date(now)
            )),
            _ => None,
        }
    })
}

fn date(time: UnixTime) -> String {
    let Utc {
        year,
        month,
        day,
        hour,
        minute,
        ..
    } = Utc::of_unix_s(time.as_secs());
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use rustls_pki_types::pem::PemObject;

    use super::*;

    /// Valid from 2020-01-01 00:00:00 to 2021-01-02 03:04:05.
    const CERTIFICATE: &[u8] = include_bytes!("../../../../testdata/tls/expired.pem");

    #[test]
    fn a_certificate_is_valid_from_its_first_to_its_last_second() {
        let certificate = CertificateDer::from_pem_slice(CERTIFICATE).expect("a certificate");
        let at = |unix_s| {
            let now = UnixTime::since_unix_epoch(Duration::from_secs(unix_s));
            problem(std::slice::from_ref(&certificate), now)
        };
        let (first_s, last_s) = (1_577_836_800, 1_609_556_645);
        assert_eq!(at(first_s), None);
        assert_eq!(at(last_s), None);
        let expired = Some("expired on 2021-01-02 03:04 UTC".to_owned());
        assert_eq!(at(last_s + 1), expired);
        let early = "is not valid before 2020-01-01 00:00 UTC, and this computer's clock shows \
                     2019-12-31 23:59 UTC";
        assert_eq!(at(first_s - 1).as_deref(), Some(early));
    }
}
