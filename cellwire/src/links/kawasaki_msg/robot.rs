//! The simulated robot: the communication task, and in a thread of its own the motion task that draws from the queue.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use kawasaki_msg::{Job, LargeRobot, RobotConfig, RobotEvent, RobotStatistics, timing};
use robot_session::{Driver, Session, Transport as _, Waker};
use robot_work_queue::{Reader, Wake};

use super::meeting::Meeting;
use super::peer::{Peer, outcome};
use super::sheet::Lines;
use crate::io::bell::Bell;
use crate::io::samples::Samples;
use crate::io::trace::Trace;
use cellwire_links::kawasaki_msg::layout::{AnyWork, Layout};

/// How the simulated robot is made.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The session's configuration.
    pub config: RobotConfig<'static>,
    /// What a job is.
    pub layout: Layout,
    /// How many jobs its queue holds.
    pub queue: usize,
    /// How fast the pen goes, in mm/s, where a job is a line.
    pub speed: f64,
    /// How long a job takes that is none.
    pub job_time: Duration,
}

/// What a run has shown.
#[derive(Debug, Default)]
pub struct Run {
    /// From the end of a job to the beginning of the next one of the order, without the motion.
    pub work_cycle: Samples,
    /// From sending a packet to having received its answer.
    pub exchange: Samples,
    /// Reading a packet, checking it and queueing its jobs.
    pub unpack: Samples,
    /// What the session has counted.
    pub statistics: RobotStatistics,
    /// How often a connection was opened.
    pub connections: u64,
}

/// How a robot is stopped.
#[derive(Debug, Default)]
pub struct Switch(Mutex<(bool, Option<Waker>)>);

impl Switch {
    /// Stops it, at once or when it begins.
    pub fn turn_off(&self) {
        let mut state = self.lock();
        state.0 = true;
        if let Some(waker) = &state.1 {
            waker.wake();
        }
    }

    fn is_off(&self) -> bool {
        self.lock().0
    }

    fn lock(&self) -> MutexGuard<'_, (bool, Option<Waker>)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A job that was executed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stroke {
    /// Which order it was of, counted from 1.
    pub order: u32,
    /// The job.
    pub job: Job<AnyWork>,
}

/// What the robot reports while it runs.
#[derive(Debug)]
pub enum Notification<'a> {
    /// An event of the session.
    Event(RobotEvent),
    /// A connection is open.
    Connected(String),
    /// No connection could be opened, or one has ended.
    Disconnected(&'a str),
    /// The session's bytes were written there.
    Traced(std::path::PathBuf),
}

/// Runs until it is switched off: meets the PC, again whenever the connection is lost. The motion task gives each job that is
/// executed to `stroke`.
///
/// # Errors
/// What `notify` returns; a queue, or a waker, that cannot be made.
pub fn run(
    setup: &Setup,
    meeting: &mut Meeting,
    trace: &Trace,
    switch: &Switch,
    stroke: impl FnMut(Stroke) + Send,
    notify: impl FnMut(Notification<'_>) -> Result<()>,
) -> Result<Run> {
    let mut driver = Driver::new(Peer::new(trace));
    let (bell, waker) = (Bell::default(), driver.waker()?);
    switch.lock().1 = Some(waker.clone());
    let (ring, max_number) = (bell.clone(), setup.config.max_number);
    let (writer, reader) =
        robot_work_queue::boxed_with(setup.queue, max_number, move || ring.ring(), move || waker.wake())?;
    let (report, reports) = mpsc::channel();
    let mut task = Communication {
        session: Unpacking {
            robot: LargeRobot::sized(setup.config, writer)?.with_ranges(setup.layout.clone())?,
            times: Samples::default(),
        },
        reports,
        orders: &AtomicU32::new(0),
        driver,
        trace,
        run: Run::default(),
        notify,
        reported: String::new(),
    };
    let (ended, orders, lines) = (AtomicBool::new(false), task.orders, Lines::of(&setup.layout).ok());
    let time_of = |work: &AnyWork| match &lines {
        Some(lines) => Duration::from_secs_f64(lines.line(work).length() / setup.speed),
        None => setup.job_time,
    };
    let (outcome, work_cycle) = thread::scope(|scope| {
        let builder = thread::Builder::new().name("motion".into());
        let motion = builder
            .spawn_scoped(scope, || execute(reader, &bell, &time_of, orders, &ended, &report, stroke))?;
        let outcome = task.run(meeting, switch);
        ended.store(true, Ordering::Relaxed);
        bell.ring();
        anyhow::Ok((outcome, motion.join()))
    })
    .context("cannot start the motion task")?;
    outcome?;
    let statistics = task.session.statistics();
    let work_cycle = work_cycle.map_err(|_| anyhow!("the motion task panicked"))?;
    Ok(Run { work_cycle, statistics, unpack: task.session.times, ..task.run })
}

/// The communication task.
struct Communication<'a, T, R: Wake> {
    session: Unpacking<'a, R>,
    reports: Receiver<u16>,
    orders: &'a AtomicU32,
    driver: Driver<Peer<'a>>,
    trace: &'a Trace,
    run: Run,
    notify: T,
    reported: String,
}

/// Why the handler ends a turn.
enum Break {
    Connect,
    Silent,
    Failed(anyhow::Error),
}

impl<T: FnMut(Notification<'_>) -> Result<()>, R: Wake> Communication<'_, T, R> {
    fn run(&mut self, meeting: &mut Meeting, switch: &Switch) -> Result<()> {
        while !switch.is_off() {
            for number in self.reports.try_iter() {
                self.session.robot.job_done(self.driver.transport_mut().now(), number)?;
            }
            if let Err(why) = self.turn(meeting)? {
                self.disconnected(&why)?;
            }
        }
        self.disconnected("the robot is switched off")
    }

    /// The inner error is why there is no connection.
    fn turn(&mut self, meeting: &mut Meeting) -> Result<Result<(), String>> {
        let Self { session, driver, orders, notify, .. } = self;
        let exchanges = session.robot.statistics().exchange.count();
        let turn = driver.turn(session, None, |_, event| {
            match event {
                RobotEvent::Connect => return ControlFlow::Break(Break::Connect),
                // Its jobs come with a later packet: the motion task sees the new order before them.
                RobotEvent::OrderStarted { .. } => _ = orders.fetch_add(1, Ordering::Release),
                _ => {}
            }
            match notify(Notification::Event(event)) {
                Err(error) => ControlFlow::Break(Break::Failed(error)),
                Ok(()) if event == RobotEvent::Disconnect => ControlFlow::Break(Break::Silent),
                Ok(()) => ControlFlow::Continue(()),
            }
        });
        let exchange = session.robot.statistics().exchange;
        if exchange.count() > exchanges {
            self.run.exchange.add(exchange.last().unwrap_or_default());
        }
        match outcome(turn, "the PC closed the connection") {
            ControlFlow::Continue(lost) => Ok(lost),
            ControlFlow::Break(Break::Connect) => self.connect(meeting),
            ControlFlow::Break(Break::Silent) => Ok(Err("the PC is silent".into())),
            ControlFlow::Break(Break::Failed(error)) => Err(error),
        }
    }

    fn connect(&mut self, meeting: &mut Meeting) -> Result<Result<(), String>> {
        let (carrier, peer) = match meeting.meet()? {
            Ok(Some(found)) => found,
            Ok(None) => return Ok(Err("no PC has connected".into())),
            Err(why) => return Ok(Err(why)),
        };
        self.driver.transport_mut().connect(carrier);
        self.session.handle_connected(self.driver.transport_mut().now());
        self.run.connections += 1;
        self.reported.clear();
        (self.notify)(Notification::Connected(peer)).map(Ok)
    }

    fn disconnected(&mut self, why: &str) -> Result<()> {
        self.session.handle_disconnected(self.driver.transport_mut().now());
        if self.driver.transport_mut().disconnect() || self.reported != why {
            (self.notify)(Notification::Disconnected(why))?;
            why.clone_into(&mut self.reported);
        }
        match self.trace.finish(why) {
            Some(path) => (self.notify)(Notification::Traced(path)),
            None => Ok(()),
        }
    }
}

/// A session that measures how long it unpacks a packet.
struct Unpacking<'a, R: Wake> {
    robot: LargeRobot<'a, AnyWork, R>,
    times: Samples,
}

impl<R: Wake> Session for Unpacking<'_, R> {
    type Event = RobotEvent;
    type Statistics = RobotStatistics;
    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = LargeRobot::<AnyWork>::MAX_TRANSMIT;

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        let begin = Instant::now();
        self.robot.handle_input(now, bytes);
        let time = begin.elapsed();
        self.robot.record_unpack(time);
        self.times.add(time);
    }

    fn handle_connected(&mut self, now: Duration) {
        self.robot.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.robot.handle_disconnected(now);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.robot.handle_timeout(now);
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.robot.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.robot.poll_transmit(now, out)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.robot.poll_timeout()
    }

    fn statistics(&self) -> RobotStatistics {
        self.robot.statistics()
    }
}

/// The motion task: takes jobs until it is stopped, and takes the time of each. Returns the work cycles.
fn execute(
    mut queue: Reader<'_, Job<AnyWork>, impl Wake>,
    bell: &Bell,
    time_of: &impl Fn(&AnyWork) -> Duration,
    orders: &AtomicU32,
    stop: &AtomicBool,
    report: &Sender<u16>,
    mut stroke: impl FnMut(Stroke),
) -> Samples {
    let mut cycles = Samples::default();
    let (mut before, mut arrival): (Option<(u32, Instant)>, _) = (None, Instant::now());
    while !stop.load(Ordering::Relaxed) {
        let Some(job) = queue.take() else {
            bell.wait();
            arrival = Instant::now();
            continue;
        };
        let (order, taken) = (orders.load(Ordering::Acquire), Instant::now());
        if let Some((_, end)) = before.filter(|(last, _)| *last == order) {
            cycles.add(taken - end);
        }
        // Many jobs are shorter than a sleep can be: the pen waits when it is ahead of its plan.
        arrival += time_of(&job.work);
        while let Some(ahead) = arrival.checked_duration_since(Instant::now())
            && ahead > timing::CPU_CYCLE
            && !stop.load(Ordering::Relaxed)
        {
            bell.wait_for(ahead);
        }
        if stop.load(Ordering::Relaxed) {
            break; // switched off in the middle of the job
        }
        // Reported before it is complete, it is never asked for again. At the end of a run nobody listens.
        stroke(Stroke { order, job: *job });
        let _ = report.send(job.number);
        job.complete();
        before = Some((order, Instant::now()));
    }
    cycles
}
