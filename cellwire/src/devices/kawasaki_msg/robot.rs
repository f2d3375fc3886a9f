//! The simulated robot, which draws the PC's orders.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Result;
use cellwire_sim::host::{ConnectionEnd, HostedSession, Notice, Request, attend};
use cellwire_sim::kawasaki::{Kawasaki, TimeOf};
use cellwire_sim::{Device as _, KawasakiRobot, Settings as _, Simulator, SimulatorReport};
use kawasaki_msg::{Job, RobotConfig, RobotEvent, RobotStatistics};
use robot_session::Session;

use super::endpoint::{Connection, Connections, POLL_INTERVAL, Reports, Side};
use super::peer_endpoint::PeerEndpoint;
use super::sheet::Lines;
use crate::io::samples::Samples;
use cellwire_io::trace::Trace;
use cellwire_links::kawasaki_msg::layout::{AnyWork, Layout};

/// The settings of the simulated robot.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The configuration of the session.
    pub config: RobotConfig,
    /// The fields of a job.
    pub layout: Layout,
    /// The number of jobs that the robot's queue holds.
    pub queue: usize,
    /// The speed of the pen, in mm/s, if a job is a line.
    pub speed: f64,
    /// The time of a job that is not a line.
    pub job_time: Duration,
}

/// The measurements of a run.
#[derive(Debug, Default)]
pub struct Run {
    /// The times from the end of a job until the next one has begun: how late the robot has come to it.
    pub work_cycle: Samples,
    /// The times from sending a packet to having received its answer.
    pub exchange: Samples,
    /// The times to read a packet, to check it and to queue its jobs.
    pub unpack: Samples,
    /// The counters of the session.
    pub statistics: RobotStatistics,
    /// The number of times that a connection was opened.
    pub connections: u64,
}

/// A job that was executed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stroke {
    /// The number of the job's order, from 1.
    pub order: u32,
    /// The job that was executed.
    pub job: Job<AnyWork>,
}

/// A report of the robot while it runs.
#[derive(Debug)]
pub enum Notification<'a> {
    /// An event of the session.
    Event(RobotEvent),
    /// A change of the connection.
    Connection(Connection<'a>),
}

/// Creates the robot's simulator.
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

/// Runs the robot until it is switched off: meets the PC, again whenever the connection is lost. Each job that is executed
/// is given to `stroke`.
///
/// # Errors
/// The errors of `notify`.
pub fn run(
    robot: Simulator<Kawasaki<AnyWork>>,
    meeting: &mut PeerEndpoint,
    trace: &Trace,
    is_off: &AtomicBool,
    mut stroke: impl FnMut(Stroke),
    mut notify: impl FnMut(Notification<'_>) -> Result<()>,
) -> Result<Run> {
    let mut session = Unpacking { robot, times: Samples::default() };
    let (mut run, mut orders, mut exchanges) = (Run::default(), 0, 0);
    let connections = Connections::new(Side::Robot, meeting, trace);
    let (clock, mut reports) = (connections.clock(), Reports::new(Side::Robot));
    let goes_on = || !is_off.load(Ordering::Relaxed);
    attend(&mut session, connections, POLL_INTERVAL, goes_on, |session, notice| {
        // Jobs that were executed before an event belong to the order before it.
        while let Some(done) = session.robot.poll_executed() {
            run.work_cycle.add(clock.now().saturating_sub(done.at));
            stroke(Stroke { order: orders, job: done.work });
        }
        match notice {
            Notice::Event(_, SimulatorReport::Device(RobotEvent::Connect)) => Ok(()),
            Notice::Event(_, SimulatorReport::Device(event)) => {
                orders += u32::from(matches!(event, RobotEvent::OrderStarted { .. }));
                notify(Notification::Event(event))
            }
            Notice::Settled => {
                let exchange = session.robot.statistics().exchange;
                if exchange.count() > core::mem::replace(&mut exchanges, exchange.count()) {
                    run.exchange.add(exchange.last().unwrap_or_default());
                }
                Ok(())
            }
            notice => {
                run.connections += u64::from(matches!(notice, Notice::Connected(_)));
                reports.pass(&notice, trace, |change| notify(Notification::Connection(change)))
            }
        }
    })?;
    session.handle_disconnected(clock.now());
    let ended: Notice<'_, ()> = Notice::Disconnected("", &ConnectionEnd::Stopped);
    reports.pass(&ended, trace, |change| notify(Notification::Connection(change)))?;
    Ok(Run { statistics: session.statistics(), unpack: session.times, ..run })
}

/// A robot that measures how long it unpacks a packet.
struct Unpacking {
    robot: Simulator<Kawasaki<AnyWork>>,
    times: Samples,
}

impl HostedSession for Unpacking {
    fn accepts(&self, now: Duration) -> bool {
        self.robot.accepts(now)
    }

    fn request(event: &SimulatorReport<RobotEvent>) -> Option<Request> {
        Simulator::<Kawasaki<AnyWork>>::request(event)
    }
}

impl Session for Unpacking {
    type Event = SimulatorReport<RobotEvent>;
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
