//! `--control`: commands to a running simulator, one line of JSON each, over TCP.

mod args;
mod commands;
mod session;
mod socket;

use std::sync::Arc;
use std::thread;

use anyhow::{Context as _, Result};
use cellwire_sim::host::{Listener, Server};
use cellwire_sim::{Device, Simulator};
use serde_json::{Map, Value, json};

pub use self::args::{Args, Command, one_of};
use self::commands::Commands;
use self::session::Client;
pub use self::socket::Control;
use crate::devices::device::SimulateOptions;
use cellwire_io::clock::Clock;
use cellwire_io::output::{announce, remark};

/// The fields of an answer.
pub type Fields = Map<String, Value>;

/// Returns these fields of an answer.
pub fn fields<const N: usize>(fields: [(&str, Value); N]) -> Fields {
    fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Shows an executed command.
pub type Show<W> = Box<dyn Fn(&W) -> Value + Send + Sync>;

/// The commands that only this kind of device has.
#[allow(missing_debug_implementations, reason = "it holds functions")]
pub struct OwnCommands<D: Device> {
    /// The names of the commands, for `help`.
    pub commands: &'static [Command],
    /// Executes one of them, in the thread of the device. An error states what is allowed.
    pub execute: fn(&mut D, Args) -> Result<Fields, String>,
    /// An executed command, for `executed`.
    pub show: Show<D::Work>,
}

impl SimulateOptions {
    /// Prints the line that reports the device as ready, and its addresses. Executes commands to the device in a thread from
    /// now on, with `--control`.
    ///
    /// # Errors
    /// Standard output is closed; the system cannot start the thread.
    pub fn ready<D: Device + 'static>(
        &self,
        device: &'static str,
        kind: &str,
        place: &str,
        simulator: &mut Simulator<D>,
        own: OwnCommands<D>,
    ) -> Result<()> {
        let Some(Control(listener)) = &self.control else {
            return announce(&json!({"ready": device, kind: place}));
        };
        let control = listener.local_addr()?.to_string();
        announce(&json!({"ready": device, kind: place, "control": control}))?;
        let listener = Listener::new(listener.try_clone()?)?;
        let commands = Arc::new(Commands { device, remote: simulator.remote(), own });
        let thread = thread::Builder::new().name("control".into()).spawn(move || {
            let clock = Clock::start();
            let server = Server::new(listener, || clock.now());
            let served: Result<()> = server.run(Client::new(commands), || true, |_, _| Ok(()));
            if let Err(error) = served {
                remark(&format!("warning: --control has ended: {error:#}"));
            }
        });
        thread.context("cannot start a thread for --control").map(drop)
    }
}
