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
//! The robot thread alone answers the controller, and has the [latch](cellwire_motion::latch). It never waits: not for the screen
//! and its keys, not for the disk, not for a port that is opened again. Orders come to it through a channel that it empties
//! before a reply. Its reports and traces leave after the reply; if they are not accepted, they are dropped or buffered.

mod config;
mod context;
mod echo;
mod filter;
mod gripper;
mod handshake;
pub mod input;
mod messages;
pub mod operator;
mod port;
mod profile;
mod robot;
mod sample;
mod viewer;
pub mod window;

pub use config::{LIMITS, TeleopConfig, host_config};
pub use filter::{Axes, Filter};
pub use messages::{Notification, Order, lost_text};
pub use port::PortConfig;
pub use profile::{AxisSource, Profile};

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::Result;

use self::context::{Context, write_traces};
use self::input::InputThread;
use self::sample::Jog;
use cellwire_io::clock::Clock;
use cellwire_io::trace::Trace;

/// The number of reports that may wait for the screen; more are dropped: the control loop never waits.
const NOTIFICATIONS: usize = 4096;
/// The time for which a thread is awaited; it may hang in a driver.
const JOIN_TIMEOUT: Duration = Duration::from_secs(1);

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
    /// Gives an order as [`Teleop::order`] does.
    pub fn order(&self, order: Order) {
        // A robot thread that is gone has reported why.
        let _ = self.0.send(order);
    }
}

/// The traces of the host's own ends of the lines.
#[derive(Debug, Clone)]
pub struct Traces {
    /// The trace of the robot's line.
    pub robot: Trace,
    /// The trace of the ball's line.
    pub ball: Trace,
    /// The trace of the workstation's line.
    pub viewer: Trace,
}

impl Teleop {
    /// Opens the ports and begins. Every event is reported; reports need not be taken.
    ///
    /// # Errors
    /// If a port cannot be opened, or the ball cannot be polled that fast.
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
        let mut hand = InputThread::open(
            &config.input,
            config.polls,
            config.record.as_ref(),
            context(&traces.ball),
            orders.clone(),
            ball_probe_in,
        )?;
        let jog = hand.jog.take();
        let viewer = match &config.viewer {
            Some(port) => {
                let context = context(&traces.viewer);
                Some(viewer::Feed::open(port, config.viewer_host, context, poses_in, viewer_probe_in)?)
            }
            None => None,
        };
        let mut threads = vec![thread::spawn(|| robot.run()), thread::spawn(|| hand.run())];
        // Not from the robot's thread, whose priority it would have.
        let shown = notify.clone();
        thread::spawn(move || write_traces(&traces_in, clock, &shown));
        threads.extend(viewer.map(|viewer| thread::spawn(|| viewer.run())));
        Ok(Self { orders, probes: vec![ball_probe, viewer_probe], notification, stop, threads, jog })
    }

    /// Returns a handle for threads that give orders of their own: the operator's stop key does not wait for the screen.
    pub fn orders(&self) -> Orders {
        Orders(self.orders.clone())
    }

    /// Returns the sender of the keys that move the arm, if they are the input.
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

    /// Returns the reports since the last call, in sequence.
    pub fn notifications(&self) -> impl Iterator<Item = (Duration, Notification)> {
        self.notification.try_iter()
    }

    /// Waits for the next report.
    pub fn wait(&self, timeout: Duration) -> Option<(Duration, Notification)> {
        self.notification.recv_timeout(timeout).ok()
    }

    /// Returns whether a thread of the host has ended: after [`Order::End`], or because it has failed.
    pub fn has_ended(&self) -> bool {
        self.threads.iter().any(JoinHandle::is_finished)
    }
}

impl Teleop {
    /// Ends the threads, each with its trace.
    pub fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let end = Instant::now() + JOIN_TIMEOUT;
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
