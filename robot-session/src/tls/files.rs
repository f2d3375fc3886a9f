//! Configurations from files.

use core::fmt;
use std::path::{Path, PathBuf};
use std::string::{String, ToString};
use std::sync::Arc;
use std::vec::Vec;

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{ClientConfig, RootCertStore, ServerConfig};

/// The certificate of an end, and its key.
#[derive(Debug, Clone, Copy)]
pub struct Identity<'a> {
    /// The certificate, followed by those between it and the authority.
    pub certificate: &'a Path,
    /// The PEM file of the certificate's private key.
    pub key: &'a Path,
}

/// A file that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileError {
    /// The path of the file.
    pub file: PathBuf,
    /// The reason that the file cannot be used, for a person.
    pub why: String,
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file.display(), self.why)
    }
}

impl core::error::Error for FileError {}

/// Returns the configuration of a client that connects to servers of this authority. With `own` the client shows its
/// certificate to servers that request one.
///
/// # Errors
/// A file cannot be read, or has other contents.
pub fn client(authority: &Path, own: Option<Identity<'_>>) -> Result<Arc<ClientConfig>, FileError> {
    let builder = ClientConfig::builder().with_root_certificates(roots(authority)?);
    Ok(Arc::new(match own {
        None => builder.with_no_client_auth(),
        Some(own) => {
            let (certificates, key) = own.read()?;
            builder.with_client_auth_cert(certificates, key).map_err(at(own.key))?
        }
    }))
}

/// Returns the configuration of a server. With `clients` the server accepts only clients that have a certificate of this
/// authority.
///
/// # Errors
/// A file cannot be read, or has other contents.
pub fn server(own: Identity<'_>, clients: Option<&Path>) -> Result<Arc<ServerConfig>, FileError> {
    let builder = match clients {
        None => ServerConfig::builder().with_no_client_auth(),
        Some(authority) => {
            let verifier =
                WebPkiClientVerifier::builder(Arc::new(roots(authority)?)).build().map_err(at(authority))?;
            ServerConfig::builder().with_client_cert_verifier(verifier)
        }
    };
    let (certificates, key) = own.read()?;
    builder.with_single_cert(certificates, key).map(Arc::new).map_err(at(own.key))
}

impl Identity<'_> {
    fn read(self) -> Result<(Vec<CertificateDer<'static>>, PrivateKeyDer<'static>), FileError> {
        let key = PrivateKeyDer::from_pem_file(self.key).map_err(at(self.key))?;
        Ok((certificates(self.certificate)?, key))
    }
}

fn roots(file: &Path) -> Result<RootCertStore, FileError> {
    let mut roots = RootCertStore::empty();
    for certificate in certificates(file)? {
        roots.add(certificate).map_err(at(file))?;
    }
    Ok(roots)
}

fn certificates(file: &Path) -> Result<Vec<CertificateDer<'static>>, FileError> {
    let found: Result<Vec<_>, _> = CertificateDer::pem_file_iter(file).map_err(at(file))?.collect();
    match found.map_err(at(file))? {
        none if none.is_empty() => Err(at(file)("it has no certificate")),
        found => Ok(found),
    }
}

/// Returns a function that makes the error of a file.
fn at<E: ToString>(file: &Path) -> impl FnOnce(E) -> FileError {
    move |why| FileError { file: file.into(), why: why.to_string() }
}
