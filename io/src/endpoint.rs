//! The place at which the two ends of a link meet.

use std::path::PathBuf;

/// The place at which the two ends of a link meet.
#[derive(Debug)]
pub enum Endpoint {
    /// A TCP address to listen on.
    Listen(String),
    /// A TCP address to connect to.
    Connect(String),
    /// The path of a link to a pseudo-terminal.
    Pty(PathBuf),
}
