//! `cellwire demo mmacell-proto`: the pick-and-place task over three TCP connections into a simulated cell.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use mmacell_proto::task::Step;

use super::cell::{Cell, Which};
use super::central::{Central, Now};
use super::timeline;
use super::verdict::{End, attempts, is_in_order, leaves_open};
use crate::demo::DemoOptions;
use crate::report::{Jobs, Report, Samples};
use crate::settings::Settings;
use crate::tcp::{self, FaultyProxy};
use crate::trace::{Trace, Way};

/// Parts of a run that is not told how long it is.
const PARTS: u64 = 100;
/// How many times faster than life the cell runs, unless told otherwise. The protocol's own times are not changed.
const SPEED: u32 = 200;
/// How often a read breaks the connection when faults are wanted.
const BREAKS: f64 = 0.001;
/// Longer than this the task is in no step, even when every connection has to be opened again.
const STANDSTILL: Duration = Duration::from_secs(20);

/// Runs the demo. Settings: `parts`, `speed`.
///
/// # Errors
/// When no port is free, a setting is none of this demo's, the picture cannot be written, or the cell stands still.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let settings = Settings::new("mmacell-proto", &options.settings, &["parts", "speed"])?;
    let speed = settings.number("speed", SPEED)?;
    ensure!((1..=10_000).contains(&speed), "speed={speed} is outside 1 to 10000");
    let parts: u64 = settings.number("parts", PARTS)?;
    ensure!(parts > 0, "parts=0 leaves nothing to do");
    // A time limit counts, not a number of parts, unless both are given.
    let until_told = options.seconds.is_some() && !options.settings.contains_key("parts");
    let run = Run::start(options, speed)?;
    let (log, cell) = run.place((!until_told).then_some(parts), options)?;
    if let Some(path) = &options.out {
        timeline::draw(path, &log, &cell)?;
    }
    let mut report = report(&log, &cell, options.faults, speed);
    report.require(until_told || options.seconds.is_some() || log.placed == parts, || {
        format!("{} of {parts} parts were placed", log.placed)
    });
    if let Some(path) = &options.out {
        report.fact("timeline", "timeline", path.display().to_string());
    }
    Ok(report)
}

/// The simulated cell behind its three ports.
struct Run {
    cell: Arc<Mutex<Cell>>,
    clock: Clock,
    addresses: [SocketAddr; 3],
    _proxies: Vec<FaultyProxy>,
}

/// One clock for the protocol and one, faster, for the axes.
#[derive(Debug, Clone, Copy)]
struct Clock {
    epoch: Instant,
    speed: u32,
}

impl Clock {
    fn now(&self) -> Now {
        let wall = self.epoch.elapsed();
        Now { wall, cell: wall * self.speed }
    }
}

impl Run {
    fn start(options: &DemoOptions, speed: u32) -> Result<Self> {
        let cell = Arc::new(Mutex::new(Cell::new(options.seed, options.faults)));
        let clock = Clock { epoch: Instant::now(), speed };
        let mut addresses = Vec::new();
        let mut proxies = Vec::new();
        for which in Which::ALL {
            let listener = tcp::listen("127.0.0.1:0")?;
            let mut address = listener.local_addr()?;
            let cell = Arc::clone(&cell);
            let trace = options.trace.start(&format!("mma-{}", format!("{which:?}").to_lowercase()));
            thread::spawn(move || serve(&listener, which, &cell, clock, &trace));
            if options.faults {
                let proxy = FaultyProxy::start(address, options.seed + which as u64, BREAKS)?;
                address = proxy.address();
                proxies.push(proxy);
            }
            addresses.push(address);
        }
        let addresses =
            <[SocketAddr; 3]>::try_from(addresses).map_err(|_| anyhow::anyhow!("three devices"))?;
        Ok(Self { cell, clock, addresses, _proxies: proxies })
    }

    /// Places so many parts, or as many as fit into the time; what happened.
    fn place(self, parts: Option<u64>, options: &DemoOptions) -> Result<(super::central::Log, Cell)> {
        let (heard, inbox) = channel();
        let mut central = Central::new(parts);
        let mut connections = Vec::new();
        for (which, address) in Which::ALL.into_iter().zip(self.addresses) {
            connections.push(Connection::open(which, address, 0, &heard)?);
            central.connected(self.clock.now(), which);
        }
        options.progress.set_length(parts.unwrap_or_default());
        let mut stands_since = (Step::AwaitDevices, Duration::ZERO);
        while central.step() != Step::Finished {
            let now = self.clock.now();
            {
                let mut cell = lock(&self.cell);
                cell.advance(now.cell);
                central.run(now, &cell);
            }
            for connection in &mut connections {
                connection.write(&central.say(now, connection.which));
            }
            if options.seconds.is_some_and(|end| now.wall >= end) {
                central.finish();
            }
            for connection in &mut connections {
                if central.is_broken(connection.which) {
                    *connection = connection.open_again(&heard)?;
                    central.log.reconnections += 1;
                    central.connected(self.clock.now(), connection.which);
                }
            }
            if stands_since.0 != central.step() {
                stands_since = (central.step(), now.wall);
                options.progress.set_position(central.log.placed);
            } else if now.wall - stands_since.1 > STANDSTILL {
                bail!("the cell stands still in step {:?}: please report this as a bug", stands_since.0);
            }
            self.listen(now, &mut central, &mut connections, &inbox)?;
        }
        drop(connections);
        let cell = core::mem::replace(&mut *lock(&self.cell), Cell::new(0, false));
        Ok((central.log, cell))
    }

    /// Waits for something to be heard, or for the time at which something is due.
    fn listen(
        &self,
        now: Now,
        central: &mut Central,
        connections: &mut [Connection],
        inbox: &Receiver<Heard>,
    ) -> Result<()> {
        let (wall, cell) = central.due();
        let cell = cell.map(|at| at.saturating_sub(now.cell) / self.clock.speed);
        let wall = wall.map(|at| at.saturating_sub(now.wall));
        // The vacuum switch is looked at at least this often.
        let wait = [Some(Duration::from_millis(1)), cell, wall].into_iter().flatten().min();
        let first = match inbox.recv_timeout(wait.unwrap_or_default()) {
            Ok(first) => first,
            Err(RecvTimeoutError::Timeout) => return Ok(()),
            Err(RecvTimeoutError::Disconnected) => bail!("every connection is gone"),
        };
        let now = self.clock.now();
        for heard in core::iter::once(first).chain(inbox.try_iter()) {
            let current = connections.iter().any(|c| c.which == heard.which && c.number == heard.number);
            match heard.bytes {
                _ if !current => {} // from a connection that has been given up
                Some(bytes) => central.hear(now, heard.which, &bytes),
                None => central.disconnected(heard.which),
            }
        }
        Ok(())
    }
}

/// What a reading thread has to say: bytes, or the end.
struct Heard {
    which: Which,
    number: u64,
    bytes: Option<Vec<u8>>,
}

/// The central controller's end of one connection, with a thread that reads.
struct Connection {
    which: Which,
    address: SocketAddr,
    number: u64,
    stream: TcpStream,
}

impl Connection {
    fn open(which: Which, address: SocketAddr, number: u64, heard: &Sender<Heard>) -> Result<Self> {
        let stream = tcp::connect(&address.to_string()).with_context(|| format!("the {which:?} is gone"))?;
        let mut reader = stream.try_clone()?;
        let heard = heard.clone();
        thread::spawn(move || {
            let mut buffer = [0; 256];
            loop {
                let bytes = match reader.read(&mut buffer) {
                    Ok(0) | Err(_) => None,
                    Ok(len) => buffer.get(..len).map(<[u8]>::to_vec),
                };
                let end = bytes.is_none();
                if heard.send(Heard { which, number, bytes }).is_err() || end {
                    return;
                }
            }
        });
        Ok(Self { which, address, number, stream })
    }

    fn open_again(&self, heard: &Sender<Heard>) -> Result<Self> {
        let _ = self.stream.shutdown(Shutdown::Both);
        Self::open(self.which, self.address, self.number + 1, heard)
    }

    /// What cannot be written is lost with the connection, which the reader tells.
    fn write(&mut self, bytes: &[u8]) {
        if !bytes.is_empty() && self.stream.write_all(bytes).is_err() {
            let _ = self.stream.shutdown(Shutdown::Both);
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

/// A device behind its port, one controller at a time, for as long as the process runs.
fn serve(listener: &TcpListener, which: Which, cell: &Mutex<Cell>, clock: Clock, trace: &Trace) {
    for mut stream in listener.incoming().flatten() {
        let _ = stream.set_nodelay(true);
        lock(cell).connect(which);
        let mut buffer = [0; 256];
        while let Ok(len @ 1..) = stream.read(&mut buffer) {
            let bytes = buffer.get(..len).unwrap_or_default();
            trace.add(clock.now().wall, Way::Received, bytes);
            let (reply, closes) = lock(cell).hear(which, clock.now().cell, bytes);
            trace.add(clock.now().wall, Way::Sent, &reply);
            if stream.write_all(&reply).is_err() || closes {
                break;
            }
        }
        trace.end_session("the connection ended");
    }
}

fn lock(cell: &Mutex<Cell>) -> MutexGuard<'_, Cell> {
    cell.lock().unwrap_or_else(PoisonError::into_inner)
}

fn report(log: &super::central::Log, cell: &Cell, faults: bool, speed: u32) -> Report {
    let record = &cell.parts().record;
    let tries = attempts(log.steps.iter().map(|(_, step)| *step));
    let title = format!(
        "pick and place over three TCP connections, robot, platform, and cameras with valves; the axes run {speed} times faster than life"
    );
    let mut report = Report::new("mmacell-proto", title);
    let ended = |wanted: End| tries.iter().filter(|(_, end)| *end == wanted).count();
    report.fact("parts_placed", "parts placed", log.placed);
    report.fact("attempts", "attempts", tries.len());
    report.fact("missed", "parts missed and tried again", record.missed);
    report.fact("fallen", "parts lost in flight and tried again", record.lost);
    report.fact("exchanges", "commands answered", log.exchanges);
    if faults {
        report.fact("faults", "faults that a reset led out of", log.faults.len());
        report.fact("reconnections", "connections opened again", log.reconnections);
        report.fact("broken_off", "attempts that a fault broke off", ended(End::Fault));
        report.fact("dropped", "parts let go at a fault", record.dropped);
    }
    report.fact("vacuum_left_on", "attempts begun with the vacuum on", log.vacuum_left_on);
    let after_loss = u64::try_from(record.vacuum_after_fall.as_millis()).unwrap_or(u64::MAX);
    report.fact("vacuum_after_loss_ms", "longest vacuum after a loss, ms of the cell's time", after_loss);
    report.jobs(motions(log, cell));
    let open = tries.iter().filter(|(steps, end)| leaves_open(steps, *end)).count() as u64;
    report.require(record.carried_off <= open, || {
        format!("{} parts were not blown off and left their place again", record.carried_off)
    });
    report.require((log.placed..=log.placed + open).contains(&record.placed), || {
        format!("{} parts are in their place, the task believes {}", record.placed, log.placed)
    });
    report.require(log.vacuum_left_on == 0 && !cell.parts().vacuum(), || "the vacuum was left on".into());
    for (number, (steps, end)) in tries.iter().enumerate() {
        report.require(is_in_order(steps, *end), || {
            format!("attempt {}: steps out of order: {steps:?}, ended {end:?}", number + 1)
        });
    }
    report.timing("turn_around", "command to reply", &log.turn_around, None);
    let mut cycles = Samples::default();
    placed_in(log).into_iter().for_each(|time| cycles.add(time));
    report.timing("cycle", "cycle of a part, in the cell's time", &cycles, None);
    for (step, samples) in durations(log) {
        let number = step.number().map_or_else(|| "–".into(), |number| number.to_string());
        let key = format!("step_{}", step.label().replace(' ', "_"));
        report.timing(&key, &format!("  {number:>2} {}", step.label()), &samples, None);
    }
    report
}

/// Motions as jobs: what was agreed to was executed once; what was executed was agreed to, or its reply was lost.
fn motions(log: &super::central::Log, cell: &Cell) -> Jobs {
    let executed = [cell.robot().motions(), cell.platform().motions()];
    let mut jobs = Jobs::default();
    for ((agreed, unknown), executed) in log.agreed.iter().zip(log.unknown).zip(executed) {
        jobs.sent += agreed + unknown;
        jobs.lost += agreed.saturating_sub(executed);
        jobs.repeated += executed.saturating_sub(agreed + unknown);
        jobs.executed_once += executed.min(agreed + unknown);
        jobs.unknown += unknown;
    }
    jobs
}

/// The time that each part took, from step 7 of its first attempt until it was placed.
fn placed_in(log: &super::central::Log) -> Vec<Duration> {
    let mut begun = None;
    let mut times = Vec::new();
    for (at, step) in &log.steps {
        match step {
            Step::GoCamera1 => begun = begun.or(Some(*at)),
            Step::Placed => times.extend(begun.take().map(|begun| *at - begun)),
            _ => {}
        }
    }
    times
}

/// How long each step of the cycle took each time, in the order of the steps.
fn durations(log: &super::central::Log) -> Vec<(Step, Samples)> {
    let cycle = |step: &Step| step.number().is_some_and(|number| number >= 7) || *step == Step::Resetting;
    let mut all: Vec<(Step, Samples)> =
        Step::ALL.into_iter().filter(cycle).map(|step| (step, Samples::default())).collect();
    for pair in log.steps.windows(2) {
        if let [(begin, step), (end, _)] = pair
            && let Some((_, samples)) = all.iter_mut().find(|(known, _)| known == step)
        {
            samples.add(*end - *begin);
        }
    }
    all.retain(|(_, samples)| samples.count() > 0);
    all
}

#[cfg(test)]
mod tests {
    use indicatif::ProgressBar;
    use serde_json::json;

    use super::*;
    use crate::settings;
    use crate::trace::TraceArgs;

    fn options(faults: bool, set: &[&str]) -> DemoOptions {
        DemoOptions {
            seconds: None,
            faults,
            seed: 7,
            out: None,
            drawing: None,
            trace: TraceArgs::off(),
            settings: set.iter().filter_map(|text| settings::parse(text).ok()).collect(),
            progress: ProgressBar::hidden(),
        }
    }

    #[test]
    fn every_part_is_placed_and_the_picture_shows_it() {
        let path = std::env::temp_dir().join(format!("cellwire-timeline-{}.svg", std::process::id()));
        let options = DemoOptions { out: Some(path.clone()), ..options(false, &["parts=12", "speed=400"]) };
        let object = demo(&options).unwrap().to_json();
        assert_eq!((&object["ok"], &object["parts_placed"]), (&json!(true), &json!(12)), "{object}");
        let attempts = 12 + object["missed"].as_u64().unwrap() + object["fallen"].as_u64().unwrap();
        assert_eq!(object["attempts"], attempts);
        assert_eq!(object["cycle"]["count"], 12);
        let picture = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        for word in ["placed", "Vacuum switch", "to place", "time of the cell"] {
            assert!(picture.contains(word), "{word}");
        }
    }

    #[test]
    fn over_connections_that_break_every_part_is_placed_too() {
        let object = demo(&options(true, &["parts=15"])).unwrap().to_json();
        assert_eq!((&object["ok"], &object["parts_placed"]), (&json!(true), &json!(15)), "{object}");
        assert_eq!((&object["lost"], &object["repeated"]), (&json!(0), &json!(0)), "{object}");
    }

    #[test]
    fn a_setting_out_of_range_is_refused() {
        for (set, error) in [
            ("parts=0", "parts=0 leaves nothing to do"),
            ("speed=0", "speed=0 is outside 1 to 10000"),
            ("cycles=5", "mmacell-proto has no setting `cycles`: it has parts, speed"),
        ] {
            assert_eq!(demo(&options(false, &[set])).unwrap_err().to_string(), error);
        }
    }
}
