//! `cellwire run kawasaki`: the PC's end of a Kawasaki robot.

use std::io::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Result, ensure};
use indicatif::ProgressBar;
use serde_json::json;

use super::work::{self, RunInput, WorkArgs, ended, say_resumed};
use crate::command::settings::connect_settings;
use crate::devices::device::Endpoint;
use crate::devices::kawasaki_msg::peer_endpoint::{PeerEndpoint, Side};
use crate::devices::kawasaki_msg::simulate::pc_config;
use crate::io::journal::Tally;
use crate::run::Console;
use crate::run::kawasaki::{Jobs, Journal, RunEnd, Runner, Settings};
use cellwire_io::bell::Bell;
use cellwire_io::input::{self, time};
use cellwire_io::output::{log, ready, stdout};
use cellwire_io::tcp;
use cellwire_io::tls::TlsArgs;
use cellwire_io::trace::TraceArgs;
use cellwire_links::settings;

/// Runs the jobs of a file on a Kawasaki robot: a picture or a table, each job once
///
/// A picture (.svg): its outlines are drawn, scaled to the setting `board`, whose origin is the upper left corner; Y points
/// down. A job is a line of it.
///
/// A table (.csv): the first line names fields of a job, in any order; each other line is a job. The plant's settings have
/// the fields as tables [[job]] (`cellwire settings run kawasaki` describes them); without them a job is a line of a
/// drawing: kind (1 draws, 2 moves), x1, y1, x2, y2 in hundredths of a millimetre. Every invalid line is reported before
/// anything is sent.
///
/// The robot connects, and reconnects when a connection is lost; over UDP (setting udp) it sends first. "Done" means
/// executed, as the robot reports it.
///
/// A journal beside the file has the outcome of each job: after any interruption the same command goes on. The robot has
/// meanwhile executed its queue, and no job is sent twice. If nobody knows whether jobs were executed (the robot was
/// restarted), it asks: check the work, and type `done`, `repeat` or `stop`, or the number of the last job that is done.
/// Without a keyboard it stops, and --unknown answers in the next run.
///
/// Ctrl-C, SIGTERM and a closed terminal stop after the current job, or after the queued ones if the plant has no message
/// that interrupts an order, and wait 30 s at most; a second signal ends the command at once: the robot executes what it has
/// queued, and the next run takes that over. The end of standard input is not a stop.
#[derive(Debug, clap::Args)]
#[command(after_help = AFTER, override_usage = USAGE)]
pub(super) struct Args {
    /// The picture (.svg) or the table of jobs (.csv)
    file: PathBuf,
    /// Listen on this address, where the robot connects; a port alone means 127.0.0.1
    #[arg(long, value_name = "ADDR", conflicts_with = "connect_to")]
    listen: Option<String>,
    /// Connect to this address, where a robot listens
    #[arg(long = "connect", value_name = "ADDR")]
    connect_to: Option<String>,
    /// End when there is no robot for this long, or `never`
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = time(Duration::ZERO..=Duration::MAX))]
    robot_timeout: Duration,
    /// Run it although a part has no effect, which is reported: elements that a pen cannot draw, such as text
    #[arg(long, value_name = "WHAT", value_parser = ["drawing"])]
    allow: Option<String>,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    work: WorkArgs,
}

const USAGE: &str = "\
cellwire run kawasaki [OPTIONS] <FILE> --listen <ADDR>
       cellwire run kawasaki [OPTIONS] <FILE> --connect <ADDR>
       cellwire run kawasaki [OPTIONS] <FILE> --dry-run";

const AFTER: &str = "\
Type while it runs:
  pause, continue, stop  After the current job, or after the queued ones
  done, repeat, stop     The answer when jobs may or may not be executed

Exit status: 0 all done   1 stopped or refused   2 not begun   3 connection lost
  7 the journal could not be written   130 ended at once

Examples:
  cellwire run kawasaki logo.svg --dry-run --picture plan.svg
  cellwire run kawasaki logo.svg --listen 192.168.0.2:9105
  cellwire run kawasaki pallet.csv --settings plant.toml --listen 192.168.0.2:9105
  cellwire simulate kawasaki-robot --connect 127.0.0.1:9105     a robot to try it on";

/// Returns true when every job is done.
pub(super) fn run(args: &Args) -> Result<bool> {
    args.work.events.choose();
    let file = &args.file;
    let is_somewhere = args.work.dry_run || args.listen.is_some() || args.connect_to.is_some();
    ensure!(
        is_somewhere,
        "give --listen ADDR if the robot connects, --connect ADDR if it listens, or --dry-run"
    );
    if let Some(address) = &args.connect_to {
        tcp::check(address)?;
    }
    let given = args.work.set.read(&self::settings())?;
    let settings = settings::read("kawasaki", Settings::default(), &given)?;
    let config = pc_config(&settings.plant, settings.config, &given)?;
    let jobs = Jobs::read(file, &settings, args.allow.is_some())?;
    let (fingerprint, parts) = (jobs.fingerprint(), jobs.work.len());
    let (what, lines, unit) = ("file of jobs", jobs.lines.clone(), jobs.unit);
    let work = RunInput { robot: "kawasaki", file, what, fingerprint, parts, lines, unit };
    let earlier: Option<Journal> = args.work.look(&work);
    if let Some(picture) = &args.work.picture {
        let outcomes = earlier.as_ref().map(Journal::outcomes).unwrap_or_default();
        jobs.draw(picture, settings.sheet(), &outcomes)?;
    }
    if args.work.dry_run {
        if input::extension(file) == "csv" {
            writeln!(stdout(), "{}", jobs.table())?;
        }
        log(&jobs.summary(config.limits.packet, settings.sheet()))?;
        args.work.tell(&work, earlier.as_ref())?;
        return Ok(true);
    }
    let run = |journal: &mut Journal, progress: &ProgressBar| {
        serve(args, &settings, config, &jobs, journal, progress)
    };
    let ran = args.work.run(work, run)?;
    let why = match ran.ended {
        RunEnd::Complete => "complete",
        RunEnd::Stopped => "stopped",
        RunEnd::Refused { .. } => "refused",
    };
    let mut line = ended(&ran.journal, why, &machine(&ran.journal.tally()));
    if let (RunEnd::Refused { active }, Some(fields)) = (&ran.ended, line.as_object_mut()) {
        fields.insert("active_order".into(), json!(active));
    }
    Ok(ran.say(&line)? == RunEnd::Complete)
}

fn serve(
    args: &Args,
    settings: &Settings,
    config: kawasaki_msg::PcConfig,
    jobs: &Jobs,
    journal: &mut Journal,
    progress: &ProgressBar,
) -> Result<RunEnd> {
    let typed = work::operator(Bell::default())?;
    let endpoint = match (&args.listen, &args.connect_to) {
        (Some(address), _) => Endpoint::Listen(address.clone()),
        (None, address) => Endpoint::Connect(address.clone().unwrap_or_default()),
    };
    let dialing = args.work.set.dialing(None, args.work.connect)?;
    let udp = config.datagrams.then_some(config.dialect);
    let (mut meeting, kind, place) = PeerEndpoint::open(Side::Pc, &endpoint, udp, dialing, &args.tls)?;
    ready("kawasaki", kind, &place)?;
    say_resumed(journal)?;
    let trace = args.trace.start("kawasaki-pc");
    let (notify, progress) = (&mut |event| log(&event), &mut args.work.shown(progress, journal, machine));
    let console = Console::new(typed, notify, progress);
    let absence = (args.robot_timeout < Duration::MAX).then_some(args.robot_timeout);
    let answer = args.work.unknown;
    let runner = Runner::new(jobs, config, journal, settings.order, answer, absence, console);
    runner.run(&mut meeting, &trace).map(|(ended, _)| ended)
}

/// Returns the jobs that the robot still draws.
fn machine(tally: &Tally) -> String {
    match tally.queued {
        0 => "the robot has no jobs of this file queued".into(),
        queued => format!("the robot may still execute up to {queued} queued jobs"),
    }
}

/// Returns the settings.
pub(super) fn settings() -> Vec<settings::Setting> {
    [settings::list(Settings::default()), connect_settings()].concat()
}
