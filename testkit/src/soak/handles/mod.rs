//! The handle of each link against the simulated device at its other end: both are tasks of tokio on a virtual clock,
//! connected by pipes whose bytes pass through the faulty [`Link`](crate::link::Link). Either end is restarted at times.
//!
//! A job is a call, or one of those that a call is for. Some calls are dropped while they wait. Of a link without calls it
//! is a value that is waited for.

mod rows;
mod wire;

use core::convert::Infallible;
use core::ops::Range;
use core::time::Duration;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

use cellwire_sim::{Device, ExecutedWork, Settings, Simulator, SimulatorReport};
use robot_session::now;
use robot_session::tokio::{Reports, Service, spawn};
use tokio::time::timeout;

pub use self::rows::{ROWS, SABOTAGED};
use self::wire::{Plug, Wire};
use super::{Check, Ledger, Log, ReportedOutcome, Tally};
use crate::link::{End, Faults};
use robot_session::contract::Rng;

const MS: Duration = Duration::from_millis(1);
/// The fault-free time at the end, and the jobs that must be done in it.
const HEALED: Duration = Duration::from_secs(60);
const WORK: usize = 20;

/// The handle of one link, and the other end.
trait HandledLink: Sized {
    /// The simulated device.
    type Device: Settings<Device: Device<Session: Send> + Send + 'static>;
    /// The faults of the transport.
    const FAULTS: Faults;
    /// Whether the device reports which jobs it has executed; otherwise the jobs reported as done count as executed.
    const NAMES_JOBS: bool = true;
    /// Of this many random messages the protocol's own check passes one; `None` where no byte is ever corrupt.
    const ONE_IN: Option<u32> = None;
    /// The most bytes of a message.
    const MAX_MESSAGE_LEN: usize = 0;
    /// The share of executed jobs that the device drops.
    const FORGETS: f64 = 0.0;
    /// A restart of the device loses no work that was reported as done.
    const RESTARTS: bool = true;

    /// Returns the device's settings.
    fn device() -> Self::Device;

    /// Creates the handle; its task runs on its own.
    fn spawn(plug: Plug) -> Self;

    /// Has jobs executed, and returns the outcome of each.
    async fn work(&mut self, jobs: Range<usize>) -> Vec<ReportedOutcome>;

    /// Returns the message at the beginning of some bytes, if there is one.
    fn check(_from: End, _bytes: &[u8]) -> Check {
        Check::Nothing
    }

    /// Returns whether a job is in a message with these bytes.
    fn is_in(_job: usize, _message: &[u8]) -> bool {
        false
    }

    /// Returns the number of an executed job.
    fn job(work: &Work<Self>) -> Option<usize>;
}

type Simulated<L> = <<L as HandledLink>::Device as Settings>::Device;
type Work<L> = <Simulated<L> as Device>::Work;
type Shared<W> = Arc<Mutex<Vec<ExecutedWork<W>>>>;

/// The service of a device, which is never called: it records the executed jobs.
struct Executing<D: Device>(Shared<D::Work>);

impl<D: Device<Session: Send> + Send> Service for Executing<D> {
    type Session = Simulator<D>;
    type Call = Infallible;
    type Event = ();

    fn call(&mut self, _: &mut Simulator<D>, _: Duration, call: Infallible) {
        match call {}
    }

    fn event(
        &mut self,
        simulator: &mut Simulator<D>,
        told: SimulatorReport<D::Event>,
        reports: &mut Reports<'_, ()>,
    ) {
        self.note(simulator);
        if let SimulatorReport::Close(why) = told {
            reports.reconnect(io::Error::other(why));
        }
    }

    async fn keep(&mut self, simulator: &mut Simulator<D>) -> io::Result<()> {
        self.note(simulator);
        Ok(())
    }

    fn refuse(&mut self, call: Infallible, _: &Arc<io::Error>) {
        match call {}
    }
}

impl<D: Device> Executing<D> {
    fn note(&self, simulator: &mut Simulator<D>) {
        let mut executed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        executed.extend(core::iter::from_fn(|| simulator.poll_executed()));
    }
}

fn session<L: HandledLink>(seed: u64, log: Log) -> Tally
where
    Simulated<L>: 'static,
{
    // The pauses before a connection is made again.
    fastrand::seed(seed);
    let mut runtime = tokio::runtime::Builder::new_current_thread();
    let runtime = runtime.enable_time().start_paused(true).build().unwrap();
    runtime.block_on(run::<L>(seed, log))
}

async fn run<L: HandledLink>(seed: u64, log: Log) -> Tally
where
    Simulated<L>: 'static,
{
    let (mut rng, begun) = (Rng::new(!seed), now());
    let log_line = |text: core::fmt::Arguments<'_>| log.line(now() - begun, text);
    let bad = [0.3, 1.0, 4.0][rng.below(3)];
    let Faults { flip, lose_byte, insert, lose, disconnect, .. } = L::FAULTS;
    let faults = Faults {
        flip: flip * bad,
        lose_byte: lose_byte * bad,
        insert: insert * bad,
        lose: lose * bad,
        disconnect: disconnect * bad,
        ..L::FAULTS
    };
    let (wire, [near, far]) = Wire::start(seed, faults, log);
    let executed = Shared::default();
    let simulator = L::device().simulator().unwrap();
    let device_faults = simulator.faults().clone();
    let (device, task) = spawn(simulator, Executing(Arc::clone(&executed)), far);
    let device_task = tokio::spawn(task.run());
    let (mut handle, mut ledger, mut tally) = (L::spawn(near.clone()), Ledger::default(), Tally::default());

    let send = |ledger: &mut Ledger, rng: &mut Rng| {
        let count = 1 + rng.below(8);
        let first = ledger.len();
        (0..count).for_each(|_| _ = ledger.send(wire.mark()));
        first..first + count
    };
    for _ in 0..3 + rng.below(20) {
        let jobs = send(&mut ledger, &mut rng);
        let patience = if rng.chance(0.2) { rng.log_uniform(MS, 2000 * MS) } else { Duration::MAX };
        if L::RESTARTS && rng.chance(0.1) {
            let (faults, off) = (device_faults.clone(), rng.log_uniform(10 * MS, 3000 * MS));
            let later = rng.log_uniform(MS, 1000 * MS);
            tokio::spawn(async move {
                tokio::time::sleep(later).await;
                faults.restart(off);
            });
        }
        log_line(format_args!("jobs {jobs:?}"));
        let reported = timeout(patience, handle.work(jobs.clone())).await;
        // After a timeout the outcomes are unknown.
        let reported = reported.unwrap_or_else(|_| vec![ReportedOutcome::Unknown; jobs.len()]);
        log_line(format_args!("  {reported:?}"));
        for (job, reported) in jobs.zip(reported) {
            ledger.report(job, reported, wire.mark());
        }
        if rng.chance(0.1) {
            log_line(format_args!("the program is restarted"));
            handle = L::spawn(near.clone());
        }
    }
    wire.heal();
    log_line(format_args!("no more faults"));
    let end = tokio::time::Instant::now() + HEALED;
    let mut done = 0;
    while done < WORK {
        let jobs = send(&mut ledger, &mut rng);
        let Ok(reported) = tokio::time::timeout_at(end, handle.work(jobs.clone())).await else {
            log_line(format_args!("!!! {done} jobs are done"));
            tally.stuck = 1;
            jobs.for_each(|job| _ = ledger.report(job, ReportedOutcome::Unknown, wire.mark()));
            break;
        };
        log_line(format_args!("jobs {jobs:?}: {reported:?}"));
        for (job, reported) in jobs.zip(reported) {
            done += usize::from(reported == ReportedOutcome::Done);
            ledger.report(job, reported, wire.mark());
        }
    }
    // Let the device execute the queued jobs.
    tokio::time::sleep(HEALED).await;
    device.shutdown().await;
    if let Ok(mut simulator) = device_task.await {
        Executing(Arc::clone(&executed)).note(&mut simulator);
    }
    let unseen = wire.settle(&mut tally, L::MAX_MESSAGE_LEN, L::check);
    for done in executed.lock().unwrap_or_else(PoisonError::into_inner).iter() {
        if rng.chance(L::FORGETS) {
            continue;
        }
        let is_named = !L::NAMES_JOBS || L::job(&done.work).is_some_and(|job| ledger.execute(job));
        if !is_named && unseen.iter().all(|unseen| unseen.from != End::A) {
            log_line(format_args!("!!! nobody sent {:?}", done.work));
            tally.invented += 1;
        }
    }
    if !L::NAMES_JOBS {
        ledger.execute_what_is_done();
    }
    // A job that is executed may be executed again by a later message that corruption turned into it.
    ledger.settle(now() - begun, log, &mut tally, |number, job| {
        unseen.iter().any(|unseen| unseen.is_between(job.from, job.to) || L::is_in(number, &unseen.bytes))
    });
    tally
}
