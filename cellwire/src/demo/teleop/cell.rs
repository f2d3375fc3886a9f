//! The whole cell in one process: simulated ball, robot and workstation, and the host between them, on three serial lines.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow};
use indicatif::ProgressBar;
use isra_ball::{BallConfig, BallStatistics, Status};
use val2_alter::timing;
use val2_alter::{Accumulation, ControllerConfig, Exception, HostConfig, HostState, MotionPhase};

use super::cycles::{Cycle, Cycles};
use crate::alter::input::InputConfig;
use crate::alter::{
    LIMITS, Notification, Order, PortConfig, Profile, Teleop, TeleopConfig, Traces, host_config,
};
use crate::demo::DemoOptions;
use crate::devices::isra_ball::ball;
use crate::devices::val2_alter::puma::{self, PumaConfig, PumaRecord};
use crate::devices::val2_viewer::workstation;
use crate::io::line::Line;
use crate::io::samples::Samples;
use cellwire_io::clock::Clock;
use cellwire_io::trace::TraceArgs;
use cellwire_motion::latch::{Latch, LatchConfig};
use cellwire_sim::viewer::WorkstationCounts;
use cellwire_sim::{ByteFaults, Settings as _, TeachBall, Viewer};

/// The hand's whole round, and a little more.
const OWN_RUN: Duration = Duration::from_millis(7500);
/// With faults: how often each kind of fault is inserted, for each byte.
const FAULT_RATE: f64 = 0.0001;
/// With faults: the host has too much to do for `STALL`, once in this time.
const STALL_EVERY: Duration = Duration::from_millis(2900);
const STALL: Duration = Duration::from_millis(60);
/// An ALTER that has just ended is waited for this long at most, to see it taken up again before the run ends.
const TAKE_UP: Duration = Duration::from_secs(10);

/// The settings of the cell: by default the source's lines and its cumulative mode.
#[derive(Debug)]
pub struct CellConfig {
    /// The host's end of the robot's line.
    pub alter: HostConfig,
    /// The robot's end of the robot's line.
    pub controller: ControllerConfig,
    /// The polls of the ball, and its line.
    pub polls: isra_ball::HostConfig,
    /// The settings of the ball.
    pub ball: BallConfig,
    /// The workstation, and its line.
    pub viewer: Viewer,
    /// The host's end of the workstation's line.
    pub viewer_host: val2_viewer::HostConfig,
}

impl Default for CellConfig {
    fn default() -> Self {
        Self {
            alter: HostConfig { limits: LIMITS, subroutine: true, ..host_config() },
            controller: PumaConfig::default().puma.config,
            polls: isra_ball::HostConfig::default(),
            ball: BallConfig::default(),
            viewer: Viewer::default(),
            viewer_host: val2_viewer::HostConfig::default(),
        }
    }
}

/// The results of a run, as the simulated devices and the host saw it.
#[derive(Debug, Default)]
pub struct CellRecord {
    /// The run as the robot saw it.
    pub puma: PumaRecord,
    /// The run as the ball saw it.
    pub ball: BallStatistics,
    /// The run as the workstation saw it.
    pub drawn: WorkstationCounts,
    /// The run as the host saw it.
    pub host: HostRecord,
    /// The number of bytes corrupted by the lines of robot, ball and workstation; zero without faults.
    pub line_faults: [u64; 3],
    /// The time at which the host was ordered to come to rest.
    pub stopped_at: Duration,
    /// The number of the robot's ends of ALTER that came before that.
    pub ends_before_stop: usize,
}

/// The reports of the host.
#[derive(Debug, Default)]
pub struct HostRecord {
    /// The replies that the robot has not rejected.
    pub cycles: Cycles,
    /// Cycles in which the arm was at rest without a good reply, as far as the host knows.
    pub stood: u64,
    /// The times from the last byte read to the reply written, by the host's own clock.
    pub thinking: Samples,
    /// Whether the reply thread ran before all others.
    pub has_priority: bool,
    /// Times that ALTER was accepted.
    pub starts: u32,
    /// Deadlines that passed without a reply.
    pub missed: u64,
    /// Exceptions taken for the gripper's keys, and when: true closes.
    pub gripper_keys: Vec<(Duration, bool)>,
    /// Keys that did nothing, because ALTER did not run.
    pub gripper_keys_refused: u64,
    /// Packets of the ball with new values.
    pub fresh: u64,
    /// Packets of the ball with values that were sent before.
    pub old: u64,
    /// The times from a poll of the ball to the whole packet.
    pub exchange: Samples,
    /// Polls of the ball without a packet.
    pub ball_missed: u64,
    /// The number of the ball's packets that were not a reply.
    pub ball_late: u64,
    /// Corrupt packets of the ball.
    pub ball_corrupt: u64,
    /// Times that the ball's values became too old.
    pub ball_stale: u64,
    /// Poses sent to the workstation.
    pub poses: u64,
    /// Times that the host was made to sleep.
    pub stalls: u64,
    /// Whether ALTER runs, as far as the host knows.
    pub runs: bool,
    /// Whether the robot's subroutine runs.
    pub interrupted: bool,
}

/// Runs the cell.
///
/// # Errors
/// If there are no pseudo-terminals.
pub fn run(config: &CellConfig, options: &DemoOptions) -> Result<CellRecord> {
    let clock = Clock::start();
    let (polls, viewer_baud) = (config.polls, config.viewer.baud);
    let mut robot = Wire::new("robot", clock, config.controller.baud, 1, options)?;
    let mut ball = Wire::new("ball", clock, polls.baud, 2, options)?;
    let mut viewer = Wire::new("viewer", clock, viewer_baud, 3, options)?;
    let restart = Duration::from_millis(300);
    let mut puma = PumaConfig::default();
    (puma.puma.config, puma.puma.restart) = (config.controller, restart);
    let teleop = TeleopConfig {
        robot: robot.port(config.alter.baud),
        input: InputConfig::Ball(ball.port(polls.baud)),
        record: None,
        viewer: Some(viewer.port(viewer_baud)),
        viewer_host: config.viewer_host,
        alter: config.alter,
        polls,
        profile: Profile::for_limits(config.alter.limits, 150),
        latch: LatchConfig {
            confirm: config.alter.mode.accumulation() == Accumulation::NonCumulative,
            ..LatchConfig::default()
        },
    };
    let (stop, puma) = (AtomicBool::new(false), puma.simulator()?);
    let held = TeachBall { config: config.ball, ..TeachBall::default() }.simulator()?;
    let screen = Viewer { config: config.viewer.config, ..Viewer::default() };
    let screen = screen.simulator()?.keeping_nothing();
    thread::scope(|scope| {
        let goes_on = || !stop.load(Ordering::Relaxed);
        let robot = scope.spawn(move || {
            (puma::run(&mut robot.line, puma, true, goes_on, |_, _| Ok(())), robot.line.faults())
        });
        let ball =
            scope.spawn(move || (ball::run(&mut ball.line, held, goes_on, |_| Ok(())), ball.line.faults()));
        let viewer = scope.spawn(move || {
            (workstation::run(&mut viewer.line, screen, goes_on, |_| Ok(())), viewer.line.faults())
        });
        let host = drive(teleop, clock, options);
        stop.store(true, Ordering::Relaxed);
        let gone = |what| move |_| anyhow!("the simulated {what} panicked");
        let (puma, robot_faults) = robot.join().map_err(gone("robot"))?;
        let (ball, ball_faults) = ball.join().map_err(gone("ball"))?;
        let (drawn, viewer_faults) = viewer.join().map_err(gone("workstation"))?;
        let (host, stopped_at) = host?;
        let puma = puma.context("the simulated robot")?;
        let ends_before_stop = puma.ends.iter().filter(|(at, _)| *at < stopped_at).count();
        Ok(CellRecord {
            puma,
            ball: ball.context("the simulated ball")?,
            drawn: drawn.context("the simulated workstation")?,
            host,
            line_faults: [robot_faults, ball_faults, viewer_faults],
            stopped_at,
            ends_before_stop,
        })
    })
}

/// A simulated device's line, and where its other end is.
struct Wire {
    line: Line,
    path: String,
}

impl Wire {
    fn new(name: &str, clock: Clock, baud: u32, number: u64, options: &DemoOptions) -> Result<Self> {
        let (line, path) = Line::simulated(options.lines, clock, baud, options.trace.start(name))?;
        let faults = match options.faults {
            true => ByteFaults::with_rate(FAULT_RATE, options.seed.wrapping_mul(3).wrapping_add(number)),
            false => ByteFaults::none(),
        };
        Ok(Self { line: line.with_faults(faults), path })
    }

    fn port(&self, baud: u32) -> PortConfig {
        PortConfig { path: self.path.clone(), baud }
    }
}

/// Runs the host for its time, lets it come to rest, and records its reports.
fn drive(teleop: TeleopConfig, clock: Clock, options: &DemoOptions) -> Result<(HostRecord, Duration)> {
    let (time, progress) = (options.seconds.unwrap_or(OWN_RUN), &options.progress);
    let cycles = Cycles::new(teleop.alter.mode.accumulation());
    // The devices keep the traces.
    let off = TraceArgs::off();
    let traces = Traces { robot: off.start("robot"), ball: off.start("ball"), viewer: off.start("viewer") };
    let host = Teleop::start(teleop, clock, &traces)?;
    let mut record = HostRecord { cycles, ..HostRecord::default() };
    progress.set_length(u64::try_from(time.as_millis() / timing::CYCLE.as_millis())?);
    let end = clock.now() + time;
    let mut next_stall = clock.now() + STALL_EVERY;
    while clock.now() < end || (!record.runs && clock.now() < end + TAKE_UP) {
        if options.faults && (next_stall..end).contains(&clock.now()) {
            next_stall += STALL_EVERY;
            record.stalls += 1;
            host.order(Order::Stall(STALL));
        }
        if let Some((at, notification)) = host.wait(Duration::from_millis(20)) {
            record.take(at, &notification, progress);
            if let Notification::Latch(Latch::Ready { .. }) = notification {
                host.order(Order::Confirm);
            }
        }
    }
    let stopped_at = clock.now();
    host.order(Order::Stop);
    let patience = stopped_at + Duration::from_secs(2);
    while clock.now() < patience {
        let Some((at, notification)) = host.wait(Duration::from_millis(20)) else { continue };
        record.take(at, &notification, progress);
        if notification == Notification::State(HostState::Idle) {
            break;
        }
    }
    Ok((record, stopped_at))
}

impl HostRecord {
    fn take(&mut self, at: Duration, notification: &Notification, progress: &ProgressBar) {
        match notification {
            Notification::Priority(raised) => self.has_priority = *raised,
            Notification::Start(_) => {
                self.starts += 1;
                self.runs = false;
            }
            Notification::Motion(motion) => {
                self.runs = true;
                self.interrupted = motion.phase == MotionPhase::Interrupted;
            }
            Notification::Reply { demand, values, thinking, held: _ } => {
                let Self { starts: session, stood, interrupted, .. } = *self;
                self.cycles.add(Cycle { at, session, stood, interrupted, demand: *demand, values: *values });
                self.thinking.add(*thinking);
                progress.inc(1);
            }
            Notification::End(_) | Notification::Lost(_) => self.runs = false,
            Notification::Missed => {
                self.missed += 1;
                self.stood += 1;
            }
            Notification::Rejected(_) => {
                self.cycles.reject();
                self.stood += 1;
            }
            Notification::Gripper(exception, Ok(())) => {
                self.gripper_keys.push((at, *exception == Exception::CloseGripper))
            }
            Notification::Gripper(_, Err(_)) => self.gripper_keys_refused += 1,
            Notification::Ball(packet, took) | Notification::BallOld(packet, took) => {
                let count = if packet.status == Status::Fresh { &mut self.fresh } else { &mut self.old };
                *count += 1;
                self.exchange.add(*took);
            }
            Notification::BallMissed => self.ball_missed += 1,
            Notification::BallLate => self.ball_late += 1,
            Notification::BallCorrupt(_) => self.ball_corrupt += 1,
            Notification::BallStale => self.ball_stale += 1,
            Notification::Pose => self.poses += 1,
            _ => {}
        }
    }
}
