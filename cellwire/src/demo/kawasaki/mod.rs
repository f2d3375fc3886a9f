//! `cellwire demo kawasaki`: the source's own application, a PC that lets a robot draw a picture.

pub mod tally;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use anyhow::{Result, anyhow, bail, ensure};
use kawasaki_msg::{Bounds, PcConfig, Point, RobotConfig, timing};
use robot_session::now;
use serde_json::Value;

use self::tally::Orders;
use crate::demo::DemoOptions;
use crate::demo::operator::Operator;
use crate::devices::device::Endpoint;
use crate::devices::kawasaki_msg::endpoint::Packets;
use crate::devices::kawasaki_msg::peer_endpoint::{PeerEndpoint, Side};
use crate::devices::kawasaki_msg::robot::{self, Setup};
use crate::devices::kawasaki_msg::sheet::{Lines, SHEET};
use crate::io::drawing::{self, Picture};
use crate::io::journal::Tally;
use crate::report::{Budget, Report, tenths, were};
use crate::run::Console;
use crate::run::kawasaki::{Jobs, Journal, RunEnd, Runner};
use cellwire_io::tcp;
use cellwire_io::tls::TlsArgs;
use cellwire_io::trace::Trace;
use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::kawasaki_msg::{pc_settings, robot_settings};
use cellwire_links::settings::{self, Configure, FieldVisitor};
use cellwire_sim::FaultyProxy;

/// The pen's speed in mm/s unless `--set speed=…` gives another: much faster than an arm, so that the picture takes a few
/// seconds.
const SPEED: u32 = 16_000;

/// The jobs that the robot's queue holds, unless `--set queue=…` gives another number.
const QUEUE: usize = 256;

/// With `--faults`, so likely does a read break the connection.
const BREAKS: f64 = 0.02;

/// The time that a robot without a connection waits here: a short run is to see many connections.
const RECONNECT: Duration = Duration::from_millis(100);

/// The number of the first order: that of the source's example (thesis, section 10.1).
const ORDER: u16 = 50;

/// The longest wait for the robot's connection.
const ABSENCE: Duration = Duration::from_secs(10);

/// The settings of the demo.
#[derive(Debug)]
pub struct Settings {
    plant: Plant,
    port: u16,
    queue: usize,
    speed: u32,
    robot: RobotConfig,
    pc: PcConfig,
}

impl Default for Settings {
    fn default() -> Self {
        let robot = RobotConfig { reconnect_delay: RECONNECT, ..RobotConfig::tcp() };
        let (mut plant, pc) = (Plant::default(), PcConfig::tcp());
        plant.bounds = Bounds { min: Point::new(0, 0), max: Point::new(SHEET.x, SHEET.y) };
        Self { port: 0, queue: QUEUE, speed: SPEED, plant, robot, pc }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { port, queue, speed, plant, robot, pc } = self;
        fields.whole("port", 0..=u16::MAX, "", "the PC's port; 0: any free port", port);
        fields.whole("queue", 1..=9998, "jobs", "how many jobs the robot's queue holds", queue);
        fields.whole("speed", 1..=u32::MAX, "mm/s", "the speed of the pen", speed);
        plant.configure(fields);
        fields.group("robot", |fields| robot_settings(fields, robot));
        fields.group("pc", |fields| pc_settings(fields, pc));
    }
}

/// Draws the picture once; with a time, again and again until it is over.
///
/// # Errors
/// If the picture cannot be read, or the drawn one cannot be written; when no port is free.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let Settings { port, queue, speed, plant, robot, pc } =
        settings::read("kawasaki", Settings::default(), &options.settings)?;
    let picture = match &options.drawing {
        Some(file) => Picture::from_file(file, SHEET, false)?,
        None => Picture::built_in(SHEET)?,
    };
    let jobs = Jobs::of(&picture, &plant)?;
    let (config, pc) = (plant.robot(robot)?, plant.pc(pc)?);
    // All jobs are lines.
    let (layout, speed, job_time) = (jobs.layout().clone(), f64::from(speed), Duration::ZERO);
    let setup = Setup { config, layout, queue, speed, job_time };
    let (udp, dialing, tls) = (plant.udp, tcp::Dialing::default(), TlsArgs::default());
    ensure!(!(udp && options.faults), "--faults breaks TCP connections, and cannot be used with udp");
    let place = Endpoint::Listen(format!("127.0.0.1:{port}"));
    let dialect = udp.then_some(pc.dialect);
    let (mut meeting, _, server) = PeerEndpoint::open(Side::Pc, &place, dialect, dialing, &tls)?;
    let proxy = match options.faults {
        true => Some(FaultyProxy::start(server.parse()?, options.seed, BREAKS)?),
        false => None,
    };
    let address = proxy.as_ref().map_or(server, |proxy| proxy.address().to_string());
    let place = Endpoint::Connect(address);
    let (mut robot_meeting, ..) = PeerEndpoint::open(Side::Robot, &place, dialect, dialing, &tls)?;

    let switch = AtomicBool::new(false);
    let (sender, strokes) = mpsc::channel();
    let (mut ledger, start) = (Orders::new(&jobs.work, options, strokes), now());
    let (robot, packets) = thread::scope(|scope| {
        let robot = scope.spawn(|| {
            let trace = options.trace.start("kawasaki-robot");
            let drawn = |stroke| sender.send(stroke).unwrap_or_default();
            robot::simulator(&setup)
                .and_then(|robot| robot::run(robot, &mut robot_meeting, &trace, &switch, drawn, |_| Ok(())))
        });
        let trace = options.trace.start("kawasaki-pc");
        let packets = draw(&jobs, pc, &mut meeting, &trace, options, &mut ledger);
        switch.store(true, Ordering::Relaxed);
        (robot.join(), packets)
    });
    let robot = robot.map_err(|_| anyhow!("the simulated robot panicked"))??;
    ledger.end();
    let (limit, time) = (pc.limits.packet, now().saturating_sub(start));
    let seen = RunResults { packets: packets?, limit, ledger, robot, time };
    if let Some(file) = &options.out {
        let board = Lines::of(jobs.layout())?;
        let drawn = seen.ledger.longest().iter().map(|stroke| board.line(&stroke.job.work));
        drawing::write_svg(file, SHEET, &drawn.collect::<Vec<_>>())?;
    }
    Ok(report(&picture, &seen, proxy.as_ref()))
}

/// Runs one order after another, each the whole picture, and counts the packets.
fn draw(
    jobs: &Jobs,
    pc: PcConfig,
    meeting: &mut PeerEndpoint,
    trace: &Trace,
    options: &DemoOptions,
    ledger: &mut Orders<'_>,
) -> Result<Packets> {
    options.progress.set_length(jobs.work.len() as u64);
    let (end, mut packets) = (options.seconds.map(|seconds| now() + seconds), Packets::default());
    loop {
        let mut journal = Journal::unwritten(jobs.work.len());
        let ((mut operator, typed), mut sent) = (Operator::new(), 0);
        end.into_iter().for_each(|end| operator.stop_at(end));
        let notify = &mut |event: Value| match event.get("event").and_then(Value::as_str) {
            Some("unknown") => operator.say("stop"),
            _ => Ok(()),
        };
        let progress = &mut |Tally { done, unknown, queued, .. }| {
            sent = sent.max(done + unknown);
            options.progress.set_position(done as u64);
            options.progress.set_message(format!("drawn, {queued} in the queue"));
        };
        let number = u16::try_from(ledger.orders()).unwrap_or(u16::MAX).saturating_add(ORDER);
        let console = Console::new(typed, notify, progress);
        let runner = Runner::new(jobs, pc, &mut journal, Some(number), None, Some(ABSENCE), console);
        let (ended, here) = runner.run(meeting, trace)?;
        packets = packets.merge(here);
        ledger.over(journal.outcomes().get(..sent).unwrap_or_default());
        match ended {
            RunEnd::Complete if end.is_some_and(|end| now() < end) => {}
            RunEnd::Complete | RunEnd::Stopped => return Ok(packets),
            RunEnd::Refused { active } => {
                bail!("the robot refuses order {number}: order {active} is active")
            }
        }
    }
}

/// The results of the run.
struct RunResults<'a> {
    packets: Packets,
    /// The most bytes of a packet.
    limit: usize,
    ledger: Orders<'a>,
    robot: robot::Run,
    time: Duration,
}

fn report(picture: &Picture, seen: &RunResults<'_>, proxy: Option<&FaultyProxy>) -> Report {
    let RunResults { packets, limit, ledger, robot, time } = seen;
    let tally = ledger.tally();
    let statistics = robot.statistics;
    let title = format!(
        "a robot draws a picture of {} strokes and {} moves for a PC",
        picture.strokes(),
        picture.lines.len() - picture.strokes()
    );
    let mut report = Report::new("kawasaki", title).moves("a pen draws a picture");
    report.fact("orders", "orders: pictures begun", ledger.orders());
    report.fact("pictures", "complete pictures", ledger.complete());
    report.jobs(tally.jobs, 0);
    if tally.jobs.withdrawn > 0 {
        report.fact("withdrawn", "withdrawn at timeout", tally.jobs.withdrawn);
    }
    report.fact("asked_again", "jobs dropped at a full queue and resent", statistics.discarded);
    report.fact("packets", "packets of the PC", packets.count);
    report.fact(
        "messages_mean",
        "messages per packet, mean",
        tenths(count(packets.messages) / count(packets.count.max(1))),
    );
    report.fact("messages_most", "messages per packet, maximum", packets.most_messages);
    let label = format!("bytes of the longest packet, maximum {limit} (§9.5)");
    report.fact("longest_packet", &label, packets.longest);
    let a_second = tenths(count(robot.exchange.count()) / time.as_secs_f64());
    report.fact("exchanges_a_second", "exchanges per second, in the source 31 (§9.4)", a_second);
    if let Some(faults) = proxy.map(FaultyProxy::faults) {
        report.fact("splits", "split reads", faults.splits.load(Ordering::Relaxed));
        report.fact("delays", "reads delayed", faults.delays.load(Ordering::Relaxed));
        report.fact("disconnects", "connections broken", faults.disconnects.load(Ordering::Relaxed));
    }
    report.fact("connections", "connections opened", robot.connections);
    report.timing("exchange", "packet to answer", &robot.exchange, None);
    report.timing(
        "unpack",
        "unpack and queue a packet",
        &robot.unpack,
        Some(Budget { time: timing::UNPACK_MEAN, source: "app. 2, its mean" }),
    );
    report.timing(
        "work_cycle",
        "job to job without motion",
        &robot.work_cycle,
        Some(Budget { time: Duration::from_millis(110), source: "§12.1" }),
    );
    report.require(tally.jobs.executed_once > 0, || "nothing was drawn".into());
    report.require(tally.altered == 0, || {
        format!("{} executed with other values than were sent", were(tally.altered, "job"))
    });
    report.require(tally.out_of_order == 0, || {
        format!("{} executed out of order", were(tally.out_of_order, "job"))
    });
    report
}

#[expect(clippy::cast_precision_loss, reason = "counts of a run")]
fn count(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::path::PathBuf;

    fn options(settings: &[(&str, i64)]) -> DemoOptions {
        DemoOptions {
            settings: settings.iter().map(|(name, value)| ((*name).into(), Value::from(*value))).collect(),
            ..DemoOptions::quiet()
        }
    }

    /// Writes a square with a diagonal: a move of 96 mm to its corner, then five strokes.
    fn square(name: &str) -> PathBuf {
        let file = std::env::temp_dir().join(format!("cellwire-{name}-{}.svg", std::process::id()));
        let path = r#"<path fill="none" stroke="black" d="M 10 10 H 90 V 90 H 10 Z L 90 90"/>"#;
        let svg = format!(r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{path}</svg>"#);
        std::fs::write(&file, svg).unwrap();
        file
    }

    #[test]
    fn what_the_robot_draws_is_the_picture() {
        let given = square("whole");
        let drawn = given.with_extension("drawn.svg");
        let mut options = options(&[("speed", 200_000)]);
        (options.drawing, options.out) = (Some(given.clone()), Some(drawn.clone()));
        let report = demo(&options).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        assert_eq!((is_good, &object["executed_once"]), (true, &6.into()), "{object}");
        let [given, drawn] = [given, drawn].map(|file| {
            let picture = Picture::from_file(&file, SHEET, false).unwrap();
            std::fs::remove_file(file).unwrap();
            picture
        });
        assert_eq!((given.lines, given.sheet), (drawn.lines, drawn.sheet));
    }

    #[test]
    fn over_a_connection_that_breaks_every_line_is_drawn_once() {
        let mut options = options(&[("speed", 1_000_000)]);
        options.faults = true;
        let report = demo(&options).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        let lines = Picture::built_in(SHEET).unwrap().lines.len();
        assert_eq!((is_good, &object["executed_once"]), (true, &lines.into()), "{object}");
        assert!(object["disconnects"].as_u64() > Some(0), "{object}");
    }

    #[test]
    fn a_picture_that_is_cut_short_is_reported() {
        // The pen needs more than two seconds to the first corner: that job is finished, the others are withdrawn.
        let (file, mut options) = (square("short"), options(&[("speed", 40), ("queue", 4)]));
        (options.drawing, options.seconds) = (Some(file.clone()), Some(Duration::from_secs(1)));
        let report = demo(&options).unwrap();
        let object = report.to_json();
        std::fs::remove_file(file).unwrap();
        let [pictures, once, lost] = ["pictures", "executed_once", "lost"].map(|key| &object[key]);
        assert_eq!((pictures, once, lost), (&0.into(), &1.into(), &0.into()), "{object}");
        assert!(object["withdrawn"].as_u64() >= Some(3), "{object}");
    }
}
