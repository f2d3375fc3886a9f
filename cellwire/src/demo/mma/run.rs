//! The run: the client of `cellwire run mma`, two simulated devices at their ports, and an operator.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Result, anyhow};
use mmacell_proto::DeviceConfig;
use mmacell_task::{Step, TaskConfig};
use robot_session::now;
use serde_json::Value;

use super::cell::{CONFIG, Cell, lock};
use super::settings::Settings;
use crate::demo::DemoOptions;
use crate::demo::operator::{Operator, reported};
use crate::devices::host::keep;
use crate::io::journal::Tally;
use crate::run::Console;
use crate::run::mma::{self as client, Addresses, Journal, Runner};
use cellwire_io::bell::Bell;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::tcp;
use cellwire_io::trace::Trace;
use cellwire_sim::host::{HostedSession, Listener, Notice, Server};
use cellwire_sim::ledger::Counts;
use cellwire_sim::mma::{Mma, MmaDevice, MotionFaults};
use cellwire_sim::{FaultyProxy, Ledger, Settings as _, Simulator};

/// The probability that a read breaks the connection when faults are wanted.
const BREAKS: f64 = 0.001;
/// With `--faults`: how many motions of the robot until one fails.
const FAIL_EVERY: u64 = 100;
/// With `--faults`: how many motions of the robot until one stalls, unless a setting gives another number.
const STALL_EVERY: u64 = 70;
/// After this many questions about one part the operator stops the run.
const MAX_QUESTIONS: u32 = 30;
/// The longest time until a device stops.
const STOP: Duration = Duration::from_millis(10);

/// A run that has ended.
#[derive(Debug)]
pub(super) struct Run {
    /// The outcomes that the client has noted.
    pub(super) journal: Journal,
    /// The parts as the cell has them.
    pub(super) cell: Cell,
    /// Each step and the time of its beginning, in cell time.
    pub(super) steps: Vec<(Duration, Step)>,
    /// The number of steps 7 that began with the vacuum on.
    pub(super) vacuum_left_on: u64,
    /// The number of connections that were opened again.
    pub(super) reconnections: u64,
}

impl Run {
    /// Runs the client in the simulated cell.
    pub(super) fn new(settings: &Settings, options: &DemoOptions) -> Result<Self> {
        let Settings { parts, speed, stall_every, task, central } = *settings;
        let mut faults = MotionFaults { stall_every, ..MotionFaults::default() };
        if options.faults {
            faults.fail_every = FAIL_EVERY;
            faults.stall_every = if stall_every > 0 { stall_every } else { STALL_EVERY };
        }
        // The devices use the dialects that the client is set to read and to write.
        let config =
            DeviceConfig { accepts: central.writes, writes: central.accepts, ..DeviceConfig::DEFAULT };
        let robot = Mma { config, speed, faults, home: CONFIG.robot_home, ..Mma::default() };
        let robot = robot.simulator()?.keeping_nothing();
        let platform = Mma { config, speed, home: CONFIG.platform_home, ..Mma::default() };
        let platform = platform.simulator()?.keeping_nothing();
        let ports = [Port::open("robot", 0, options)?, Port::open("platform", 1, options)?];
        let [robot_address, platform_address] = ports.each_ref().map(|port| port.address.clone());
        let (dialing, tls) = (tcp::Dialing::default(), None);
        let addresses = Addresses { robot: robot_address, platform: platform_address, dialing, tls };
        // The client has the clock on the wall; the times of the cell pass faster.
        let task = TaskConfig {
            poll: task.poll / speed,
            grip_dwell: task.grip_dwell / speed,
            place_dwell: task.place_dwell / speed,
            blow: task.blow / speed,
            ..task
        };
        let client = client::Settings { task, central, ..client::Settings::default() };
        let mut journal = Journal::unwritten(parts);
        let cell = Mutex::new(Cell::new(speed, options.seed));
        let (mut operator, typed) = Operator::new();
        options.seconds.into_iter().for_each(|seconds| operator.stop_at(now() + seconds));
        let mut watch = Watch { cell: &cell, operator, questions: 0, steps: Vec::new(), vacuum_left_on: 0 };
        let (goes_on, connections) = (AtomicBool::new(true), AtomicU64::new(0));
        let ran = thread::scope(|scope| {
            let (goes_on, connections, cell) = (&goes_on, &connections, &cell);
            let [robot_port, platform_port] = ports;
            let look = |robot: &Simulator<_>| lock(cell).move_to(MmaDevice::pose(robot.device()));
            let devices = [
                scope.spawn(move || robot_port.serve(robot, goes_on, connections, look)),
                scope.spawn(move || platform_port.serve(platform, goes_on, connections, |_| ())),
            ];
            let notify = &mut |event| watch.take(&event);
            let progress = &mut |tally: Tally| options.progress.set_position(tally.done as u64);
            let console = Console::new(typed, notify, progress);
            let mut runner = Runner::new(&mut journal, console, Bell::default());
            let ran = runner.run(&client, &addresses, &mut &*cell);
            // Each device leaves its trace, however long that takes to write.
            goes_on.store(false, Ordering::Relaxed);
            for device in devices {
                device.join().map_err(|_| anyhow!("a simulated device panicked"))??;
            }
            ran
        });
        // Parts that a lost connection has left are in the journal.
        if let Some(error) = ran.err().filter(|error| !error.is::<ConnectionLost>()) {
            return Err(error);
        }
        let Watch { steps, vacuum_left_on, .. } = watch;
        let reconnections = connections.into_inner().saturating_sub(2);
        let cell = cell.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Self { journal, cell, steps, vacuum_left_on, reconnections })
    }

    /// Counts the parts as jobs: those that the client has begun, beside those that are in their place.
    pub(super) fn count(&self, options: &DemoOptions) -> Counts {
        let mut ledger = Ledger::default();
        let begun = self.cell.part.map_or(0, |part| part + 1);
        for outcome in self.journal.outcomes().iter().take(begun) {
            let job = ledger.send(());
            ledger.report(job, reported(*outcome));
        }
        let mut placed = self.cell.placed.clone();
        options.spoil(&mut placed, |_| true);
        for part in placed {
            ledger.execute(part);
        }
        ledger.count()
    }

    /// Returns how often the task has entered a step.
    pub(super) fn entered(&self, step: Step) -> usize {
        self.steps.iter().filter(|(_, entered)| *entered == step).count()
    }
}

/// A device's port.
struct Port {
    listener: Listener,
    /// The address at which the client reaches it.
    address: String,
    trace: Trace,
    _proxy: Option<FaultyProxy>,
}

impl Port {
    fn open(name: &str, number: u64, options: &DemoOptions) -> Result<Self> {
        let listener = tcp::listen("127.0.0.1:0")?;
        let address = listener.local_addr()?;
        let seed = options.seed + number;
        let proxy = options.faults.then(|| FaultyProxy::start(address, seed, BREAKS)).transpose()?;
        let address = proxy.as_ref().map_or(address, FaultyProxy::address).to_string();
        let trace = options.trace.start(&format!("mma-{name}"));
        Ok(Self { listener: Listener::new(listener)?, address, trace, _proxy: proxy })
    }

    /// Serves a device while `goes_on`, and counts its connections; `look` is called before each of its messages.
    fn serve<S: HostedSession>(
        self,
        device: S,
        goes_on: &AtomicBool,
        connections: &AtomicU64,
        look: impl Fn(&S),
    ) -> Result<()> {
        let Self { listener, trace, _proxy, .. } = self;
        let server = Server { look: Some(STOP), ..Server::new(listener, now) };
        server.run(
            device,
            || goes_on.load(Ordering::Relaxed),
            |device, notice| {
                look(device);
                match notice {
                    Notice::Connected(_) => _ = connections.fetch_add(1, Ordering::Relaxed),
                    Notice::Disconnected(..) => trace.end_session("the connection ended"),
                    notice => keep(&trace, &notice),
                }
                Ok(())
            },
        )
    }
}

/// The operator's view of the run: its steps, and the cell.
struct Watch<'a> {
    cell: &'a Mutex<Cell>,
    operator: Operator,
    /// The number of questions about the current part.
    questions: u32,
    steps: Vec<(Duration, Step)>,
    vacuum_left_on: u64,
}

impl Watch<'_> {
    /// Takes an event of the client.
    fn take(&mut self, event: &Value) -> Result<()> {
        let named = |step: &Step| serde_json::to_value(step).is_ok_and(|name| name == event["step"]);
        let Some(step) = Step::ALL.into_iter().find(named) else { return Ok(()) };
        let cell = lock(self.cell);
        self.steps.push((cell.now(), step));
        match step {
            Step::GoCamera1 => self.vacuum_left_on += u64::from(cell.parts.vacuum()),
            Step::Placed => self.questions = 0,
            // The client asks next.
            Step::Unpicked | Step::Faulted => {
                self.questions += 1;
                let is_placed = cell.placed.last().is_some_and(|last| event["part"] == last + 1);
                self.operator.say(match is_placed {
                    _ if self.questions > MAX_QUESTIONS => "stop",
                    true => "done",
                    false => "repeat",
                })?;
            }
            _ => {}
        }
        Ok(())
    }
}
