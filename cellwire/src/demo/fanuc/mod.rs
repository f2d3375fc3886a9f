//! `cellwire demo fanuc`: a trajectory becomes a spline program, the simulated robot runs it, its telemetry is
//! logged over Modbus TCP and compared with the trajectory.

mod robot;
mod settings;

pub use settings::Settings;

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use fanuc_hmi_modbus::TelemetryBlock;
use fanuc_ls::Rules;
use serde_json::json;

use self::robot::Run;
use crate::demo::{DemoOptions, MustFail};
use crate::devices::fanuc_hmi_modbus::client::Port;
use crate::devices::fanuc_hmi_modbus::simulate::connection;
use crate::devices::host::keep;
use crate::io::samples::Samples;
use crate::report::{Budget, Report};
use crate::telemetry::logger::{Logger, Reading, TelemetrySource};
use crate::telemetry::plot;
use crate::telemetry::recording::{self, Comparison, ComparisonError, Recording};
use crate::telemetry::task::BackgroundTask;
use cellwire_io::clock::Clock;
use cellwire_io::files;
use cellwire_io::output::counted;
use cellwire_io::tcp;
use cellwire_links::json::value as json;
use cellwire_motion::{
    Acceleration, Arm, JointSample, Kinematics, Quaternion, Resampling, Sampling, Trajectory,
};
use cellwire_sim::FaultyProxy;
use cellwire_sim::fanuc::{Controller, PERIOD, Pose};
use cellwire_sim::host::{Listener, Notice, Server};

const ARM: Arm = Arm::LR_MATE_200ID;
/// The time for which the robot rests before and after the motion, in s.
const REST: f64 = 0.3;
/// A longer run is this motion again and again, each compared by itself: no more than one is kept.
const LAP: f64 = 60.0;
/// The speeds of the source's tests ("Zhodnocení"), in mm/s and °/s.
const SPEED: (f64, f64) = (100.0, 20.0);

/// Runs the controller and its client over loopback TCP.
///
/// # Errors
/// If no port is free, a file cannot be written, or a setting is not one of this demo's.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let settings = cellwire_links::settings::read("fanuc", Settings::default(), &options.settings)?;
    let seconds = options.seconds.map_or(8.0, |seconds| seconds.as_secs_f64());
    let laps = (seconds / LAP).ceil().max(1.0);
    let trajectory = trajectory((seconds / laps - 2.0 * REST).max(0.5), laps > 1.0)?;
    let sampling = Sampling::Dynamic { min: 0.05, max: 0.5, by: Acceleration::Either };
    let (program, made) = Resampling::new(sampling).program(
        "DEMO_SPLINE",
        "cellwire demo",
        &trajectory,
        &ARM,
        &Rules::default(),
    )?;
    let text = program.to_text(&Rules::default())?;
    // The robot has the contents of a controller: the text.
    let start = trajectory.samples().first().context("the trajectory is empty")?.joints;
    let run = Run::new(&text, ARM, start)?;

    let clock = Clock::start();
    let begins = clock.now().as_secs_f64() + REST;
    let lap = run.seconds() + 2.0 * REST;
    let shape = Box::new(move |at: Duration| {
        let at = at.as_secs_f64() - begins;
        let number = ((at + REST) / lap).floor().clamp(0.0, laps - 1.0);
        shown(&run, at - lap * number)
    });
    let controller = Controller::new(shape, settings.word_order);
    let mut log = Log::begin(options, &settings, controller, clock)?;
    let (mut compared, mut rates) = (Vec::new(), [0.0; 2]);
    options.progress.set_length(millis(begins + lap * laps));
    for number in (0..).map(f64::from).take_while(|number| *number < laps) {
        log.recording.forget();
        log.run(options, &settings, clock, begins - REST + lap * (number + 1.0))?;
        let mut states = log.recording.states();
        states.iter_mut().for_each(|state| state.time -= lap * number);
        compared.push(Comparison::new(recording::reference(&trajectory, &ARM), states, REST + 1.0));
        keep_worst(&mut compared);
        let here = fastest_rates(&log.recording);
        rates.iter_mut().zip(here).for_each(|(most, here)| *most = f64::max(*most, here));
    }
    let Log { recording, turn_around, failed, .. } = log;
    let compared = compared.pop().context("there is a lap")?;
    let every = humantime::format_duration(settings.poll);
    let title = format!(
        "a resampled program runs, its telemetry is logged every {every} over Modbus TCP and compared with the plan"
    );
    let mut report = Report::new("fanuc", title).moves("an arm follows a path");
    report.fact("planned", "samples of the trajectory", trajectory.samples().len());
    report.fact("points", "points of the program", made.moves + 1);
    report.fact("worst_rounding", "largest rounding of a speed to whole mm/s", percent(made.worst_rounding));
    let times = format!("{:.3} s   {:.3} s", made.planned_time, made.written_time);
    report.fact("times", "duration of the trajectory, and with rounded speeds", times);
    let counts = recording.counts();
    report.fact("samples", "telemetry blocks read", counts.samples);
    report.fact("repeated", "task runs read twice", counts.repeated);
    report.fact("skipped", "task runs missed", counts.missed);
    report.fact("failed", "failed requests", failed);
    report.stream(counts.samples, counts.missed + failed, failed == 0);
    let [theirs, ours] = rates;
    report.fact("controller_rate", "highest quaternion rate, by the controller", format!("{theirs:.2} /s"));
    report.fact("rate", "highest quaternion rate, with continuous sign", format!("{ours:.2} /s"));
    report.require(failed == 0, || format!("{} failed", counted(failed, "request")));
    match &compared {
        Ok(comparison) => {
            let first = recording.first().map_or(0.0, f64::from) * PERIOD.as_secs_f64();
            comparison.report(&mut report, comparison.delay - (begins - first));
            for (_, what, figures, (measured, unit)) in comparison.figures() {
                report.require(figures.rms <= measured, || {
                    format!(
                        "the {what} is off by {:.3} {unit} rms, the source measured {measured} {unit}",
                        figures.rms
                    )
                });
            }
        }
        Err(error) => report.require(false, || error.to_string()),
    }
    let budget = Budget { time: PERIOD, source: "Background Task: the period of the logging task" };
    report.timing("turn_around", "request to block", &turn_around, (!options.faults).then_some(budget));
    if let (Some(folder), Ok(comparison)) = (&options.out, &compared) {
        write(folder, &trajectory, &text, &recording, comparison)?;
        report.fact("out", "plots, program, trajectory and recording", folder.display().to_string());
    }
    Ok(report)
}

/// Keeps one of the laps: one that could not be compared, or the one that is off most.
fn keep_worst(laps: &mut Vec<Result<Comparison, ComparisonError>>) {
    let off = |lap: &Result<Comparison, ComparisonError>| {
        lap.as_ref().map_or(f64::INFINITY, |lap| {
            let parts = lap.figures().map(|(_, _, figures, (measured, _))| figures.rms / measured);
            parts.into_iter().fold(0.0, f64::max)
        })
    };
    laps.sort_by(|a, b| off(b).total_cmp(&off(a)));
    laps.truncate(1);
}

/// The client, and its recording.
struct Log {
    logger: Logger,
    recording: Recording,
    turn_around: Samples,
    failed: u64,
    _proxy: Option<FaultyProxy>,
}

impl Log {
    /// Serves the controller and connects to it.
    fn begin(
        options: &DemoOptions,
        settings: &Settings,
        controller: Controller,
        clock: Clock,
    ) -> Result<Self> {
        let listener = tcp::listen("127.0.0.1:0")?;
        let address = listener.local_addr()?;
        let listener = Listener::new(listener)?;
        let trace = options.trace.start("fanuc");
        let device = connection(&Arc::new(Mutex::new(controller)), settings.server)?;
        // The thread ends with the process, as the listener does.
        thread::spawn(move || {
            let server = Server::new(listener, || clock.now());
            let served: Result<()> = server.run(
                device,
                || true,
                |_, notice| {
                    keep(&trace, &notice);
                    if let Notice::Disconnected(_, ending) = &notice {
                        trace.finish(&ending.to_string());
                    }
                    Ok(())
                },
            );
            served
        });
        let proxy = options.faults.then(|| FaultyProxy::start(address, options.seed, 0.0)).transpose()?;
        let address = proxy.as_ref().map_or(address, FaultyProxy::address);
        let source = TelemetrySource {
            port: Port {
                config: settings.client,
                ..Port::tcp(&address.to_string(), tcp::Dialing::default())
            },
            unit: settings.server.unit.unwrap_or(1),
            address: TelemetryBlock::ADDRESS,
            poll: settings.poll,
        };
        Ok(Self {
            logger: Logger::open(source, clock)?,
            recording: Recording::new(PERIOD, settings.poll),
            turn_around: Samples::default(),
            failed: 0,
            _proxy: proxy,
        })
    }

    /// Records until this time.
    fn run(&mut self, options: &DemoOptions, settings: &Settings, clock: Clock, ends: f64) -> Result<()> {
        let Self { logger, recording, turn_around, failed, .. } = self;
        logger.run(Some(Duration::from_secs_f64(ends)), |reading| {
            options.progress.set_position(millis(clock.now().as_secs_f64()));
            match reading {
                // One answer is removed.
                Reading::Registers(..) if options.spoils(MustFail::Lost) && *failed == 0 => *failed = 1,
                Reading::Registers(registers, took) => {
                    turn_around.add(took);
                    let mut block = TelemetryBlock::from_registers(registers, settings.word_order);
                    if options.spoils(MustFail::Limit) {
                        block.position = block.position.map(|mm| mm + 10.0);
                    }
                    recording.push(&block);
                    let [x, y, z] = block.position;
                    options.progress.set_message(format!("X {x:.1}  Y {y:.1}  Z {z:.1} mm"));
                }
                Reading::Failed(_) | Reading::Absent(_) | Reading::Disconnected(_) => *failed += 1,
                Reading::Retried(_) | Reading::Reconnected(_) => {}
            }
            Ok(true)
        })
    }
}

/// Returns a closed curve of the arm in front of the robot, the tool pointing down and swaying through W = 180°: from rest,
/// along the curve at 100 mm/s or 20 °/s at most, and to rest; at its beginning if it is `closed`.
fn trajectory(seconds: f64, closed: bool) -> Result<Trajectory> {
    let ramp = 1.3f64.min(seconds / 2.0);
    // How fast the curve may be run through, so that neither speed is passed anywhere.
    let step = 1e-3;
    let fastest = (0..6284).map(f64::from).fold(0.0, |fastest: f64, k| {
        let (a, b) = (ARM.forward(&joints(k * step)), ARM.forward(&joints((k + 1.0) * step)));
        let [x, y, z] = a.rotation_to(&b);
        fastest.max(a.distance(&b) / SPEED.0 / step).max((x * x + y * y + z * z).sqrt() / SPEED.1 / step)
    });
    let rounds = ((seconds - ramp) / fastest / core::f64::consts::TAU).floor();
    let slowness =
        if closed { (seconds - ramp) / (rounds.max(1.0) * core::f64::consts::TAU) } else { fastest };
    let phase = |t: f64| {
        // The integral of a rate that rises and falls as half a cosine.
        let rise =
            |t: f64| (t - ramp / core::f64::consts::PI * (core::f64::consts::PI * t / ramp).sin()) / 2.0;
        let whole = seconds - ramp;
        match t {
            t if t < ramp => rise(t),
            t if t < seconds - ramp => t - ramp / 2.0,
            t => whole - rise((seconds - t).max(0.0)),
        }
    };
    let count = (seconds / PERIOD.as_secs_f64()).round().max(2.0);
    let sample = |k: f64| {
        let time = k / count * seconds;
        JointSample { time, joints: joints(phase(time) / slowness) }
    };
    let samples = core::iter::successors(Some(0.0), |k| (*k < count).then_some(k + 1.0)).map(sample);
    Trajectory::new(samples.collect()).context("the demo's own trajectory")
}

/// Returns J1 to J6 in degrees at a point of the curve, which closes at 2π.
fn joints(at: f64) -> [f64; 6] {
    [
        22.0 * at.sin(),
        5.0 + 9.0 * (2.0 * at).sin(),
        -12.0 + 6.0 * (at.cos() - 1.0),
        10.0 * (2.0 * at).sin(),
        -78.0 + 8.0 * (3.0 * at).sin(),
        25.0 * at.sin(),
    ]
}

/// Returns a pose as a controller shows it.
fn shown(run: &Run, seconds: f64) -> Pose {
    let cellwire_motion::Pose { position, orientation } = run.at(seconds);
    Pose { position, wpr: Quaternion::normalised(orientation).to_wpr() }
}

/// Returns the fastest part of the quaternion's rate: as the controller computes it, and with a continuous sign.
fn fastest_rates(recording: &Recording) -> [f64; 2] {
    let fastest = |rate: [f64; 4]| rate.into_iter().map(f64::abs).fold(0.0, f64::max);
    let samples = recording.samples();
    let theirs = samples.iter().map(|(block, _)| fastest(block.quaternion_rate.map(f64::from)));
    let ours = samples.iter().map(|(_, sample)| fastest(sample.quaternion_rate));
    [theirs.fold(0.0, f64::max), ours.fold(0.0, f64::max)]
}

fn write(
    folder: &Path,
    trajectory: &Trajectory,
    program: &str,
    recording: &Recording,
    comparison: &Comparison,
) -> Result<()> {
    plot::draw(folder, comparison)?;
    let save = |name: &str, bytes: &[u8]| files::write(&folder.join(name), bytes);
    save("DEMO_SPLINE.LS", program.as_bytes())?;
    save(
        "BG_TELEMETRY.LS",
        BackgroundTask::default().program(&Rules::default())?.to_text(&Rules::default())?.as_bytes(),
    )?;
    let mut table = String::from("time,J1,J2,J3,J4,J5,J6\n");
    for JointSample { time, joints: [j1, j2, j3, j4, j5, j6] } in trajectory.samples() {
        table += &format!("{time:.4},{j1:.5},{j2:.5},{j3:.5},{j4:.5},{j5:.5},{j6:.5}\n");
    }
    save("trajectory.csv", table.as_bytes())?;
    let mut table = format!("{}\n", recording::HEADER).into_bytes();
    for (block, sample) in recording.samples() {
        recording::write_row(&mut table, block, sample)?;
    }
    save("recording.csv", &table)?;
    let summary = json!({"delay_s": comparison.delay, "errors": json(comparison.summary)});
    save("errors.json", format!("{summary:#}\n").as_bytes())
}

fn percent(share: f64) -> String {
    format!("{:+.1} %", share * 100.0)
}

fn millis(seconds: f64) -> u64 {
    u64::try_from(Duration::from_secs_f64(seconds).as_millis()).unwrap_or(u64::MAX)
}
