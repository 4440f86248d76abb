//! A participant with keys. All of them are checked before a socket is opened.

use rustdds::{DomainParticipant, DomainParticipantBuilder};

use crate::args::security::{Enclave, SecurityError};
use crate::node::middleware::OpenError;

#[cfg(not(feature = "security"))]
pub(super) fn build(_: DomainParticipantBuilder, _: Enclave) -> Result<DomainParticipant, OpenError> {
    Err(SecurityError::NotBuiltIn.into())
}

#[cfg(feature = "security")]
pub(super) fn build(
    builder: DomainParticipantBuilder,
    enclave: Enclave,
) -> Result<DomainParticipant, OpenError> {
    use rustdds::DomainParticipantSecurityConfigFiles;
    use rustdds::dds::CreateError;

    if let Err(text) = keys::check(&enclave.folder) {
        return Err(SecurityError::Refused { enclave, text }.into());
    }
    let files = DomainParticipantSecurityConfigFiles::with_ros_default_names(&enclave.folder, String::new());
    builder.builtin_security(files).build().map_err(|error| match error {
        CreateError::NotAllowedBySecurity { reason } => {
            SecurityError::Refused { enclave, text: reason }.into()
        }
        other => OpenError::opening("a DDS participant")(other),
    })
}

/// What `RustDDS` does not look at, and without which the node would be alive and mute.
#[cfg(feature = "security")]
mod keys {
    use std::path::Path;

    use openssl::asn1::Asn1Time;
    use openssl::error::ErrorStack;
    use openssl::pkey::PKey;
    use openssl::x509::X509;
    use tracing::warn;

    use crate::args::security::{DataProtection, data_protection};

    pub(super) fn check(folder: &Path) -> Result<(), String> {
        let read = |name: &str| std::fs::read(folder.join(name)).map_err(|error| format!("{name}: {error}"));
        identity(read)?;
        governance(&String::from_utf8_lossy(&read("governance.p7s")?))
    }

    /// Others refuse an identity whose key is another's; an expired one should not be trusted.
    fn identity(read: impl Fn(&str) -> Result<Vec<u8>, String>) -> Result<(), String> {
        let is_no = |name: &str, what: &str| {
            let (name, what) = (name.to_owned(), what.to_owned());
            move |error: ErrorStack| format!("{name} is no {what}: {error}")
        };
        let certificate = |name: &str| X509::from_pem(&read(name)?).map_err(is_no(name, "certificate"));
        let now = Asn1Time::days_from_now(0).map_err(|error| error.to_string())?;
        for name in ["identity_ca.cert.pem", "permissions_ca.cert.pem", "cert.pem"] {
            let certificate = certificate(name)?;
            let (from, until) = (certificate.not_before(), certificate.not_after());
            if now < *from || now > *until {
                return Err(format!("{name} is valid only from {from} to {until}"));
            }
        }
        let key = PKey::private_key_from_pem(&read("key.pem")?).map_err(is_no("key.pem", "private key"))?;
        let public = certificate("cert.pem")?.public_key().map_err(is_no("cert.pem", "certificate"))?;
        if public.public_eq(&key) { Ok(()) } else { Err("key.pem is not the key of cert.pem".to_owned()) }
    }

    /// `RustDDS` 0.15.1 drops every full fragment with a protected payload: it compares the length with that of the plain
    /// text. What is larger than a datagram never arrives then, which is every cloud.
    fn governance(document: &str) -> Result<(), String> {
        const REMEDY: &str =
            "set it to NONE: metadata_protection_kind or rtps_protection_kind ENCRYPT encrypts data too";
        match data_protection(document) {
            DataProtection::OfNothing => Ok(()),
            DataProtection::OfSome => {
                warn!(
                    "governance.p7s has data_protection_kind other than NONE for some topics, of which nothing larger \
                     than a datagram arrives; {REMEDY}"
                );
                Ok(())
            }
            DataProtection::OfAll => Err(format!(
                "governance.p7s has data_protection_kind other than NONE, with which nothing larger than a datagram \
                 would arrive, so no cloud; {REMEDY}"
            )),
        }
    }
}
