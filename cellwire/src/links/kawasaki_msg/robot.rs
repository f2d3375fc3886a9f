//! The simulated robot: the communication task, and in a thread of its own the motion task that draws from the queue.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Job, Robot, RobotConfig, RobotEvent, RobotStatistics, timing};
use robot_work_queue::Reader;

use super::pc::SOON;
use crate::report::Samples;
use crate::tcp;
use crate::trace::{Trace, Way};

/// The motion task looks at its switch at least so often.
const LONGEST_SLEEP: Duration = Duration::from_millis(50);

/// How the simulated robot is made.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// The session's configuration.
    pub config: RobotConfig,
    /// How many jobs its queue holds.
    pub queue: usize,
    /// How fast the pen goes, in mm/s.
    pub speed: f64,
}

/// What a run has shown.
#[derive(Debug, Default)]
pub struct Run {
    /// What the pen did, in its order.
    pub strokes: Vec<Stroke>,
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

/// A job that was executed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stroke {
    /// Which order it was of, counted from 1.
    pub order: u32,
    /// The job.
    pub job: Job,
}

/// What the robot says while it runs.
#[derive(Debug)]
pub enum Told<'a> {
    /// An event of the session.
    Event(RobotEvent),
    /// A connection is open.
    Connected(&'a str),
    /// No connection could be opened, or one has ended.
    Disconnected(&'a str),
    /// The session's bytes were written there.
    Traced(std::path::PathBuf),
}

/// Runs until `stop`: connects to the PC at `address`, again whenever the connection is lost.
///
/// # Errors
/// What `tell` returns; a queue that cannot be made.
pub fn run(
    setup: &Setup,
    address: &str,
    trace: &Trace,
    stop: &AtomicBool,
    strokes: Sender<Stroke>,
    tell: impl FnMut(Told<'_>) -> Result<()>,
) -> Result<Run> {
    let (writer, reader) = robot_work_queue::boxed::<Job>(setup.queue, setup.config.max_number)?;
    let (report, reports) = mpsc::channel();
    let mut task = Communication {
        session: Robot::new(setup.config, writer)?,
        reports,
        orders: &AtomicU32::new(0),
        epoch: Instant::now(),
        connection: None,
        trace,
        run: Run::default(),
        tell,
        said: String::new(),
    };
    let (ended, orders, speed) = (AtomicBool::new(false), task.orders, setup.speed);
    let (outcome, work_cycle) = thread::scope(|scope| {
        let motion = scope.spawn(|| draw(reader, speed, orders, &ended, &report, &strokes));
        let outcome = task.run(address, stop);
        ended.store(true, Ordering::Relaxed);
        (outcome, motion.join())
    });
    outcome?;
    let statistics = task.session.statistics();
    let work_cycle = work_cycle.map_err(|_| anyhow!("the motion task panicked"))?;
    Ok(Run { work_cycle, statistics, ..task.run })
}

/// The communication task.
struct Communication<'a, T> {
    session: Robot<'a>,
    reports: Receiver<u16>,
    orders: &'a AtomicU32,
    epoch: Instant,
    connection: Option<TcpStream>,
    trace: &'a Trace,
    run: Run,
    tell: T,
    said: String,
}

impl<T: FnMut(Told<'_>) -> Result<()>> Communication<'_, T> {
    fn run(&mut self, address: &str, stop: &AtomicBool) -> Result<()> {
        while !stop.load(Ordering::Relaxed) {
            for number in self.reports.try_iter() {
                self.session.job_done(self.epoch.elapsed(), number)?;
            }
            self.session.handle_timeout(self.epoch.elapsed());
            if let Err(why) = self.events(address)?.and_then(|()| self.exchange()) {
                self.disconnected(&why)?;
            }
            if self.connection.is_none() {
                thread::sleep(timing::CPU_CYCLE);
            }
        }
        self.disconnected("the robot is switched off")
    }

    /// The inner error is why there is no connection.
    fn events(&mut self, address: &str) -> Result<Result<(), String>> {
        while let Some(event) = self.session.poll_event() {
            match event {
                RobotEvent::Connect => match tcp::connect(address) {
                    Ok(stream) => {
                        // The queue wants to be looked at, too.
                        stream.set_read_timeout(Some(timing::CPU_CYCLE))?;
                        self.session.handle_connected(self.epoch.elapsed());
                        self.connection = Some(stream);
                        self.run.connections += 1;
                        self.said.clear();
                        (self.tell)(Told::Connected(address))?;
                        continue;
                    }
                    Err(error) => return Ok(Err(format!("{error:#}"))),
                },
                RobotEvent::Disconnect => return Ok(Err("the PC is silent".into())),
                // Its jobs come with a later packet: the motion task sees the new order before them.
                RobotEvent::OrderStarted { .. } => _ = self.orders.fetch_add(1, Ordering::Release),
                _ => {}
            }
            (self.tell)(Told::Event(event))?;
        }
        Ok(Ok(()))
    }

    fn exchange(&mut self) -> Result<(), String> {
        let Some(stream) = &mut self.connection else { return Ok(()) };
        let mut buffer = [0; 4096];
        while let Some(length) = self.session.poll_transmit(self.epoch.elapsed(), &mut buffer) {
            let packet = buffer.get(..length).unwrap_or_default();
            self.trace.add(self.epoch.elapsed(), Way::Sent, packet);
            stream.write_all(packet).map_err(|error| error.to_string())?;
        }
        // A socket's time limit is rounded up to several milliseconds, a sleep is not; and the reports do not wait for long.
        let now = self.epoch.elapsed();
        if let Some(due) = self.session.poll_timeout().filter(|due| *due < now + SOON) {
            thread::sleep(due.saturating_sub(now).min(timing::CPU_CYCLE));
            return Ok(());
        }
        match stream.read(&mut buffer) {
            Ok(0) => Err("the PC closed the connection".into()),
            Ok(length) => {
                self.unpack(buffer.get(..length).unwrap_or_default());
                Ok(())
            }
            Err(error) if tcp::is_silence(&error) => Ok(()),
            Err(error) => Err(error.to_string()),
        }
    }

    fn unpack(&mut self, bytes: &[u8]) {
        let (begin, exchanges) = (self.epoch.elapsed(), self.session.statistics().exchange.count());
        self.trace.add(begin, Way::Received, bytes);
        self.session.handle_input(begin, bytes);
        let time = self.epoch.elapsed() - begin;
        self.session.record_unpack(time);
        self.run.unpack.add(time);
        let exchange = self.session.statistics().exchange;
        if exchange.count() > exchanges {
            self.run.exchange.add(exchange.last().unwrap_or_default());
        }
    }

    fn disconnected(&mut self, why: &str) -> Result<()> {
        self.session.handle_disconnected(self.epoch.elapsed());
        if self.connection.take().is_some() || self.said != why {
            (self.tell)(Told::Disconnected(why))?;
            why.clone_into(&mut self.said);
        }
        match self.trace.session_ended(why)? {
            Some(path) => (self.tell)(Told::Traced(path)),
            None => Ok(()),
        }
    }
}

/// The motion task: takes jobs until it is stopped, and moves the pen along each. Returns the work cycles.
fn draw(
    mut queue: Reader<'_, Job>,
    speed: f64,
    orders: &AtomicU32,
    stop: &AtomicBool,
    report: &Sender<u16>,
    strokes: &Sender<Stroke>,
) -> Samples {
    let mut cycles = Samples::default();
    let (mut before, mut arrival): (Option<(u32, Instant)>, _) = (None, Instant::now());
    while !stop.load(Ordering::Relaxed) {
        let Some(job) = queue.take() else {
            thread::sleep(timing::CPU_CYCLE / 4);
            arrival = Instant::now();
            continue;
        };
        let (order, taken) = (orders.load(Ordering::Acquire), Instant::now());
        if let Some((_, end)) = before.filter(|(last, _)| *last == order) {
            cycles.add(taken - end);
        }
        // Many jobs are shorter than a sleep can be: the pen waits when it is ahead of its plan.
        arrival += time_of(&job, speed);
        while let Some(ahead) = arrival.checked_duration_since(Instant::now())
            && ahead > timing::CPU_CYCLE
            && !stop.load(Ordering::Relaxed)
        {
            thread::sleep(ahead.min(LONGEST_SLEEP));
        }
        if stop.load(Ordering::Relaxed) {
            break; // switched off in the middle of the job
        }
        // Reported before it is complete, it is never asked for again. At the end of a run nobody listens.
        let _ = strokes.send(Stroke { order, job: *job });
        let _ = report.send(job.number);
        job.complete();
        before = Some((order, Instant::now()));
    }
    cycles
}

fn time_of(job: &Job, speed: f64) -> Duration {
    let way =
        f64::from(job.line.end.x - job.line.start.x).hypot(f64::from(job.line.end.y - job.line.start.y));
    Duration::from_secs_f64(way / 100.0 / speed)
}
