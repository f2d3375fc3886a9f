//! Shared parts of every link's tests. Never published.
//!
//! - [`contract`]: decoders and ends of the table as the subjects that `robot_session::contract` takes
//! - [`link`]: a link between two sessions on a virtual clock, with the faults that its transport can commit
//! - [`model`]: the machine of an end with its peer as one system, every state of which is explored
//! - `controller` (feature `links`, on by default): a Kawasaki robot as the tests use it, ours and the one that AS programs make
//! - `links` (feature `links`): the ends of each link as such systems
//! - `soak` (feature `links`): both ends of every session over bad transports

/// The examples of the project's README.
#[cfg(all(doctest, feature = "links"))]
#[doc = include_str!("../../README.md")]
struct Readme;

/// The example of a fuzzed program.
#[cfg(all(doctest, feature = "links"))]
#[doc = include_str!("../../docs/fuzzing.md")]
struct Fuzzing;

pub mod contract;
#[cfg(feature = "links")]
pub mod controller;
mod faults;
pub mod link;
#[cfg(feature = "links")]
pub mod links;
pub mod model;
#[cfg(feature = "links")]
pub mod soak;
pub mod uart;

use std::path::{Path, PathBuf};

/// Returns whether the tests over the table of links include this one: all links, or only the one in `LINK`.
pub fn is_tested(link: &str) -> bool {
    std::env::var("LINK").map_or(true, |only| only == link)
}

/// Returns the path of a file of the reference: beside the program if it runs without the workspace, otherwise in the
/// workspace.
pub fn reference_file(path: &str) -> PathBuf {
    let beside = std::env::current_exe().unwrap_or_default().with_file_name("reference");
    let folder =
        if beside.is_dir() { beside } else { Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference") };
    folder.join(path)
}

/// Reads a file of the reference.
///
/// # Panics
/// If there is no such file, or it is not JSON.
pub fn reference(path: &str) -> serde_json::Value {
    let file = reference_file(path);
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    serde_json::from_str(&text).unwrap()
}
