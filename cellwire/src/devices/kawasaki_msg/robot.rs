//! The simulated robot, which draws what a PC sends.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Result;
use cellwire_sim::kawasaki::{Kawasaki, TimeOf};
use cellwire_sim::{Device as _, KawasakiRobot, Settings as _, Simulator, Told};
use kawasaki_msg::{Job, RobotConfig, RobotEvent, RobotStatistics};
use robot_session::{Driver, Session, Transport as _, Waker};

use super::sheet::Lines;
use crate::io::samples::Samples;
use cellwire_io::kawasaki::meeting::{Carrier, Meeting};
use cellwire_io::kawasaki::peer::{Peer, outcome};
use cellwire_io::trace::Trace;
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

/// A robot that is connected to looks for another PC this often.
const GLANCE: Duration = Duration::from_millis(20);

/// What a run has shown.
#[derive(Debug, Default)]
pub struct Run {
    /// From the end of a job until the next one has begun: how late the robot has come to it.
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

/// Runs until it is switched off: meets the PC, again whenever the connection is lost. Each job that is executed is given to `stroke`.
///
/// # Errors
/// What `notify` returns; settings that cannot work, or a waker that cannot be made.
pub fn run(
    setup: &Setup,
    meeting: &mut Meeting,
    trace: &Trace,
    switch: &Switch,
    stroke: impl FnMut(Stroke),
    notify: impl FnMut(Notification<'_>) -> Result<()>,
) -> Result<Run> {
    execute(simulator(setup)?, meeting, trace, switch, stroke, notify)
}

/// The robot.
///
/// # Errors
/// Settings that cannot work.
pub fn simulator(setup: &Setup) -> Result<Simulator<Kawasaki<AnyWork>>> {
    let Setup { config, layout, queue, speed, job_time } = setup.clone();
    let time_of = Lines::of(&layout).ok().map(|lines| -> TimeOf<AnyWork> {
        Arc::new(move |work| Duration::from_secs_f64(lines.line(work).length() / speed))
    });
    Ok(KawasakiRobot { config, ranges: layout, queue, job_time, time_of }.simulator()?)
}

/// As [`run`], with a robot that was made before.
///
/// # Errors
/// As [`run`].
pub fn execute(
    robot: Simulator<Kawasaki<AnyWork>>,
    meeting: &mut Meeting,
    trace: &Trace,
    switch: &Switch,
    stroke: impl FnMut(Stroke),
    notify: impl FnMut(Notification<'_>) -> Result<()>,
) -> Result<Run> {
    let mut driver = Driver::new(Peer::new(trace));
    switch.lock().1 = Some(driver.waker()?);
    let mut task = Task {
        session: Unpacking { robot, times: Samples::default() },
        orders: 0,
        driver,
        trace,
        run: Run::default(),
        stroke,
        notify,
        reported: String::new(),
    };
    task.run(meeting, switch)?;
    let statistics = task.session.statistics();
    Ok(Run { statistics, unpack: task.session.times, ..task.run })
}

/// What is done around the robot.
struct Task<'a, S, T> {
    session: Unpacking,
    /// How many orders have begun.
    orders: u32,
    driver: Driver<Peer<'a>>,
    trace: &'a Trace,
    run: Run,
    stroke: S,
    notify: T,
    reported: String,
}

/// Why the handler ends a turn.
enum Break {
    Connect,
    Close(&'static str),
    Failed(anyhow::Error),
}

impl<S: FnMut(Stroke), T: FnMut(Notification<'_>) -> Result<()>> Task<'_, S, T> {
    fn run(&mut self, meeting: &mut Meeting, switch: &Switch) -> Result<()> {
        while !switch.is_off() {
            if meeting.takes_another() && self.session.robot.accepts(self.driver.transport_mut().now()) {
                self.take_newest(meeting)?;
            }
            if let Err(why) = self.turn(meeting)? {
                self.disconnected(&why)?;
            }
        }
        self.disconnected("the robot is switched off")
    }

    /// Where PCs connect, a new one takes the place of the one before it, whatever that does.
    fn take_newest(&mut self, meeting: &mut Meeting) -> Result<()> {
        if let Ok(Some(found)) = meeting.meet()? {
            if self.driver.transport_mut().is_connected() {
                self.disconnected("another PC has connected")?;
            }
            self.connected(found)?;
        }
        Ok(())
    }

    /// The inner error is why there is no connection.
    fn turn(&mut self, meeting: &mut Meeting) -> Result<Result<(), String>> {
        let Self { session, driver, orders, run, stroke, notify, .. } = self;
        let exchanges = session.exchange().count();
        let now = driver.transport_mut().now();
        let mut draw = |session: &mut Unpacking, order: u32, now: Duration| {
            while let Some(done) = session.robot.poll_executed() {
                run.work_cycle.add(now.saturating_sub(done.at));
                stroke(Stroke { order, job: done.work });
            }
        };
        // A PC that connects, and a command to the simulator, wait this long at most.
        let (wait, takes_another) = (Some(GLANCE), meeting.takes_another());
        let turn = driver.turn(session, wait, |session, told| {
            let event = match told {
                Told::Connect if takes_another => return ControlFlow::Continue(()),
                Told::Connect => return ControlFlow::Break(Break::Connect),
                Told::Close(why) => return ControlFlow::Break(Break::Close(why)),
                Told::Device(RobotEvent::Connect) => return ControlFlow::Continue(()),
                Told::Device(event) => event,
                _ => return ControlFlow::Continue(()),
            };
            // What was executed before belongs to the order before.
            draw(session, *orders, now);
            *orders += u32::from(matches!(event, RobotEvent::OrderStarted { .. }));
            match notify(Notification::Event(event)) {
                Err(error) => ControlFlow::Break(Break::Failed(error)),
                Ok(()) => ControlFlow::Continue(()),
            }
        });
        draw(session, *orders, driver.transport_mut().now());
        let exchange = session.exchange();
        if exchange.count() > exchanges {
            self.run.exchange.add(exchange.last().unwrap_or_default());
        }
        match outcome(turn, "the PC closed the connection") {
            ControlFlow::Continue(lost) => Ok(lost),
            ControlFlow::Break(Break::Connect) => self.connect(meeting),
            ControlFlow::Break(Break::Close(why)) => Ok(Err(why.into())),
            ControlFlow::Break(Break::Failed(error)) => Err(error),
        }
    }

    fn connect(&mut self, meeting: &mut Meeting) -> Result<Result<(), String>> {
        match meeting.meet()? {
            Ok(Some(found)) => self.connected(found).map(Ok),
            Ok(None) => Ok(Err("no PC has connected".into())),
            Err(why) => Ok(Err(why)),
        }
    }

    fn connected(&mut self, (carrier, peer): (Carrier, String)) -> Result<()> {
        self.driver.transport_mut().connect(carrier)?;
        self.session.handle_connected(self.driver.transport_mut().now());
        self.run.connections += 1;
        self.reported.clear();
        (self.notify)(Notification::Connected(peer))
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

/// A robot that measures how long it unpacks a packet.
struct Unpacking {
    robot: Simulator<Kawasaki<AnyWork>>,
    times: Samples,
}

impl Unpacking {
    /// From sending a packet to having received its answer.
    fn exchange(&self) -> kawasaki_msg::Times {
        self.robot.statistics().exchange
    }
}

impl Session for Unpacking {
    type Event = Told<RobotEvent>;
    type Statistics = RobotStatistics;
    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Simulator::<Kawasaki<AnyWork>>::MAX_TRANSMIT;

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        let begin = Instant::now();
        self.robot.handle_input(now, bytes);
        let time = begin.elapsed();
        self.robot.device_mut().session_mut().record_unpack(time);
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

    fn wants_input(&self) -> bool {
        self.robot.wants_input()
    }

    fn poll_event(&mut self) -> Option<Self::Event> {
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
