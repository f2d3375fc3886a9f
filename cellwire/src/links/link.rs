//! What the tool knows of a link.

use core::fmt::Debug;

use anyhow::Result;
use serde_json::{Map, Value};

use crate::links::codec::Codec;
use crate::links::device::Device;
use crate::links::settings::Setting;

/// A link.
pub trait Link: Debug + Sync {
    /// The crate's name.
    fn name(&self) -> &'static str;

    /// What it is, in one line.
    fn about(&self) -> &'static str;

    /// The names of the sides that send, for `--from`; the first is the default.
    fn sides(&self) -> &'static [&'static str];

    /// The side that sends, in a capture: the TCP client, or the server on this port.
    fn sender(&self, is_client: bool, server_port: u16) -> &'static str;

    /// What can be set of its codec, and the defaults.
    fn settings(&self) -> Vec<Setting>;

    /// The codec of what one of its sides sends, with settings other than the link's defaults, as in the vectors' `options`:
    /// `{"framing":"rtu"}`.
    ///
    /// # Errors
    /// When a setting is not one of this link.
    fn codec(&self, side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>>;

    /// Which sides sent what the trace of this name has sent and received; `None` when the name is none of the link's. A side that
    /// sends no messages is none.
    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]>;

    /// Its ends that can be simulated.
    fn devices(&self) -> &'static [&'static dyn Device];
}
