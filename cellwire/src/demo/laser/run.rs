//! The host: that of `cellwire run laser`, with an operator who never repeats an instruction.

use std::io;
use std::time::Duration;

use anyhow::Result;
use laser_eb90::HostConfig;
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait, now};
use serde_json::Value;

use crate::demo::operator::Operator;
use crate::io::journal::Tally;
use crate::io::samples::Samples;
use crate::run::Console;
use crate::run::laser::{Journal, Program, RunEnd, Runner};
use cellwire_io::port::AnyPort;
use cellwire_sim::ledger::ReportedOutcome;

/// A host on a port, with the path that it cuts.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Cutter<'a> {
    port: MeasuredPort,
    program: &'a Program,
    config: HostConfig,
    journal: Journal,
    /// The reported outcome of each instruction; `None` before a report.
    pub known: Vec<Option<ReportedOutcome>>,
    /// The number of frames that were refused to the end; their instructions were sent in a later frame.
    pub refused: u64,
}

impl<'a> Cutter<'a> {
    /// Creates a host at the beginning of the path.
    pub fn new(port: AnyPort, program: &'a Program, config: HostConfig) -> Self {
        let parts = program.instructions.len();
        let port = MeasuredPort { port, sent: None, exchange: Samples::default() };
        Self {
            port,
            program,
            config,
            journal: Journal::unwritten(parts),
            known: vec![None; parts],
            refused: 0,
        }
    }

    /// Cuts for `time` after the first answer, or to the end of the path, with `batch` instructions in a frame; returns how many
    /// instructions were queued in a second. A new host waits first until bytes of an earlier host have passed: `begun` is
    /// called after that.
    ///
    /// # Errors
    /// If the port fails.
    pub fn cut(
        &mut self,
        time: Duration,
        batch: u8,
        mut progress: impl FnMut(u64),
        mut begun: impl FnMut(),
    ) -> Result<f64> {
        let Self { port, program, config, journal, known, refused } = self;
        let config = HostConfig { batch, ..*config };
        let (operator, typed) = Operator::new();
        let mut watch = Watch { operator, time, begun: &mut begun, known, queued: 0, from: None };
        let notify = &mut |event| watch.take(&event);
        let progress = &mut |tally: Tally| progress(tally.done as u64);
        let mut runner = Runner::new(program, journal, config, Console::new(typed, notify, progress));
        while runner.run(&mut *port)? == RunEnd::Refused {
            *refused += 1;
        }
        Ok(watch.rate())
    }

    /// Returns the times from a frame to its answer.
    pub fn exchange(&self) -> &Samples {
        &self.port.exchange
    }
}

/// The operator's view of a run: what is reported.
struct Watch<'a> {
    operator: Operator,
    /// The time after the first answer at which the run is stopped.
    time: Duration,
    begun: &'a mut dyn FnMut(),
    known: &'a mut [Option<ReportedOutcome>],
    /// The number of instructions that were queued since `from`, the time of the first answer.
    queued: u64,
    from: Option<Duration>,
}

impl Watch<'_> {
    /// Takes an event of the host.
    fn take(&mut self, event: &Value) -> Result<()> {
        let reported = match event["event"].as_str() {
            Some("done") => ReportedOutcome::Done,
            Some("refused") => ReportedOutcome::NotDone,
            Some("unknown") => {
                // The host asks next. To take them for done repeats nothing.
                self.operator.say("done")?;
                ReportedOutcome::Unknown
            }
            _ => return Ok(()),
        };
        let number = |key: &str| event[key].as_u64().and_then(|number| usize::try_from(number).ok());
        let (first, count) = (number("first").unwrap_or(1) - 1, number("count").unwrap_or_default());
        self.known.iter_mut().skip(first).take(count).for_each(|known| *known = Some(reported));
        if self.from.is_none() {
            self.from = Some(now());
            self.operator.stop_at(now() + self.time);
            (self.begun)();
        } else if reported == ReportedOutcome::Done {
            self.queued += count as u64;
        }
        Ok(())
    }

    fn rate(&self) -> f64 {
        self.from.map_or(0.0, |from| self.queued as f64 / now().saturating_sub(from).as_secs_f64().max(1e-9))
    }
}

/// A port that measures the times from a frame to its answer.
struct MeasuredPort {
    port: AnyPort,
    /// The time of the last frame, if nothing has come since.
    sent: Option<Duration>,
    exchange: Samples,
}

impl Transport for MeasuredPort {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let received = self.port.receive(buffer, wait)?;
        if let (ReceiveOutcome::Bytes(_), Some(sent)) = (received, self.sent) {
            self.exchange.add(now().saturating_sub(sent));
            self.sent = None;
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.sent = Some(now());
        self.port.send(bytes)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.port.discard_after(after)
    }
}
