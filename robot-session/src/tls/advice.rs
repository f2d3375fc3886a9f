//! Texts for the errors of a handshake and of certificates, with the remedy.

use std::format;
use std::io;
use std::string::ToString;
use std::vec::Vec;

use rustls::CertificateError as Wrong;
use rustls::{AlertDescription as Alert, Error, InvalidMessage, PeerIncompatible};

/// Returns the same error with advice, if it is one of TLS.
pub(crate) fn advised(error: io::Error) -> io::Error {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        let closed = "the peer has closed the connection without ending TLS: it may not speak TLS, or refuse our certificate";
        return io::Error::new(error.kind(), closed);
    }
    let Some(tls) = error.get_ref().and_then(|inner| inner.downcast_ref::<Error>()) else { return error };
    let what = match tls {
        Error::InvalidCertificate(wrong) => match wrong {
            Wrong::Expired | Wrong::ExpiredContext { .. } => {
                "the peer's certificate has expired, or the clock of this machine is wrong".into()
            }
            Wrong::NotValidYet | Wrong::NotValidYetContext { .. } => {
                "the peer's certificate is not valid yet, or the clock of this machine is wrong".into()
            }
            // Another authority may have the same name.
            Wrong::UnknownIssuer | Wrong::BadSignature => {
                "the peer's certificate is self-signed, or not signed by the given authority".into()
            }
            Wrong::NotValidForNameContext { presented, .. } => {
                // As `DnsName("localhost")` and `IpAddress(127.0.0.1)`.
                let names: Vec<&str> = presented
                    .iter()
                    .map(|it| it.split_once('(').map_or(&**it, |(_, name)| name.trim_matches(['"', ')'])))
                    .collect();
                format!("the peer's certificate is for other names: {}", names.join(", "))
            }
            Wrong::NotValidForName => "the peer's certificate is for other names".into(),
            Wrong::InvalidPurpose | Wrong::InvalidPurposeContext { .. } => {
                "the peer's certificate is not for this use: a server's has serverAuth, a client's clientAuth"
                    .into()
            }
            wrong => format!("the peer's certificate is refused: {wrong}"),
        },
        Error::NoCertificatesPresented => "the client has no certificate, and has to have one".into(),
        Error::AlertReceived(Alert::CertificateRequired) => {
            "the peer requires a certificate: give one with its key".into()
        }
        Error::AlertReceived(Alert::UnknownCA) => {
            "the peer does not know the authority of this end's certificate".into()
        }
        Error::AlertReceived(Alert::CertificateExpired) => {
            "the peer says that this end's certificate has expired".into()
        }
        Error::AlertReceived(
            Alert::BadCertificate | Alert::CertificateUnknown | Alert::DecryptError | Alert::AccessDenied,
        ) => "the peer refuses this end's certificate".into(),
        Error::AlertReceived(Alert::ProtocolVersion)
        // A hello of TLS 1.1 has no such extension.
        | Error::PeerIncompatible(
            PeerIncompatible::Tls12NotOffered | PeerIncompatible::SignatureAlgorithmsExtensionRequired,
        ) => {
            "the peer does not speak TLS 1.2 or 1.3".into()
        }
        Error::InvalidMessage(InvalidMessage::InvalidContentType) => {
            "the peer does not speak TLS on this port".into()
        }
        tls => tls.to_string(),
    };
    io::Error::new(error.kind(), format!("TLS: {what}"))
}
