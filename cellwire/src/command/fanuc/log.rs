//! `cellwire fanuc log`.

use core::ops::RangeInclusive;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{LineWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Result, ensure};
use clap::ValueEnum;
use fanuc_hmi_modbus::typed::OrderProbe;
use fanuc_hmi_modbus::{TelemetryBlock, WordOrder};
use humantime::format_rfc3339_millis;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value, json};

use super::{USES, print};
use crate::command::ls::{GeometryArgs, limits};
use crate::command::settings::SetArgs;
use crate::devices::fanuc_hmi_modbus::client::{Port, PortKind};
use crate::io::samples::Samples;
use crate::report::Report;
use crate::telemetry::Implausible;
use crate::telemetry::logger::{Logger, Reading, TelemetrySource};
use crate::telemetry::recording::{self, Recording};
use cellwire_io::bar;
use cellwire_io::clock::Clock;
use cellwire_io::files;
use cellwire_io::input::time;
use cellwire_io::interrupt::{Policy, on_interrupt};
use cellwire_io::output::{counted, remark};
use cellwire_io::tcp::TimeoutArgs;
use cellwire_io::tls::TlsArgs;
use cellwire_links::fanuc_hmi_modbus::Frames;
use cellwire_motion::plausibility::{Fault, Plausibility};

const ENDED: files::FileWriteError = files::FileWriteError(Cow::Borrowed("the recording ends early"));

/// Logs the telemetry block of a controller, as a table.
///
/// Each line has the clock time (UTC), the time by the robot's life counter, the reported values, and the speeds without the
/// controller's steps. The word order is detected from the life counter. Runs for the time of --for, or until interrupted;
/// lines are written at once.
///
/// A line with a `note` is not a motion sample. An implausible block has one of nan, infinite, denormal, quaternion (not of unit
/// length), unreachable (by the robot of --limits, or by any) and standstill (of the life counter), with the value. A controller
/// that is off is waited for (`not connected`, `connected`). A lost connection is reopened after 0.1 to 5 s; `disconnected` and
/// `reconnected` are notes too, and so are `no block for …` (the
/// controller has not replied within the setting `timeout`) and `restarted`, after which the time starts at 0 again.
///
/// Runs of the background task that the interval of --poll skips are not missed: a gap is more than half an interval beyond it.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The controller: HOST:PORT, where the port is usually 502
    server: String,
    /// The file to write; a number is appended to its name if it exists
    #[arg(long, value_name = "FILE")]
    csv: PathBuf,
    /// How long to log [default: until interrupted]
    #[arg(long = "for", value_name = "TIME", value_parser = time(Duration::from_millis(1)..=Duration::MAX))]
    duration: Option<Duration>,
    /// The period of the background task
    #[arg(long, value_name = "TIME", default_value = "8ms", value_parser = time(PERIODS))]
    period: Duration,
    /// The polling interval [default: the period of the task]
    #[arg(long, value_name = "TIME", value_parser = time(PERIODS))]
    poll: Option<Duration>,
    /// The PDU address of the block's first register: $ADDRESS - 1 of its first assignment [default: the setting `address`
    /// of a file, or 0]
    #[arg(long, value_name = "N")]
    address: Option<u16>,
    /// The Modbus unit [default: the setting `unit` of a file, or 1]
    #[arg(long, value_name = "N")]
    unit: Option<u8>,
    /// Word order of 32-bit values [default: the setting `word_order` of a file, or auto]
    #[arg(long, value_enum)]
    word_order: Option<OrderArg>,
    /// The robot description, as for `ls make`, to mark unreachable poses
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    #[command(flatten)]
    geometry: GeometryArgs,
    #[command(flatten)]
    connect: TimeoutArgs,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    set: SetArgs,
    /// Print one JSON object at the end instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
enum OrderArg {
    /// Detected from the life counter
    Auto,
    LowFirst,
    HighFirst,
}

/// The periods of a task, and of polls.
const PERIODS: RangeInclusive<Duration> = Duration::from_millis(1)..=Duration::from_secs(60);

pub(super) fn log(args: &Args) -> Result<bool> {
    let (end, period) = (args.duration, args.period);
    let poll = args.poll.unwrap_or(period);
    let robot = match &args.limits {
        Some(path) => {
            let limits = limits(path)?;
            Some((args.geometry.arm(limits.arm)?, limits))
        }
        None => None,
    };
    let given = args.set.read_client("fanuc log", &USES)?;
    let view = given.view;
    let kind = PortKind::Tcp {
        server: args.server.clone(),
        rtu: view.frames == Frames::Rtu,
        tls: args.tls.client()?,
    };
    let mut port = Port::new(kind, args.set.dialing(None, args.connect)?);
    args.set.configure(&given, &mut port.config)?;
    let timeout = port.config.timeout;
    on_interrupt(Policy::Note)?;
    let clock = Clock::start();
    let unit = args.unit.or(view.unit).unwrap_or(1);
    let address = args.address.or(view.address).unwrap_or(TelemetryBlock::ADDRESS);
    let source = TelemetrySource { port, unit, address, poll };
    let mut logger = Logger::open(source, clock)?;
    let (file, csv) = files::create_new(&args.csv)?;
    let target =
        if args.json { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(10) };
    // The log has no end that a bar could show.
    let progress = ProgressBar::with_draw_target(None, target).with_style(ProgressStyle::default_spinner());
    bar::show_bar(&progress);
    let known = match args.word_order {
        None => given.word_order,
        Some(OrderArg::Auto) => None,
        Some(OrderArg::LowFirst) => Some(WordOrder::LowFirst),
        Some(OrderArg::HighFirst) => Some(WordOrder::HighFirst),
    };
    let mut log = Log {
        out: LineWriter::new(file), // whole lines, however it ends
        order: Order { known, probe: OrderProbe::default(), contradicted: None, waiting: Vec::new() },
        plausibility: Plausibility::new(robot, period, poll),
        recording: Recording::new(period, poll),
        turn_around: Samples::default(),
        tally: Tally::default(),
        unread: BlockTimeout { timeout, since: clock.now(), failed: false },
        lost_at: None,
        is_first: true,
        progress,
        clock,
    };
    let unwritten = |error: anyhow::Error| match error.is::<std::io::Error>() {
        true => error.context(format!("cannot write {}", csv.display())).context(ENDED),
        false => error,
    };
    writeln!(log.out, "utc,{}", recording::HEADER).map_err(|error| unwritten(error.into()))?;
    let outcome = logger.run(end, |reading| log.take(reading).map(|()| true).map_err(unwritten));
    log.end().map_err(unwritten)?;
    if log.tally.blocks > 0 || log.tally.failed > 0 || args.json {
        print(&log.report(&args.server, &csv), args.json)?;
    }
    if let Some(order) = log.order.contradicted {
        let order = json!(order);
        remark(&format!("warning: the life counter indicates word order {order}: these values are wrong"));
    }
    let samples = log.recording.counts().samples;
    if let Some(why) = log.tally.why.filter(|_| samples == 0) {
        remark(&format!("error: no samples: {why}"));
    } else if samples == 0 && log.tally.blocks > 0 && log.tally.faults.is_empty() {
        let blocks = log.tally.blocks;
        remark(&format!(
            "error: none of {blocks} blocks is usable: no life counter counts in them: {NO_COUNTER}"
        ));
    }
    let wrong: u64 = log.tally.faults.values().sum();
    if wrong > 0 && outcome.as_ref().err().is_none_or(|error| !error.is::<Implausible>()) {
        return Err(Implausible(format!(
            "{wrong} of {} implausible: see the column `note` of {}",
            counted(log.tally.blocks, "block"),
            csv.display()
        ))
        .into());
    }
    outcome?;
    Ok(samples > 0)
}

/// The causes to check if the life counter does not count.
const NO_COUNTER: &str = "is the background task (ls background) running, and does $SNPX_ASG show R[1] at address 1, or at --address plus 1? \
                          --word-order logs it anyway";

/// A log that is being written.
struct Log {
    out: LineWriter<std::fs::File>,
    order: Order,
    plausibility: Plausibility,
    recording: Recording,
    turn_around: Samples,
    tally: Tally,
    unread: BlockTimeout,
    /// The time at which the connection was lost, while there is no other.
    lost_at: Option<Duration>,
    /// Whether there has been no connection to lose.
    is_first: bool,
    progress: ProgressBar,
    clock: Clock,
}

/// The time without a block on an open connection.
struct BlockTimeout {
    /// The longest time that needs no note: the timeout of a request.
    timeout: Duration,
    /// The time of the last block, or at which the connection was opened.
    since: Duration,
    /// Whether a request has failed since then.
    failed: bool,
}

impl BlockTimeout {
    /// Returns the time without a block if it needs a note, and measures from `now` on.
    fn end(&mut self, now: Duration) -> Option<Duration> {
        let time = now.saturating_sub(core::mem::replace(&mut self.since, now));
        (core::mem::take(&mut self.failed) && time > self.timeout).then_some(time)
    }
}

/// Counts that the recording itself does not have.
#[derive(Default)]
struct Tally {
    blocks: u64,
    faults: BTreeMap<Fault, u64>,
    failed: u64,
    /// The reason why there was no block, the last time.
    why: Option<String>,
    disconnected: u64,
    /// The time without a connection, up to the end of the log.
    away: Duration,
}

impl Log {
    fn take(&mut self, reading: Reading<'_>) -> Result<()> {
        match reading {
            Reading::Failed(failure) => {
                self.tally.failed += 1;
                self.unread.failed = true;
                self.progress.set_message(format!("no block: {failure}"));
                self.tally.why = Some(failure.to_owned());
            }
            Reading::Registers(registers, took) => {
                self.turn_around.add(took);
                self.tally.blocks += 1;
                self.is_first = false;
                self.note_unread()?;
                for (at, block) in self.order.push(registers)? {
                    self.block(at, &block)?;
                }
            }
            Reading::Absent(why) => {
                self.lost_at = Some(self.clock.now());
                remark(&format!("{why}; waiting for the controller"));
                self.note("not connected")?;
            }
            Reading::Disconnected(why) => {
                self.tally.disconnected += 1;
                self.is_first = false;
                self.lost_at = Some(self.clock.now());
                remark(&format!("{why}; reconnecting"));
                self.note("disconnected")?;
            }
            Reading::Retried(why) => self.progress.set_message(why.to_owned()),
            Reading::Reconnected(after) => {
                self.tally.away += after;
                self.lost_at = None;
                self.unread.end(self.clock.now());
                self.plausibility.reconnected();
                let connected = if self.is_first { "connected" } else { "reconnected" };
                remark(&format!("{connected} after {:.1} s", after.as_secs_f64()));
                self.note(&format!("{connected} after {:.3} s", after.as_secs_f64()))?;
            }
        }
        Ok(())
    }

    /// Writes a line of something that happened now.
    fn note(&mut self, note: &str) -> Result<()> {
        self.stamp(SystemTime::now())?;
        Ok(recording::write_event(&mut self.out, note)?)
    }

    /// Begins a line with its clock time.
    fn stamp(&mut self, at: SystemTime) -> Result<()> {
        Ok(write!(self.out, "{},", format_rfc3339_millis(at))?)
    }

    /// Writes a note if there was no block for longer than the timeout.
    fn note_unread(&mut self) -> Result<()> {
        if let Some(time) = self.unread.end(self.clock.now()) {
            self.note(&format!("no block for {:.3} s", time.as_secs_f64()))?;
        }
        Ok(())
    }

    /// Writes the line of a block that was read `at` this time.
    fn block(&mut self, at: SystemTime, block: &TelemetryBlock) -> Result<()> {
        if let Some((fault, value)) = self.plausibility.check(block, self.clock.now()) {
            *self.tally.faults.entry(fault).or_default() += 1;
            self.progress.set_message(format!("implausible block: {} ({value})", fault.name()));
            self.stamp(at)?;
            return Ok(recording::write_marked(&mut self.out, block, &format!("{} {value}", fault.name()))?);
        }
        let restarts = self.recording.counts().restarts;
        if let Some(sample) = self.recording.push(block) {
            self.stamp(at)?;
            recording::write_row(&mut self.out, block, &sample)?;
            let [x, y, z] = block.position;
            let seconds = sample.time.as_secs_f64();
            self.progress.set_message(format!("{seconds:7.2} s  X {x:.1}  Y {y:.1}  Z {z:.1} mm"));
            self.recording.forget(); // the file has it
        } else if self.recording.counts().restarts > restarts {
            self.note("restarted")?;
        }
        Ok(())
    }

    /// Writes the blocks that still wait for their word order as if it were the usual one, with a mark.
    fn end(&mut self) -> Result<()> {
        bar::clear_bar();
        match self.lost_at.take() {
            Some(lost) => self.tally.away += self.clock.now().saturating_sub(lost),
            None => self.note_unread()?,
        }
        for (at, registers) in std::mem::take(&mut self.order.waiting) {
            self.stamp(at)?;
            let block = TelemetryBlock::from_registers(&registers, WordOrder::LowFirst);
            recording::write_marked(&mut self.out, &block, "word order unknown")?;
        }
        Ok(())
    }

    fn report(&self, server: &str, csv: &Path) -> Report {
        let counts = self.recording.counts();
        let title = format!("telemetry of {server} in {}", csv.display());
        let mut report = Report::new("fanuc", title);
        report.fact("samples", "samples written", counts.samples);
        report.fact("repeated", "task runs read twice", counts.repeated);
        report.fact("gaps", "gaps", counts.gaps);
        report.fact("missed", "task runs missed", counts.missed);
        report.fact("restarts", "restarts of the life counter", counts.restarts);
        report.fact("failed", "failed requests", self.tally.failed);
        report.fact("disconnected", "connections lost", self.tally.disconnected);
        if self.tally.away > Duration::ZERO {
            let away = self.tally.away.as_secs_f64();
            report.fact("away_s", "seconds disconnected", json!((away * 1e3).round() / 1e3));
        }
        let count = |fault| self.tally.faults.get(&fault).copied().unwrap_or(0);
        let wrong: u64 = self.tally.faults.values().sum();
        report.fact("implausible", "implausible blocks", wrong);
        for (fault, key, label) in Fault::ALL {
            match count(fault) {
                0 => report.field(key, Value::from(0)),
                count => report.fact(key, label, count),
            }
        }
        if let Some(found) = self.order.known {
            report.fact("word_order", "word order", json!(found));
        }
        report.timing("turn_around", "request to block", &self.turn_around, None);
        report
    }
}

/// Blocks wait here until their word order is known.
struct Order {
    known: Option<WordOrder>,
    probe: OrderProbe,
    /// The word order that the life counter shows, if that is not the one in which the blocks are read.
    contradicted: Option<WordOrder>,
    /// The blocks, and the clock time at which each was read.
    waiting: Vec<(SystemTime, [u16; 37])>,
}

impl Order {
    /// The number of blocks after which a life counter that has not shown the word order is stalled, or is something else.
    const STALLED_AFTER: usize = 500;

    /// Returns the blocks whose word order is known now.
    fn push(&mut self, registers: &[u16; 37]) -> Result<Vec<(SystemTime, TelemetryBlock)>> {
        let [first, second, ..] = *registers;
        let found = self.probe.watch([first, second]);
        self.known = self.known.or(found);
        self.contradicted = found.filter(|_| found != self.known);
        self.waiting.push((SystemTime::now(), *registers));
        let Some(order) = self.known else {
            ensure!(
                self.waiting.len() < Self::STALLED_AFTER,
                Implausible(format!(
                    "the life counter does not count (it reads {first:#06X} {second:#06X}): {NO_COUNTER}"
                ))
            );
            return Ok(Vec::new());
        };
        Ok(self
            .waiting
            .drain(..)
            .map(|(at, registers)| (at, TelemetryBlock::from_registers(&registers, order)))
            .collect())
    }
}
