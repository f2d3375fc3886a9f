use std::net::TcpListener;

use anyhow::{Context as _, Result};

use cellwire_io::tcp;

/// The socket on which commands to a simulator arrive.
#[derive(Debug)]
pub struct Control(pub(super) TcpListener);

impl Control {
    /// Listens on this address; a port alone means 127.0.0.1.
    ///
    /// # Errors
    /// The address is invalid or in use.
    pub fn bind(address: &str) -> Result<Self> {
        Ok(Self(tcp::listen(address).context("--control")?))
    }
}
