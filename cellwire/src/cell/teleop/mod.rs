//! The host computer of the teleoperation cell: a control ball steers a robot over ALTER, and a workstation draws it.
//!
//! ```text
//!             ┌────────────────── host ──────────────────┐
//!  ball ◀────▶│ ball thread ──orders──▶ robot thread     │◀────▶ robot
//!             │                           │ poses        │
//!             │                           ▼              │        each thread blocks on its own port;
//!             │                         viewer thread    │◀────▶ viewer
//!             └────────────────────┬─────────────────────┘
//!                                  └──────▶ screen, demo, records: one way
//! ```
//!
//! The robot thread alone answers the controller, and has the safety [latch]. It waits for nobody: not for the screen and
//! its keys, not for the disk, not for a port that is opened again. Orders come to it through a channel that it empties before a
//! reply; what it has to report and to trace leaves after the reply, and is dropped or kept where nobody takes it.

pub mod cell;
pub mod demo;
mod filter;
mod gripper;
pub mod input;
pub mod latch;
mod port;
mod profile;
mod robot;
pub mod verdict;
mod viewer;

pub use filter::{Axes, Filter};
pub use profile::{Profile, Source};

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::Result;
use isra_ball::Packet;
use val2_alter::{
    AXES, End, ErrorCode, Exception, ExceptionOutcome, HostConfig, HostState, Limits, LostReason, Motion,
    Policy, SessionError, Start,
};

use self::input::{Hand, InputConfig, Jog, Sample};
use self::latch::{Latch, LatchConfig};
use crate::io::line::Clock;
use crate::io::trace::Trace;

/// A serial port by its path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortConfig {
    /// The path or name.
    pub path: String,
    /// The baud rate.
    pub baud: u32,
}

/// What the host is to do.
#[derive(Debug, Clone)]
pub struct TeleopConfig {
    /// The robot's port.
    pub robot: PortConfig,
    /// Where the hand is.
    pub input: InputConfig,
    /// The file that keeps what the input reports.
    pub record: Option<PathBuf>,
    /// The workstation's port.
    pub viewer: Option<PortConfig>,
    /// The ALTER session.
    pub alter: HostConfig,
    /// The polls of the ball.
    pub polls: isra_ball::HostConfig,
    /// What the hand's values mean.
    pub profile: Profile,
    /// When the hand may move the arm.
    pub latch: LatchConfig,
}

/// What the robot thread is to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// New values of the hand.
    Hand(Sample),
    /// The hand's values are too old: come to rest.
    HandOld,
    /// The input is gone: come to rest.
    HandLost,
    /// The operator confirms that the hand may move the arm.
    Confirm,
    /// What the hand's values mean from now on: come to rest first.
    Profile(Box<Profile>),
    /// How start messages are answered.
    Policy(Policy),
    /// Come to rest, then fall silent.
    Stop,
    /// The same, and then the host ends.
    End,
    /// The gripper on the ball's keys, on or off.
    GripperKeys(bool),
    /// Listen at several baud rates, unless ALTER runs.
    Probe,
    /// Sleep, as a host does that has too much to do: a fault for the demo.
    Stall(Duration),
}

/// What the threads of the host report, each with its time.
#[derive(Debug, Clone, PartialEq)]
pub enum Notification {
    /// A port is open (again).
    PortOpen(&'static str, String),
    /// The chip of a port's USB adapter collects bytes for so many milliseconds.
    Latency(&'static str, u32),
    /// A port is gone; it is tried again.
    PortLost(&'static str, String),
    /// Whether the reply thread runs before all others.
    Priority(bool),
    /// A start message.
    Start(Start),
    /// A standard message.
    Motion(Motion),
    /// A reply has left.
    Reply {
        /// What the ball asked for.
        demand: [i16; AXES],
        /// What the limits made of it.
        values: [i16; AXES],
        /// From the last byte read to the reply written.
        thinking: Duration,
        /// An axis had to wait, because its word did not fit the window.
        held: bool,
    },
    /// ALTER is over.
    End(End),
    /// The reply came too late to be sent.
    Missed,
    /// The controller could not read a reply.
    Rejected(ErrorCode),
    /// Bytes from the robot that are no message.
    Corrupt(val2_alter::DecodeError),
    /// ALTER is over without an end message.
    Lost(LostReason),
    /// The values are zero after [`Order::Stop`]; no message is answered any more.
    Stopped,
    /// The session's state after something happened.
    State(HostState),
    /// What the safety latch is.
    Latch(Latch),
    /// The host has ended: nothing is answered any more.
    Ended,
    /// A key of the gripper was pressed, and what became of it.
    Gripper(Exception, Result<(), SessionError>),
    /// What became of it at the robot.
    GripperOutcome(Exception, ExceptionOutcome),
    /// New values of the input.
    Hand(Sample),
    /// A packet of the ball with new values, and how long after the poll it was whole.
    Ball(Packet, Duration),
    /// The same without new values.
    BallOld(Packet, Duration),
    /// A poll of the ball without a packet.
    BallMissed,
    /// A packet of the ball that is no reply: it comes too late.
    BallLate,
    /// Corrupt bytes from the ball.
    BallCorrupt(isra_ball::DecodeError),
    /// The ball's values are too old.
    BallStale,
    /// The workstation asked for a pose.
    PoseAsked,
    /// The workstation was sent a pose.
    Pose,
    /// What was received at a port at one baud rate.
    Probed {
        /// The port.
        port: &'static str,
        /// The rate.
        baud: u32,
        /// Good messages.
        good: usize,
        /// Corrupt ones.
        corrupt: usize,
    },
    /// ALTER runs: no port is tested.
    ProbeRefused,
    /// A trace was written.
    Trace(PathBuf),
}

/// So many reports wait for whoever shows them; what comes then is dropped: the control loop waits for nobody.
const NOTIFICATIONS: usize = 4096;
/// A thread that does not end is left alone after this time: it may hang in a driver.
const PATIENCE: Duration = Duration::from_secs(1);

/// The running host. It ends when it is dropped, without coming to rest: [`Order::End`] does that.
#[derive(Debug)]
pub struct Teleop {
    orders: Sender<Order>,
    probes: Vec<Sender<()>>,
    notification: Receiver<(Duration, Notification)>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    jog: Option<Sender<Jog>>,
}

/// Gives the host orders, from any thread.
#[derive(Debug, Clone)]
pub struct Orders(Sender<Order>);

impl Orders {
    /// As [`Teleop::order`].
    pub fn order(&self, order: Order) {
        // A robot thread that is gone has reported why.
        let _ = self.0.send(order);
    }
}

/// The traces of the host's own ends of the lines.
#[derive(Debug, Clone)]
pub struct Traces {
    /// The robot's line.
    pub robot: Trace,
    /// The ball's line.
    pub ball: Trace,
    /// The workstation's line.
    pub viewer: Trace,
}

impl Teleop {
    /// Opens the ports and begins. Everything that happens is reported; nobody needs to take it.
    ///
    /// # Errors
    /// When a port cannot be opened, or the ball cannot be polled that fast.
    pub fn start(config: TeleopConfig, clock: Clock, traces: &Traces) -> Result<Self> {
        let (orders, orders_in) = channel();
        let (notify, notification) = sync_channel(NOTIFICATIONS);
        let (ended_traces, traces_in) = channel::<(Trace, String)>();
        let (poses, poses_in) = channel();
        let (stop, runs) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let context = |trace: &Trace| Context {
            clock,
            notify: notify.clone(),
            stop: Arc::clone(&stop),
            runs: Arc::clone(&runs),
            trace: trace.clone(),
            ended_traces: ended_traces.clone(),
        };
        let (ball_probe, ball_probe_in) = channel();
        let (viewer_probe, viewer_probe_in) = channel();
        let robot = robot::Robot::open(&config, context(&traces.robot), orders_in, poses)?;
        let mut hand = Hand::open(
            &config.input,
            config.polls,
            config.record.as_ref(),
            context(&traces.ball),
            orders.clone(),
            ball_probe_in,
        )?;
        let jog = hand.jog.take();
        let viewer = match &config.viewer {
            Some(port) => Some(viewer::Feed::open(port, context(&traces.viewer), poses_in, viewer_probe_in)?),
            None => None,
        };
        let mut threads = vec![thread::spawn(|| robot.run()), thread::spawn(|| hand.run())];
        // Not from the robot's thread, whose priority it would have.
        let shown = notify.clone();
        thread::spawn(move || write_traces(&traces_in, clock, &shown));
        threads.extend(viewer.map(|viewer| thread::spawn(|| viewer.run())));
        Ok(Self { orders, probes: vec![ball_probe, viewer_probe], notification, stop, threads, jog })
    }

    /// For threads that give orders of their own: the operator's stop key waits for no screen.
    pub fn orders(&self) -> Orders {
        Orders(self.orders.clone())
    }

    /// Where the keys go that move the arm, if they are the input.
    pub fn jog(&self) -> Option<Sender<Jog>> {
        self.jog.clone()
    }

    /// Gives the robot thread an order. It is done within 20 ms, or before the next reply.
    pub fn order(&self, order: Order) {
        // A robot thread that is gone has reported why.
        let _ = self.orders.send(order);
    }

    /// Listens at every port at several baud rates, the operator's port test (§10.6). Not while ALTER runs.
    pub fn probe(&self) {
        self.order(Order::Probe);
        for probe in &self.probes {
            let _ = probe.send(());
        }
    }

    /// What was reported since the last call, in its order.
    pub fn notifications(&self) -> impl Iterator<Item = (Duration, Notification)> {
        self.notification.try_iter()
    }

    /// Waits for the next report.
    pub fn wait(&self, timeout: Duration) -> Option<(Duration, Notification)> {
        self.notification.recv_timeout(timeout).ok()
    }

    /// Whether a thread of the host has ended: after [`Order::End`], or because it has failed.
    pub fn has_ended(&self) -> bool {
        self.threads.iter().any(JoinHandle::is_finished)
    }
}

impl Teleop {
    /// Ends the threads, each with its trace.
    pub fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let end = Instant::now() + PATIENCE;
        while self.threads.iter().any(|thread| !thread.is_finished()) && Instant::now() < end {
            thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Teleop {
    fn drop(&mut self) {
        self.end();
    }
}

/// What every thread of the host has.
#[derive(Clone)]
struct Context {
    clock: Clock,
    notify: SyncSender<(Duration, Notification)>,
    stop: Arc<AtomicBool>,
    /// Whether ALTER runs: a recording begins then.
    runs: Arc<AtomicBool>,
    trace: Trace,
    ended_traces: Sender<(Trace, String)>,
}

impl Context {
    fn notify(&self, notification: Notification) {
        let _ = self.notify.try_send((self.clock.now(), notification));
    }

    fn runs(&self) -> bool {
        self.runs.load(Ordering::Relaxed)
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Writes the trace of a session that ended.
    fn end_trace(&self, why: &str) {
        report_trace(&self.trace, why, &self.notify, self.clock);
    }

    /// The same, while the next session may begin already: a file system keeps nobody waiting.
    fn end_trace_aside(&self, why: &str) {
        let _ = self.ended_traces.send((self.trace.clone(), why.into()));
    }
}

fn write_traces(
    ended: &Receiver<(Trace, String)>,
    clock: Clock,
    notify: &SyncSender<(Duration, Notification)>,
) {
    while let Ok((trace, why)) = ended.recv() {
        report_trace(&trace, &why, notify, clock);
    }
}

fn report_trace(trace: &Trace, why: &str, notify: &SyncSender<(Duration, Notification)>, clock: Clock) {
    let notification = match trace.session_ended(why) {
        Ok(Some(path)) => Notification::Trace(path),
        Ok(None) => return,
        Err(error) => Notification::PortLost("trace", format!("{error:#}")),
    };
    let _ = notify.try_send((clock.now(), notification));
}

/// The session's defaults for a computer with an operating system: bytes that came together may be read far apart.
pub fn host_config() -> HostConfig {
    HostConfig { gap: None, ..HostConfig::default() }
}

/// The polls of a ball that steers an arm: values are too old after 100 ms, one lost packet later.
pub fn polls(baud: u32) -> isra_ball::HostConfig {
    isra_ball::HostConfig { baud, max_age: Duration::from_millis(100), ..isra_ball::HostConfig::default() }
}

/// Why ALTER is over without an end message, in words.
pub fn lost_text(reason: LostReason) -> &'static str {
    match reason {
        LostReason::Silence => "the robot sends nothing",
        LostReason::Restart => "the robot has started ALTER again",
        LostReason::Disconnected => "the port is gone",
    }
}

/// Limits at which the source's Figure 9 is easily seen: 100 mm/s and 30 °/s, reached in a third of a second.
pub const LIMITS: Limits =
    Limits { velocity: [90, 90, 90, 150, 150, 150], acceleration: [8, 8, 8, 13, 13, 13] };
