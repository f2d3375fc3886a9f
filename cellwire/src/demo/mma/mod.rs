//! `cellwire demo mma`: the pick-and-place task over three TCP connections into a simulated cell.

pub mod cell;
pub mod central;
pub mod figures;
pub mod motions;
mod periphery;
mod ported;
mod settings;
pub mod timeline;
pub mod verdict;
pub mod workpiece;

pub use settings::Settings;

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use mmacell_proto::{CentralConfig, DeviceConfig};
use mmacell_task::{Step, TaskConfig};

use self::cell::{Cell, CellConnection};
use self::central::{Central, Log, RunTimes};
use self::figures::RunFigures;
use self::motions::Span;
use self::ported::PortedDevice;
use crate::demo::{DemoOptions, MustFail};
use crate::devices::device::keep;
use crate::report::{Report, were};
use cellwire_io::output::counted;
use cellwire_io::tcp;
use cellwire_sim::FaultyProxy;
use cellwire_sim::host::{Listener, Notice, Server};
use cellwire_sim::ledger::Counts;
use cellwire_sim::mma::MotionFaults;

/// The probability that a read breaks the connection when faults are wanted.
const BREAKS: f64 = 0.001;
/// Longer than this the task is in no step, even when every connection must be opened again.
const STANDSTILL: Duration = Duration::from_secs(20);

/// The longest time until a device stops.
const STOP: Duration = Duration::from_millis(10);
/// The most attempts that are reported in words.
const MAX_FAILURES: usize = 20;

/// Runs the demo.
///
/// # Errors
/// If no port is free, a setting is not one of this demo's, the picture cannot be written, or the cell stalls.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let Settings { parts, speed, stall_every, task, central } =
        cellwire_links::settings::read("mma", Settings::default(), &options.settings)?;
    // A time limit counts, not a number of parts, unless both are given.
    let until_limit = options.seconds.is_some() && !options.settings.contains_key("parts");
    let stalls = MotionFaults { stall_every, ..MotionFaults::default() };
    // The devices use the dialects that the central controller is set to read and to write.
    let device = DeviceConfig { accepts: central.writes, writes: central.accepts, ..DeviceConfig::DEFAULT };
    let run = Run::start(options, speed, stalls, device)?;
    let (log, cell) = run.place((!until_limit).then_some(parts), task, central, options)?;
    let judged = RunFigures::of(&log, &cell.parts().record);
    if let Some(path) = &options.out {
        timeline::draw(path, &log, &cell.parts().record)?;
    }
    let motions = motions(&log, &cell, options);
    let mut report = report(&log, &cell, &judged, options, (stalls.stall_every > 0, speed), motions);
    report.require(until_limit || options.seconds.is_some() || log.placed == parts, || {
        format!("{} of {} placed", log.placed, were(parts, "part"))
    });
    if let Some(path) = &options.out {
        report.fact("timeline", "timeline", path.display().to_string());
    }
    Ok(report)
}

/// The simulated cell and its three ports.
struct Run {
    cell: Arc<Mutex<Cell>>,
    clock: Clock,
    addresses: [SocketAddr; 3],
    goes_on: Arc<AtomicBool>,
    devices: Vec<JoinHandle<Result<()>>>,
    _proxies: Vec<FaultyProxy>,
}

/// One clock for the protocol and one, faster, for the axes.
#[derive(Debug, Clone, Copy)]
struct Clock {
    epoch: Instant,
    speed: u32,
}

impl Clock {
    fn now(&self) -> RunTimes {
        let wall = self.epoch.elapsed();
        RunTimes { wall, cell: wall * self.speed }
    }
}

impl Run {
    fn start(options: &DemoOptions, speed: u32, stalls: MotionFaults, device: DeviceConfig) -> Result<Self> {
        let cell = Arc::new(Mutex::new(Cell::new(options.seed, options.faults, stalls, device)?));
        let clock = Clock { epoch: Instant::now(), speed };
        let mut addresses = Vec::new();
        let mut proxies = Vec::new();
        let mut devices = Vec::new();
        let goes_on = Arc::new(AtomicBool::new(true));
        for which in CellConnection::ALL {
            let listener = tcp::listen("127.0.0.1:0")?;
            let mut address = listener.local_addr()?;
            let listener = Listener::new(listener)?;
            let trace = options.trace.start(&format!("mma-{}", format!("{which:?}").to_lowercase()));
            let (device, goes_on) = (PortedDevice::new(which, &cell, speed), Arc::clone(&goes_on));
            devices.push(thread::spawn(move || {
                let (clock, look) = (|| clock.now().wall, Some(STOP));
                let server = Server { look, ..Server::new(listener, clock) };
                server.run(
                    device,
                    || goes_on.load(Ordering::Relaxed),
                    |_, notice| {
                        match notice {
                            Notice::Disconnected(..) => trace.end_session("the connection ended"),
                            notice => keep(&trace, &notice),
                        }
                        Ok(())
                    },
                )
            }));
            if options.faults {
                let proxy = FaultyProxy::start(address, options.seed + which as u64, BREAKS)?;
                address = proxy.address();
                proxies.push(proxy);
            }
            addresses.push(address);
        }
        let addresses =
            <[SocketAddr; 3]>::try_from(addresses).map_err(|_| anyhow::anyhow!("three devices"))?;
        Ok(Self { cell, clock, addresses, goes_on, devices, _proxies: proxies })
    }

    /// Places this many parts, or as many as fit into the time; returns the record.
    fn place(
        self,
        parts: Option<u64>,
        task: TaskConfig,
        central: CentralConfig,
        options: &DemoOptions,
    ) -> Result<(Log, Cell)> {
        let (sender, inbox) = channel();
        let mut central = Central::new(parts, self.clock.speed, task, central)?;
        let mut connections = Vec::new();
        for (which, address) in CellConnection::ALL.into_iter().zip(self.addresses) {
            connections.push(Connection::open(which, address, 0, &sender)?);
            central.connected(self.clock.now(), which);
        }
        if let Some(parts) = parts {
            options.progress.set_length(parts);
        }
        let mut stands_since = (Step::AwaitDevices, Duration::ZERO);
        let mut placed_last = (0, Duration::ZERO);
        while central.step() != Step::Finished {
            let now = self.clock.now();
            {
                let mut cell = lock(&self.cell);
                cell.advance(now.cell);
                central.run(now, &cell);
            }
            for connection in &mut connections {
                connection.write(&central.transmit(connection.which));
            }
            if options.seconds.is_some_and(|end| now.wall >= end) {
                central.finish();
            }
            for connection in &mut connections {
                if central.is_broken(connection.which) {
                    *connection = connection.open_again(&sender)?;
                    central.log.reconnections += 1;
                    central.connected(self.clock.now(), connection.which);
                }
            }
            if stands_since.0 != central.step() {
                stands_since = (central.step(), now.wall);
                options.progress.set_position(central.log.placed);
            } else if now.wall - stands_since.1 > STANDSTILL {
                bail!("the cell stalled in step {:?}: please report this as a bug", stands_since.0);
            }
            if placed_last.0 != central.log.placed {
                placed_last = (central.log.placed, now.wall);
            } else if now.wall - placed_last.1 > 3 * STANDSTILL {
                bail!(
                    "no part was placed in {} s, the step is {:?}",
                    3 * STANDSTILL.as_secs(),
                    central.step()
                );
            }
            Self::wait(self.clock, &mut central, &mut connections, &inbox)?;
        }
        drop(connections);
        // Each device leaves its trace when its last connection has ended, however long that takes to write.
        self.goes_on.store(false, Ordering::Relaxed);
        for device in self.devices {
            let _ = device.join();
        }
        let rest = Cell::new(0, false, MotionFaults::default(), DeviceConfig::DEFAULT)?;
        let cell = core::mem::replace(&mut *lock(&self.cell), rest);
        Ok((central.log, cell))
    }

    /// Waits until something arrives, or until the time at which something is due.
    fn wait(
        clock: Clock,
        central: &mut Central,
        connections: &mut [Connection],
        inbox: &Receiver<Arrival>,
    ) -> Result<()> {
        let (now, (wall, cell)) = (clock.now(), central.due());
        let cell = cell.map(|at| at.saturating_sub(now.cell) / clock.speed);
        let wall = wall.map(|at| at.saturating_sub(now.wall));
        // The vacuum switch is looked at at least this often.
        let wait = [Some(Duration::from_millis(1)), cell, wall].into_iter().flatten().min();
        let first = match inbox.recv_timeout(wait.unwrap_or_default()) {
            Ok(first) => first,
            Err(RecvTimeoutError::Timeout) => return Ok(()),
            Err(RecvTimeoutError::Disconnected) => bail!("every connection is gone"),
        };
        let now = clock.now();
        for arrival in core::iter::once(first).chain(inbox.try_iter()) {
            let current = connections.iter().any(|c| c.which == arrival.which && c.number == arrival.number);
            match arrival.bytes {
                _ if !current => {} // from a connection that has been given up
                Some(bytes) => central.receive(now, arrival.which, &bytes),
                None => central.disconnected(now, arrival.which),
            }
        }
        Ok(())
    }
}

/// The bytes that a reading thread received, or the end.
struct Arrival {
    which: CellConnection,
    number: u64,
    bytes: Option<Vec<u8>>,
}

/// The central controller's end of one connection, with a thread that reads.
struct Connection {
    which: CellConnection,
    address: SocketAddr,
    number: u64,
    stream: TcpStream,
}

impl Connection {
    fn open(
        which: CellConnection,
        address: SocketAddr,
        number: u64,
        sender: &Sender<Arrival>,
    ) -> Result<Self> {
        let stream = tcp::connect(&address.to_string(), tcp::Dialing::default())
            .with_context(|| format!("the {which:?} is gone"))?;
        let mut reader = stream.try_clone()?;
        let sender = sender.clone();
        thread::spawn(move || {
            let mut buffer = [0; 256];
            loop {
                let bytes = match reader.read(&mut buffer) {
                    Ok(0) | Err(_) => None,
                    Ok(len) => buffer.get(..len).map(<[u8]>::to_vec),
                };
                let end = bytes.is_none();
                if sender.send(Arrival { which, number, bytes }).is_err() || end {
                    return;
                }
            }
        });
        Ok(Self { which, address, number, stream })
    }

    fn open_again(&self, sender: &Sender<Arrival>) -> Result<Self> {
        let _ = self.stream.shutdown(Shutdown::Both);
        Self::open(self.which, self.address, self.number + 1, sender)
    }

    /// Writes bytes. If that fails, closes the connection, which the reader reports.
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

fn lock(cell: &Mutex<Cell>) -> MutexGuard<'_, Cell> {
    cell.lock().unwrap_or_else(PoisonError::into_inner)
}

fn report(
    log: &Log,
    cell: &Cell,
    judged: &RunFigures,
    options: &DemoOptions,
    (stalls, speed): (bool, u32),
    motions: Counts,
) -> Report {
    let record = &cell.parts().record;
    let title = format!(
        "pick and place over three TCP connections: robot, platform, and cameras with valves; axes at {speed} times real speed"
    );
    let mut report = Report::new("mma", title).moves("a cell places parts");
    report.fact("parts_placed", "parts placed", log.placed);
    report.fact("attempts", "attempts", judged.attempts);
    report.fact("missed", "parts missed and retried", record.missed);
    report.fact("fallen", "parts lost in flight and retried", record.lost);
    let elsewhere = judged.let_go_elsewhere;
    report.fact("let_go_in_place", "parts released in the right place", record.placed);
    report.fact("let_go_elsewhere", "parts released elsewhere", elsewhere);
    report.fact("unpicked", "parts given up after the maximum of attempts", log.unpicked);
    report.fact("exchanges", "commands answered", log.exchanges);
    if options.faults || stalls {
        report.fact("faults", "faults cleared by a reset", log.faults);
        report.fact("reconnections", "connections reopened", log.reconnections);
        report.fact("broken_off", "attempts aborted by a fault", judged.broken_off);
        report.fact("dropped", "parts released at a fault", record.dropped);
    }
    report.fact("vacuum_left_on", "attempts started with the vacuum on", log.vacuum_left_on);
    let after_loss = u64::try_from(record.vacuum_after_fall.as_millis()).unwrap_or(u64::MAX);
    report.fact("vacuum_after_loss_ms", "longest vacuum after a loss, ms of cell time", after_loss);
    report.jobs(motions, 0);
    let open = judged.open;
    report.require(record.carried_off <= open, || {
        format!("{} not blown off, and left the place again", were(record.carried_off, "part"))
    });
    report.require((log.placed..=log.placed + open).contains(&record.placed), || {
        format!("{} put in place, but the task counts {}", were(record.placed, "part"), log.placed)
    });
    report.require(elsewhere == 0, || format!("{} released in the wrong place", were(elsewhere, "part")));
    report.require(log.vacuum_left_on == 0 && !cell.parts().vacuum(), || "the vacuum was left on".into());
    let (first, others) = judged.failures.split_at(judged.failures.len().min(MAX_FAILURES));
    first.iter().for_each(|failure| report.require(false, || failure.clone()));
    report.require(others.is_empty(), || {
        format!("{} more with steps out of order", counted(others.len(), "attempt"))
    });
    report.timing("turn_around", "command to reply", &log.turn_around, None);
    report.timing("cycle", "cycle of a part, in cell time", &judged.cycles, None);
    let of = |step| judged.steps.iter().find(|(known, _)| *known == step);
    for (step, samples) in Step::ALL.into_iter().filter_map(of) {
        let number = step.number().map_or_else(|| "–".into(), |number| number.to_string());
        let key = format!("step_{}", step.label().replace(' ', "_"));
        report.timing(&key, &format!("  {number:>2} {}", step.label()), samples, None);
    }
    report
}

/// Counts motions as jobs: an accepted motion was executed once; an executed motion was accepted, or its reply was lost.
fn motions(log: &Log, cell: &Cell, options: &DemoOptions) -> Counts {
    let [robot, platform] = &log.motions;
    let mut robot = robot.spans(cell.robot().motions());
    let middle = robot.len() / 2;
    let certain = robot.iter_mut().enumerate().filter(|(_, span)| span.is_certain());
    if let Some((_, span)) = certain.min_by_key(|(place, _)| place.abs_diff(middle)) {
        match options.must_fail {
            Some(MustFail::Lost) => *span = span.without_one(),
            Some(MustFail::Repeated) => *span = span.with_one_more(),
            _ => {}
        }
    }
    let platform = platform.spans(cell.platform().motions());
    robot.iter().chain(&platform).map(Span::count).fold(Counts::default(), |all, counts| all + counts)
}

#[cfg(test)]
mod tests {
    use indicatif::ProgressBar;
    use serde_json::json;

    use super::*;
    use crate::io::line::Lines;
    use cellwire_io::trace::TraceArgs;

    fn options(faults: bool, set: &[&str]) -> DemoOptions {
        DemoOptions {
            seconds: None,
            faults,
            seed: 7,
            out: None,
            must_fail: None,
            drawing: None,
            trace: TraceArgs::off(),
            settings: set.iter().filter_map(|text| cellwire_links::settings::parse(text).ok()).collect(),
            lines: Lines::HERE,
            progress: ProgressBar::hidden(),
        }
    }

    #[test]
    fn every_part_is_placed_and_the_picture_shows_it() {
        let path = std::env::temp_dir().join(format!("cellwire-timeline-{}.svg", std::process::id()));
        let options = DemoOptions { out: Some(path.clone()), ..options(false, &["parts=12", "speed=100"]) };
        let report = demo(&options).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        assert_eq!((is_good, &object["parts_placed"]), (true, &json!(12)), "{object}");
        let attempts = 12 + object["missed"].as_u64().unwrap() + object["fallen"].as_u64().unwrap();
        assert_eq!(object["attempts"], attempts);
        assert_eq!(object["cycle"]["count"], 12);
        let picture = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        for word in ["placed", "Vacuum switch", "to place", "cell time"] {
            assert!(picture.contains(word), "{word}");
        }
    }

    #[test]
    fn over_connections_that_break_every_part_is_placed_too() {
        let report = demo(&options(true, &["parts=15"])).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        assert_eq!((is_good, &object["parts_placed"]), (true, &json!(15)), "{object}");
        assert_eq!((&object["lost"], &object["repeated"]), (&json!(0), &json!(0)), "{object}");
    }

    /// A robot that is at rest half-way, without an error, has not arrived: nothing is let go there.
    #[test]
    fn a_robot_that_stalls_lets_nothing_go_in_the_wrong_place() {
        let report = demo(&options(false, &["parts=10", "stall_every=7"])).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        assert_eq!((is_good, &object["parts_placed"]), (true, &json!(10)), "{object}");
        assert_eq!(
            (&object["let_go_in_place"], &object["let_go_elsewhere"]),
            (&json!(10), &json!(0)),
            "{object}"
        );
        assert!(object["faults"].as_u64().unwrap() > 0, "{object}");
    }

    #[test]
    fn a_part_that_is_let_go_in_the_wrong_place_fails_the_demo() {
        let mut cell = Cell::new(1, false, MotionFaults::default(), DeviceConfig::DEFAULT).unwrap();
        let at = Duration::from_secs;
        cell.drop_part(at(3));
        let steps = vec![(at(1), Step::AwaitPlace), (at(2), Step::Release), (at(4), Step::Blow)];
        let log = Log { steps, ..Log::default() };
        let mut faulted = Log { steps: log.steps.clone(), ..Log::default() };
        let judged = RunFigures::of(&log, &cell.parts().record);
        let report = report(&log, &cell, &judged, &options(false, &[]), (false, 1), Counts::default());
        assert!(!report.is_good());
        assert_eq!(report.to_json()["let_go_elsewhere"], 1);
        faulted.steps.insert(2, (at(2), Step::Faulted));
        let judged = RunFigures::of(&faulted, &cell.parts().record);
        assert_eq!(judged.let_go_elsewhere, 0, "a fault closes the valves");
    }

    /// Long traces, too, are whole when the demo ends.
    #[test]
    fn each_device_leaves_its_whole_trace() {
        let dir = std::env::temp_dir().join(format!("cellwire-mma-trace-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let options =
            DemoOptions { trace: TraceArgs::keep(10_000_000, &dir), ..options(false, &["parts=20"]) };
        demo(&options).unwrap();
        for which in ["robot", "platform", "periphery"] {
            let text = std::fs::read_to_string(dir.join(format!("mma-{which}.trace"))).unwrap();
            let last = text.lines().last().unwrap();
            assert!(last.starts_with("4F 4B 0D 0A # "), "{which}: {last}");
            let before = text.lines().rev().nth(1).unwrap();
            assert!(before.starts_with("43 4C 4F 0D 0A # "), "{which}: {before}");
        }
        std::fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn a_setting_out_of_range_is_refused() {
        for (set, error) in [
            ("parts=0", "parts=0: out of range, give 1 to 10000 parts"),
            ("speed=0", "speed=0: out of range, give 1 to 10000 times"),
        ] {
            assert_eq!(demo(&options(false, &[set])).unwrap_err().to_string(), error);
        }
        let error = demo(&options(false, &["cycles=5"])).unwrap_err().to_string();
        assert!(error.starts_with("mma has no setting `cycles`: it has parts, speed"), "{error}");
    }
}
