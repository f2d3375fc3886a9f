//! The simulated robot, which draws the PC's orders.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use cellwire_sim::kawasaki::{Kawasaki, TimeOf};
use cellwire_sim::{Device as _, KawasakiRobot, Settings as _, Simulator, SimulatorReport};
use kawasaki_msg::{Job, RobotConfig, RobotEvent, RobotStatistics};
use robot_session::Session;

use super::endpoint::{self, Connection, Report};
use super::peer_endpoint::{PeerEndpoint, Side};
use super::sheet::Lines;
use crate::io::samples::Samples;
use cellwire_io::clock::Clock;
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
/// is given to `stroke`, and `notify` gets the events and the changes of the connection.
///
/// # Errors
/// The errors of `notify`.
pub fn run(
    mut robot: Simulator<Kawasaki<AnyWork>>,
    meeting: &mut PeerEndpoint,
    trace: &Trace,
    is_off: &AtomicBool,
    mut stroke: impl FnMut(Stroke),
    mut notify: impl FnMut(Report<'_, RobotEvent>) -> Result<()>,
) -> Result<Run> {
    let (mut run, clock) = (Run::default(), Clock::start());
    let (mut orders, mut exchanges) = (0, 0);
    let goes_on = || !is_off.load(Ordering::Relaxed);
    endpoint::run(Side::Robot, meeting, trace, clock, &mut robot, goes_on, |robot, report| {
        // Jobs that were executed before an event belong to the order before it.
        while let Some(done) = robot.poll_executed() {
            run.work_cycle.add(clock.now().saturating_sub(done.at));
            stroke(Stroke { order: orders, job: done.work });
        }
        match report {
            Report::Event(SimulatorReport::Device(RobotEvent::Connect)) => Ok(()),
            Report::Event(SimulatorReport::Device(event)) => {
                orders += u32::from(matches!(event, RobotEvent::OrderStarted { .. }));
                notify(Report::Event(event))
            }
            Report::Connection(change) => {
                run.connections += u64::from(matches!(change, Connection::Connected(_)));
                notify(Report::Connection(change))
            }
            Report::Handled(time) => {
                robot.device_mut().session_mut().record_unpack(time);
                run.unpack.add(time);
                Ok(())
            }
            Report::Settled => {
                let exchange = robot.statistics().exchange;
                if exchange.count() > core::mem::replace(&mut exchanges, exchange.count()) {
                    run.exchange.add(exchange.last().unwrap_or_default());
                }
                Ok(())
            }
            Report::Event(_) | Report::Sending => Ok(()),
        }
    })?;
    Ok(Run { statistics: robot.statistics(), ..run })
}
