//! `cellwire demo laser`.

pub mod path;
pub mod run;
pub mod tally;

use std::thread;
use std::time::Duration;

use anyhow::Result;
use laser_eb90::{HostConfig, timing};

use self::path::SHEET;
use self::run::Cutter;
use self::tally::{PathIndex, Tally};
use crate::demo::DemoOptions;
use crate::devices::laser_eb90::controller::{self, RobotCounts, Switch};
use crate::io::line::Line;
use crate::io::sheet;
use crate::report::{Budget, Report, tenths};
use crate::run::laser::{Mapping, Program};
use cellwire_io::clock::Clock;
use cellwire_io::port::AnyPort;
use cellwire_io::tcp::Dialing;
use cellwire_links::settings::{self, Configure, FieldVisitor};
use cellwire_sim::laser::{Job, LaserRobot};
use cellwire_sim::ledger::ReportedOutcome;
use cellwire_sim::{ByteFaults, Laser, Simulator};

/// The simulated baud rate, unless `--set baud=…` gives another. The source names none; at this one a short run shows some
/// hundred instructions.
const BAUD: u32 = 115_200;

/// With `--faults` one byte in a thousand is corrupt: turned over, lost, or preceded by noise.
const FAULT_RATE: f64 = 0.001 / 3.0;

/// The time for which the robot is off when it restarts.
const RESTART: Duration = Duration::from_millis(300);

/// Single instructions are sent for a third of the run, but no longer than this: the rest of the path waits.
const SINGLE: Duration = Duration::from_secs(10);

/// Where nothing can be lost, an answer may take as long as a machine without time for us needs.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);

/// The bytes of a frame of one instruction, of seven, and of an answer.
const FRAME_LENGTHS: [usize; 3] = [37, 217, 11];

/// The settings of the demo.
#[derive(Debug)]
pub struct Settings {
    host: HostConfig,
    robot: Laser,
}

impl Settings {
    fn new(baud: u32, faults: bool) -> Self {
        let defaults = HostConfig::at_baud(baud);
        // The simulated robot executes immediate instructions at once, and drops the beginning of a frame when it answers an
        // error code. Nobody has sent anything before.
        let (answer_timeout, execution_timeout) = if faults {
            (defaults.answer_timeout, defaults.answer_timeout * 2)
        } else {
            (ANSWER_TIMEOUT, ANSWER_TIMEOUT)
        };
        let host = HostConfig {
            answer_timeout,
            execution_timeout,
            longest_frame: 0,
            controller_drops_partial: true,
            ..defaults
        };
        Self { host, robot: Laser { execution: Duration::from_millis(1), ..Laser::default() } }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::new(BAUD, false)
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { host, robot } = self;
        host.configure(fields);
        // Both ends of a line agree, unless they are set apart.
        let config = &mut robot.config;
        (config.profile, config.words, config.batch) = (host.profile, host.words, host.batch);
        fields.group("robot", |fields| fields.without(&["baud"], |fields| robot.configure(fields)));
    }
}

/// Runs a host that sends a cutting path to the simulated robot over a serial line with the delays of real bytes: for the
/// first third of the run one instruction in a frame, then seven. With faults the robot is killed in the middle of that and
/// started again.
///
/// # Errors
/// If there is no pseudo-terminal, or the picture cannot be written.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let seconds = options.seconds.unwrap_or(Duration::from_secs(6));
    let first = settings::read("laser", Settings::default(), &options.settings)?;
    // Some defaults follow from the rate.
    let settings = Settings::new(first.host.baud, options.faults);
    let settings = settings::read("laser", settings, &options.settings)?;
    let (Settings { host: config, robot: settings }, baud) = (settings, first.host.baud);
    let mapping = Mapping::default();
    let path = path::path(&mapping)?;
    let clock = Clock::start();
    let (mut line, port) = Line::simulated(options.lines, clock, baud, options.trace.start("laser"))?;
    if options.faults {
        line = line.with_faults(ByteFaults::with_rate(FAULT_RATE, options.seed));
    }
    let mut executed = Vec::new();
    let (first, second) = (Switch::default(), Switch::default());
    options.progress.set_length(path.instructions.len() as u64);

    let (robot, cut) = thread::scope(|scope| {
        let robot = scope.spawn(|| restarting(settings, &mut line, clock, [&first, &second], &mut executed));
        let cut = cut(&port, config, &path, seconds, options, &first);
        first.turn_off();
        second.turn_off();
        (robot.join(), cut)
    });
    let robot = robot.map_err(|_| anyhow::anyhow!("the simulated robot panicked"))??;
    let (cutter, rates) = cut?;
    let read =
        |jobs: &[Job]| jobs.iter().map(|job| path::executed(job, &settings.config)).collect::<Vec<_>>();
    let (mut executed, places) = (read(&executed), PathIndex::new(&path.instructions));
    let (mut known, mut forgotten) = (cutter.known.clone(), 0);
    // No message reports a restart: the instructions that the robot forgot with its queue are unknown.
    for place in read(&robot.forgotten).iter().filter_map(|instruction| places.of(instruction)) {
        if let Some(outcome) = known.get_mut(place) {
            forgotten += u64::from(outcome.replace(ReportedOutcome::Unknown) == Some(ReportedOutcome::Done));
        }
    }
    options.spoil(&mut executed, |instruction| {
        let place = places.of(instruction);
        place.and_then(|place| known.get(place)) == Some(&Some(ReportedOutcome::Done))
    });
    if let Some(file) = &options.out {
        let lines = path::lines(&executed, &mapping);
        sheet::write(file, SHEET, &lines, &[], ["laser on", "laser off"])?;
    }
    let tally = tally::count(&places, &known, &executed);
    let mut report = report(baud, &path, &line, &cutter, &robot, tally, rates);
    report.fact("forgotten", "confirmed instructions that the killed robot lost", forgotten);
    report.require(options.faults || tally.jobs.unknown == 0, || {
        "outcomes are unknown although the line had no faults".into()
    });
    Ok(report)
}

/// Runs the host; returns the instructions per second one by one, and with seven in a frame.
fn cut<'a>(
    port: &str,
    config: HostConfig,
    path: &'a Program,
    seconds: Duration,
    options: &DemoOptions,
    robot: &Switch,
) -> Result<(Cutter<'a>, [f64; 2])> {
    let mut cutter = Cutter::new(AnyPort::open(port, config.baud, Dialing::default())?, path, config);
    let progress = |position| options.progress.set_position(position);
    let single = (seconds / 3).min(SINGLE);
    let one = cutter.cut(single, 1, progress, || ())?;
    let seven = thread::scope(|scope| {
        let kill = || {
            thread::sleep(seconds / 3);
            robot.kill();
        };
        let begun = || drop(options.faults.then(|| scope.spawn(kill)));
        cutter.cut(seconds - single, 7, progress, begun)
    })?;
    Ok((cutter, [one, seven]))
}

/// Runs a robot that is restarted after it was killed. Without faults it is not killed.
fn restarting(
    robot: Laser,
    line: &mut Line,
    clock: Clock,
    switches: [&Switch; 2],
    executed: &mut Vec<Job>,
) -> Result<RobotCounts> {
    let mut counts = RobotCounts::default();
    for (boot, switch) in (1..).zip(switches) {
        let simulator = Simulator::new(LaserRobot::new(robot, boot)?);
        counts.add(&controller::run(&robot, simulator, line, switch, |_| Ok(()), |job| executed.push(job))?);
        if !switch.was_killed() {
            break;
        }
        counts.restarts += 1;
        let on_again = clock.now() + RESTART;
        while clock.now() < on_again && line.wait(on_again) {
            while line.receive().is_some() {} // it receives nothing while it is off
        }
    }
    Ok(counts)
}

fn report(
    baud: u32,
    path: &Program,
    line: &Line,
    cutter: &Cutter<'_>,
    robot: &RobotCounts,
    Tally { jobs, altered, unseen }: Tally,
    [one, seven]: [f64; 2],
) -> Report {
    let [single, batch, answer] = FRAME_LENGTHS;
    let period = |frame| timing::period(frame, answer, baud, timing::TICK).as_secs_f64();
    let calculated = period(single) / (period(batch) / 7.0);
    let mut report = Report::new(
        "laser",
        format!(
            "a host cuts a path of {} instructions at {baud} baud, with a cycle of 16 ms",
            path.instructions.len()
        ),
    )
    .moves("a laser cuts a sheet");
    report.jobs(jobs, altered);
    report.fact("unseen", "executed corrupt, undetected by the checksum", unseen);
    report.fact("refused", "frames refused after all resends, sent later", cutter.refused);
    report.fact("error_codes", "error codes sent by the robot", robot.refused);
    report.fact("restarts", "restarts of the robot", robot.restarts);
    report.fact("line_faults", "bytes corrupted by the line", line.faults());
    report.fact("single_rate", "instructions per second, one per frame", tenths(one));
    report.fact("batch_rate", "instructions per second, seven per frame", tenths(seven));
    report.fact("gain", "gain of seven per frame", format!("{} %", percent(seven / one)));
    report.fact(
        "gain_calculated",
        "calculated gain at this rate, without faults",
        format!("{} %", percent(calculated)),
    );
    report.fact("gain_source", "gain in the source, at an unnamed rate", "about 37 %");
    report.timing("exchange", "frame to answer", cutter.exchange(), None);
    let cycle = Budget { time: timing::TICK, source: "§4.1: all tasks within one cycle" };
    report.timing("work", "the robot's work in a cycle", &robot.work, Some(cycle));
    report.timing(
        "answer",
        "end of the cycle to the answer, including the host's delay",
        &robot.answer,
        None,
    );
    report.require(jobs.executed_once > 0, || "nothing was cut".into());
    report
}

fn percent(ratio: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "a float saturates when cast to an integer")]
    let percent = ((ratio - 1.0) * 100.0).round() as i64;
    percent
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::io::line::Lines;
    use serde_json::json;

    /// Noise, and a robot that is killed and started again in the middle of it.
    #[test]
    fn over_a_bad_line_nothing_is_lost_unreported_or_repeated() {
        bad_line(Lines::PseudoTerminals);
    }

    /// The line where pseudo-terminals do not exist.
    #[test]
    fn nor_over_tcp() {
        bad_line(Lines::Tcp);
    }

    fn bad_line(lines: Lines) {
        // Slow enough that the robot holds instructions when it is killed.
        let options = DemoOptions {
            seconds: Some(Duration::from_secs(3)),
            faults: true,
            seed: 5,
            settings: [("robot".into(), json!({"execution": "20ms"}))].into_iter().collect(),
            lines,
            ..DemoOptions::quiet()
        };
        let report = demo(&options).unwrap();
        let object = report.to_json();
        assert_eq!((&object["lost"], &object["repeated"]), (&0.into(), &0.into()), "{object}");
        assert_eq!(object["restarts"], 1, "{object}");
        assert!(object["executed_once"].as_u64() > Some(20), "{object}");
        let [unknown, forgotten] = ["unknown", "forgotten"].map(|key| object[key].as_u64());
        assert!(unknown >= forgotten && forgotten > Some(0), "the restart leaves outcomes unknown: {object}");
    }
}
