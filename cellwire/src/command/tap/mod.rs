//! `cellwire tap`: connects two ends, or listens to them, and shows their messages.

mod decoding;
mod lines;
mod screen;
mod split;
mod transport;

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, ScopedJoinHandle};
use std::time::Duration;

use anyhow::{Result, bail};

use self::decoding::TapDecoder;
pub(super) use self::transport::{TapTransport, TapTransportArgs};
use super::codec::LinkArgs;
use crate::io::capture::write::{CaptureEnd, Writer};
use crate::io::tap::Watch;
use cellwire_io::interrupt::{Policy, before_exit, on_interrupt};
use cellwire_io::output::{self, EventArgs, remark};

/// Shows the messages of both ends of a link: forwards their bytes unchanged, or only listens.
///
/// Prints a line for each message, with its time (UTC) and sender, and for each error in the bytes, with the clause of the link's
/// specification; in a pipe these are lines of JSON. The bytes are captured for Wireshark, `decode` and `identify`; the file
/// is valid whenever the tap ends.
///
/// Shadow ends follow both ends: a line with "shadow" reports that an end broke a rule ("rule"), was later than the source
/// allows ("budget"), or contradicted a default setting of this project's sessions ("assumption"), with the
/// clause. If the tap begins in the middle of a conversation, they synchronise first.
///
/// Bytes are forwarded before anything else is done with them. A full disk, blocked output and undecodable messages do not
/// affect the two ends.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    of: LinkArgs,
    #[command(flatten)]
    transport: TapTransportArgs,
    /// Show both ends on a live screen instead of lines
    #[arg(long)]
    screen: bool,
    /// The capture file; a number is added if it exists
    #[arg(long, value_name = "FILE", default_value = "tap.pcapng")]
    capture: PathBuf,
    /// Write no capture
    #[arg(long, conflicts_with = "capture")]
    no_capture: bool,
    #[command(flatten)]
    events: EventArgs,
}

const EXAMPLES: &str = "\
Examples:
  cellwire tap kawasaki --listen 0.0.0.0:9105 --connect 192.168.0.10:9105
      the robot connects to this machine instead of its PC
  cellwire tap laser --a /dev/ttyUSB0 --b /dev/ttyUSB1 --baud 115200
      this machine between the PC, at one adapter, and the controller
  cellwire tap alter --a COM3 --b COM4 --baud 19200 --listen-only
      two receive lines of a Y cable
  cellwire decode kawasaki tap.pcapng
      the same messages again, from the capture

The ends see only a delay of some microseconds. RTS, DTR and breaks of a serial
line are not forwarded: use a Y cable (--listen-only) where they are needed.";

/// On a line that carries both directions nothing more comes of what was sent before such a silence.
const SILENCE: Duration = Duration::from_millis(100);

/// Runs until interrupted, or until a port is gone.
pub fn run(args: &Args) -> Result<bool> {
    let decoding = TapDecoder::new(&args.of, args.transport.baud())?;
    args.events.choose();
    if args.screen {
        screen::check()?;
    }
    let transport = TapTransport::open(&args.transport)?;
    transport.advise(args.of.link.short, &args.transport);
    output::never_wait()?;
    on_interrupt(Policy::End)?;
    let mut watch = Watch::default();
    thread::scope(|scope| {
        let mut last = CaptureCloser::default();
        if !args.no_capture {
            let writer = Writer::create(&args.capture, args.of.link.short)?;
            remark(&format!("capture: {}", writer.path().display()));
            let seen = watch.add();
            let written = last.of(&watch);
            scope.spawn(move || written.send(writer.record(&seen)));
        }
        let seen = watch.add();
        if !args.screen {
            transport.announce()?;
        }
        // An unreachable server is reported at once.
        let remarks = args.screen.then(screen::remarks);
        let passing = scope.spawn(move || transport.pass(&args.transport, &watch));
        if let Some(remarks) = remarks {
            screen::show(args.of.link.short, decoding, &seen, &remarks)?;
            if !passing.is_finished() {
                // The threads that pass bytes on wait for them.
                last.finish();
                output::finish();
                std::process::exit(0);
            }
            return join(passing);
        }
        // Until the ports are gone.
        lines::print(decoding, &seen);
        join(passing)
    })?;
    Ok(true)
}

/// Writes the rest of a capture when the program ends, also by a signal.
#[derive(Debug, Clone, Default)]
pub(super) struct CaptureCloser(Arc<Mutex<Option<OpenCapture>>>);

/// The watch to be closed, and the message of the writer when the capture has ended.
type OpenCapture = (Watch, Receiver<CaptureEnd>);

/// The time that the rest of a capture may take.
const FINISH_TIMEOUT: Duration = Duration::from_secs(5);

impl CaptureCloser {
    /// Registers the capture file of the tap; its writer sends the way in which it has ended.
    pub(super) fn of(&mut self, watch: &Watch) -> Sender<CaptureEnd> {
        let (written, wait) = channel();
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((watch.clone(), wait));
        let last = self.clone();
        before_exit(move || last.finish());
        written
    }

    /// Waits until everything that was seen is written.
    pub(super) fn finish(&self) {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some((watch, written)) = last else { return };
        watch.close();
        if matches!(written.recv_timeout(FINISH_TIMEOUT), Err(RecvTimeoutError::Timeout)) {
            remark(&format!(
                "warning: the capture lacks its end, which was not written within {} s",
                FINISH_TIMEOUT.as_secs()
            ));
        }
    }
}

/// Joins a thread; returns its result.
pub(super) fn join(thread: ScopedJoinHandle<'_, Result<()>>) -> Result<()> {
    thread.join().unwrap_or_else(|_| bail!("a thread has panicked"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_panics_is_an_error() {
        thread::scope(|scope| {
            assert!(join(scope.spawn(|| Ok(()))).is_ok());
            let error = join(scope.spawn(|| panic!("as it is tested"))).unwrap_err();
            assert_eq!(error.to_string(), "a thread has panicked");
        });
    }
}
