//! The endpoint of a simulated serial device: a pseudo-terminal under a path, or a TCP port like that of a serial device server.

use anyhow::Result;

use crate::line::{Clock, Line};
use crate::serial::PtyLink;
use crate::simulate::{Endpoint, SimulateOptions, ready};
use crate::tcp;

/// Runs `device` on a line at `baud` until the process is interrupted. `name` is the name of the device, `trace` that of its
/// traces.
///
/// # Errors
/// When the endpoint cannot be opened; whatever `device` returns.
pub fn serve(
    name: &str,
    trace: &str,
    options: &SimulateOptions,
    baud: u32,
    device: impl FnOnce(&mut Line, Clock) -> Result<()>,
) -> Result<()> {
    let clock = Clock::start();
    let trace = options.trace.start(trace);
    match &options.endpoint {
        Endpoint::Pty(path) => {
            let (_link, port) = PtyLink::create(path)?;
            let mut line = Line::over_port(port, clock, baud, trace)?;
            ready(name, "pty", &path.to_string_lossy())?;
            device(&mut line, clock)
        }
        Endpoint::Listen(address) => {
            let listener = tcp::listen(address)?;
            ready(name, "listen", &listener.local_addr()?.to_string())?;
            device(&mut Line::over_tcp(listener, clock, baud, trace), clock)
        }
        Endpoint::Connect(_) => anyhow::bail!("{name} is on a serial line: use --pty or --listen"),
    }
}
