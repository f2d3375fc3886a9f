//! A controller with the AS program in it, on the test's clock.

use core::task::Poll;
use core::time::Duration;
use std::collections::VecDeque;

use as_interpreter::{Host, Machine, Motion, Pose, Program, Socket, Step, controller};
use kawasaki_msg::robot_session::Session;
use kawasaki_msg::{
    Acks, Bounds, DecodeError, Job, JobKind, Line, MessageError, Phase, Point, RecoveryStep, RobotConfig,
    RobotEvent, RobotStatistics, SessionError,
};

use super::Controller;
use robot_session::contract::Rng;

/// The number of the one socket.
const SOCKET: i32 = 7;
/// The number of statements at one time that count as a loop without a wait.
const ENDLESS: u64 = 20_000_000;
/// Tasks of the controller.
const COMMUNICATION: usize = 0;
const MOTION: usize = 1;

/// A controller with the AS program in it. The tasks take turns at random; strings are received in pieces of any length.
#[derive(Debug)]
pub struct AsRobot {
    machine: Machine,
    port: Port,
    rng: Rng,
    statistics: RobotStatistics,
    has_motion: bool,
}

impl AsRobot {
    /// Creates a controller whose program differs from the project's: `from` is replaced by `to` in its source, once.
    pub fn altered(
        bounds: Bounds,
        config: RobotConfig,
        capacity: usize,
        seed: u64,
        (from, to): (&str, &str),
    ) -> Self {
        let source = source(&bounds, &config, capacity);
        let (before, after) = source.split_once(from).unwrap_or_else(|| panic!("there is no {from}"));
        assert!(!after.contains(from), "{from} is there twice");
        Self::load(&format!("{before}{to}{after}"), seed)
    }

    fn load(source: &str, seed: u64) -> Self {
        let mut machine = Machine::new(Program::parse(source).unwrap());
        assert!(machine.set_pose("cw.board", [400.0, -200.0, 30.0, 0.0, 0.0, 0.0]));
        assert_eq!(machine.start("cw.comm.pc"), Ok(COMMUNICATION));
        assert_eq!(machine.start("cw.motion"), Ok(MOTION));
        let port = Port { pieces: Rng::new(!seed), ..Port::default() };
        Self {
            machine,
            port,
            rng: Rng::new(seed ^ 0x4153),
            statistics: RobotStatistics::default(),
            has_motion: true,
        }
    }

    /// Stops the motion task: its program is not executed any more.
    pub fn stop_motion(&mut self) {
        self.has_motion = false;
    }

    /// Restarts the motion task's program, as after a stop.
    pub fn restart_motion(&mut self) {
        self.machine.restart(MOTION);
        self.has_motion = true;
    }

    /// Returns the interpreter, to read variables.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Returns the printed lines.
    pub fn printed(&self) -> &[String] {
        &self.port.printed
    }

    /// Returns a variable of the program, 0 before it has a value.
    pub fn real(&self, name: &str) -> f32 {
        self.machine.real(name).unwrap_or(0.0)
    }

    /// Statements are executed until all tasks wait.
    fn run(&mut self, now: Duration) {
        self.port.now = now;
        let mut statements = 0;
        let tasks = if self.has_motion { self.machine.tasks() } else { MOTION };
        // The number of tasks in a row that have waited.
        let (mut waiting, mut task) = (0, self.rng.below(tasks));
        while waiting < tasks {
            // A few statements of one task, or many.
            let most = 1 << self.rng.below(6);
            let burst = 1 + self.rng.below(most);
            for _ in 0..burst {
                match self.machine.step(task, &mut self.port) {
                    Ok(Step::Done) => (waiting, statements) = (0, statements + 1),
                    Ok(Step::Waits | Step::Ended) => {
                        waiting += 1;
                        break;
                    }
                    Err(fault) => panic!("{fault}; {:?}", self.port.printed),
                }
            }
            task = (task + 1) % tasks;
            let calls = |task| self.machine.calls(task).collect::<Vec<_>>();
            assert!(statements < ENDLESS, "an endless loop: {:?}", (0..tasks).map(calls).collect::<Vec<_>>());
        }
        assert_eq!(self.machine.truncations(), 0, "a string of more than 255 bytes");
    }

    /// Returns the index of the job that the motion task is executing.
    fn place(&self) -> Option<usize> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place of the queue")]
        let place = self.machine.real("x.rd")? as usize;
        (self.machine.element("x.ok", place) == Some(2.0)).then_some(place)
    }

    fn request(&mut self, signal: &str, stages: &[f32]) -> Result<(), SessionError> {
        if !stages.contains(&self.real("x.stage")) {
            return Err(SessionError::NoOrder);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a signal's number")]
        let number = self.real(signal) as usize;
        self.machine.set_signal(number, true);
        self.run(self.port.now);
        Ok(())
    }
}

impl Controller for AsRobot {
    const WHOLE: bool = false;

    fn within(bounds: Bounds, config: RobotConfig, capacity: usize, seed: u64) -> Self {
        Self::load(&source(&bounds, &config, capacity), seed)
    }

    fn execute(&mut self, now: Duration, overtakes: bool) -> Option<Job<Line>> {
        assert!(!overtakes, "the program takes its jobs in their order");
        let Some(place) = self.place() else {
            // A job that is queued now is executed at the next call: its order is reported first.
            self.run(now);
            return None;
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 9999")]
        let number = self.machine.element("j.number", place)? as u16;
        self.port.may_arrive = true;
        self.run(now);
        assert!(!self.port.may_arrive, "the arm is on its way");
        let path = core::mem::take(&mut self.port.drawn);
        self.statistics.executed += 1;
        self.port.executed += 1;
        let [.., start, end] = path.as_slice() else { panic!("no line: {path:?}") };
        Some(Job { order: whole(self.real("x.order")), number, work: line(start.to, end.to) })
    }

    fn report(&mut self, _: Duration) {}

    fn has_jobs(&self) -> bool {
        (1..10_000)
            .map_while(|place| self.machine.element("x.ok", place))
            .any(|state| state == 1.0 || state == 2.0)
    }

    fn clear_queue(&mut self) -> Result<(), SessionError> {
        self.request("cw.s.clear", &[1.0, 5.0])
    }

    fn reset_order(&mut self) -> Result<(), SessionError> {
        self.request("cw.s.reset", &[1.0, 2.0, 3.0, 5.0])
    }

    fn phase(&self) -> Phase {
        // As the status has it: a list that is being cleared is not a phase.
        match whole(self.real("x.stage")) {
            0 => Phase::Idle,
            1 | 2 => Phase::Active,
            3 => Phase::Ending,
            4 => Phase::Interrupted,
            _ => Phase::Alarm,
        }
    }

    /// Returns the number of queued jobs, in an order with at most as many jobs as there are numbers.
    fn queued(&self) -> u32 {
        whole(self.real("x.last")).into()
    }

    fn executed(&self) -> u32 {
        whole(self.real("x.done")).into()
    }

    fn order(&self) -> Option<u16> {
        Some(whole(self.real("x.order"))).filter(|order| *order != 0)
    }
}

/// Returns the program with the settings of a configuration.
fn source(bounds: &Bounds, config: &RobotConfig, capacity: usize) -> String {
    let seconds = |time: Duration| time.as_secs_f64();
    let Acks::Cumulative { every } = config.acks else { panic!("jobs do not overtake one another") };
    let low_water = config.low_water.unwrap_or(capacity / 2);
    let recovery = config.recovery;
    controller::source(&[
        ("cw.size", capacity as f64),
        ("cw.max", config.max_number.into()),
        ("cw.low", low_water as f64),
        ("cw.every", every.get().into()),
        ("cw.x.min", bounds.min.x.into()),
        ("cw.x.max", bounds.max.x.into()),
        ("cw.y.min", bounds.min.y.into()),
        ("cw.y.max", bounds.max.y.into()),
        ("cw.t.reply", seconds(config.reply_timeout)),
        ("cw.silent", config.silent_cycles.into()),
        ("cw.t.exchange", seconds(config.exchange)),
        ("cw.t.connect", seconds(config.reconnect_delay)),
        ("cw.t.status", seconds(config.status_period)),
        ("cw.t.patience", seconds(config.patience)),
        ("cw.t.pause", seconds(config.pause)),
        ("cw.resends", recovery.resends.into()),
        ("cw.pauses", recovery.pauses.into()),
        ("cw.clears", recovery.clears.into()),
        ("cw.refuse", if config.refuse_repeated_start { -1.0 } else { 0.0 }),
        ("cw.foreign", if config.end_foreign_order { -1.0 } else { 0.0 }),
        ("cw.packet", config.limits.packet as f64),
    ])
    .unwrap()
}

/// Returns the line between two points, in hundredths of a millimetre on the board.
fn line(start: Pose, end: Pose) -> Line {
    #[expect(clippy::cast_possible_truncation, reason = "seven digits")]
    let point = |pose: Pose| {
        let [x, y] = [pose[0] - 400.0, pose[1] + 200.0].map(|mm| (mm * 100.0).round() as i32);
        Point { x, y }
    };
    let kind = if end[2] < 40.0 { JobKind::Draw } else { JobKind::Move };
    Line { kind, start: point(start), end: point(end) }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of the protocol")]
fn whole(real: f32) -> u16 {
    real as u16
}

impl Session for AsRobot {
    type Event = RobotEvent;
    type Statistics = RobotStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = 4096;

    fn handle_connected(&mut self, now: Duration) {
        self.port.received.clear();
        self.port.sent.clear();
        self.port.line = Connection::Open;
        self.run(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.port.line = match self.port.line {
            Connection::Wanted => Connection::Refused,
            Connection::Open => Connection::Broken,
            line => line,
        };
        self.run(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.port.received.extend_from_slice(bytes);
        self.run(now);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.run(now);
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.port.events.pop_front()
    }

    fn poll_transmit(&mut self, _: Duration, out: &mut [u8]) -> Option<usize> {
        let packet = self.port.sent.pop_front()?;
        out.get_mut(..packet.len())?.copy_from_slice(&packet);
        self.statistics.packets += 1;
        Some(packet.len())
    }

    fn poll_timeout(&self) -> Option<Duration> {
        (0..self.machine.tasks()).filter_map(|task| self.machine.wakes_at(task)).min()
    }

    fn statistics(&self) -> RobotStatistics {
        self.statistics
    }
}

/// The connection as the controller sees it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Connection {
    #[default]
    None,
    /// `TCP_CONNECT` waits.
    Wanted,
    Refused,
    Open,
    /// The other end has closed it.
    Broken,
}

/// The surroundings of the program: time, connection and arm.
#[derive(Debug)]
struct Port {
    now: Duration,
    line: Connection,
    received: Vec<u8>,
    sent: VecDeque<Vec<u8>>,
    events: VecDeque<RobotEvent>,
    printed: Vec<String>,
    pieces: Rng,
    path: Vec<Motion>,
    /// The path of the last job.
    drawn: Vec<Motion>,
    /// The arm may finish its commanded path.
    may_arrive: bool,
    /// Jobs of the order.
    executed: u32,
}

impl Default for Port {
    fn default() -> Self {
        Self {
            now: Duration::ZERO,
            line: Connection::None,
            received: Vec::new(),
            sent: VecDeque::new(),
            events: VecDeque::new(),
            printed: Vec::new(),
            pieces: Rng::new(0),
            path: Vec::new(),
            drawn: Vec::new(),
            may_arrive: false,
            executed: 0,
        }
    }
}

impl Port {
    /// Splits the received bytes into strings, by chance shorter than possible, and some empty.
    fn strings(&mut self, longest: usize) -> Vec<Vec<u8>> {
        let taken = self.received.len().min(4096);
        let taken: Vec<u8> = self.received.drain(..taken).collect();
        let mut strings = Vec::new();
        let mut rest = taken.as_slice();
        while !rest.is_empty() {
            let cut = self.pieces.chance(0.1);
            let length = if cut { self.pieces.below(longest + 1) } else { longest }.min(rest.len());
            let (string, after) = rest.split_at(length);
            strings.push(string.to_vec());
            rest = after;
        }
        strings
    }
}

impl Host for Port {
    fn now(&self) -> Duration {
        self.now
    }

    fn connect(&mut self, since: Duration, timeout: Duration, _: [u8; 4], _: u16) -> Poll<i32> {
        match self.line {
            Connection::Open => Poll::Ready(SOCKET),
            Connection::Wanted if self.now < since + timeout => Poll::Pending,
            Connection::Wanted | Connection::Refused => {
                self.line = Connection::None;
                Poll::Ready(-1)
            }
            Connection::None | Connection::Broken => {
                self.line = Connection::Wanted;
                self.events.push_back(RobotEvent::Connect);
                Poll::Pending
            }
        }
    }

    fn send(&mut self, _: Duration, _: Duration, socket: i32, strings: &[&[u8]]) -> Poll<i32> {
        assert_eq!(socket, SOCKET);
        assert!(strings.iter().all(|string| (1..=255).contains(&string.len())), "{strings:?}");
        let packet = strings.concat();
        assert!(packet.len() <= 4096);
        if self.line != Connection::Open {
            return Poll::Ready(-1);
        }
        self.sent.push_back(packet);
        Poll::Ready(0)
    }

    fn receive(
        &mut self,
        since: Duration,
        timeout: Duration,
        socket: i32,
        longest: usize,
    ) -> Poll<(i32, Vec<Vec<u8>>)> {
        assert_eq!((socket, longest), (SOCKET, 255));
        if !self.received.is_empty() {
            return Poll::Ready((0, self.strings(longest)));
        }
        if self.line != Connection::Open {
            return Poll::Ready((-1, Vec::new()));
        }
        if self.now < since + timeout {
            return Poll::Pending;
        }
        // It is unspecified which of the two is returned.
        Poll::Ready((if self.pieces.chance(0.5) { -1 } else { 0 }, Vec::new()))
    }

    fn close(&mut self, _: i32) -> i32 {
        self.line = Connection::None;
        self.received.clear();
        0
    }

    fn sockets(&mut self) -> Vec<Socket> {
        let error = if self.line == Connection::Open { 0 } else { -1 };
        vec![Socket { port: 23, id: 1, error: 0 }, Socket { port: 9400, id: SOCKET, error }]
    }

    fn give(&mut self, motion: Motion) -> Poll<()> {
        self.path.push(motion);
        Poll::Ready(())
    }

    fn arrived(&mut self) -> Poll<()> {
        if !core::mem::take(&mut self.may_arrive) {
            return Poll::Pending;
        }
        self.drawn = core::mem::take(&mut self.path);
        Poll::Ready(())
    }

    fn print(&mut self, _: usize, line: &str) {
        self.printed.push(line.into());
        self.events.extend(event(line, &mut self.executed));
    }
}

/// Converts a printed line to an event.
fn event(line: &str, done: &mut u32) -> Option<RobotEvent> {
    let mut words = line.split_whitespace();
    let what = words.next()?;
    let mut number = || words.next().and_then(|word| word.parse::<u16>().ok()).unwrap_or(0);
    let (first, second) = (number(), number());
    let last = Some(first).filter(|last| *last != 0);
    let step = |step| Some(RobotEvent::Recovery { step, next: first + 1 });
    match what {
        "started" => {
            *done = 0;
            Some(RobotEvent::OrderStarted { order: first })
        }
        "refused" => Some(RobotEvent::OrderRefused { order: first, active: second }),
        "ending" => Some(RobotEvent::OrderEnding { order: first }),
        "interrupted" => Some(RobotEvent::OrderInterrupted { order: first }),
        "over" => Some(RobotEvent::OrderOver { order: first, executed: *done }),
        "full" => Some(RobotEvent::QueueFull { last }),
        "drained" => Some(RobotEvent::QueueDrained { next: first + 1 }),
        "cleared" => Some(RobotEvent::QueueCleared { next: first + 1 }),
        "resend" => step(RecoveryStep::Resend),
        "pause" => step(RecoveryStep::Pause),
        "clear" => step(RecoveryStep::Clear),
        "alarm" => Some(RobotEvent::Alarm { order: first, next: second + 1 }),
        "noreply" => Some(RobotEvent::NoReply),
        "disconnect" => Some(RobotEvent::Disconnect),
        "corrupt" => Some(RobotEvent::Corrupt(DecodeError::Garbage { offset: 0, length: 0 })),
        "repeated" => Some(RobotEvent::Rejected(MessageError::Repeated { expected: 0, found: first })),
        "rejected" | "badjob" => Some(RobotEvent::Rejected(MessageError::NotANumber { field: first.into() })),
        "notnext" => Some(RobotEvent::Rejected(MessageError::OutOfOrder { expected: 0, found: second })),
        "missing" => Some(RobotEvent::Rejected(MessageError::JobsMissing { order: 0, expected: first + 1 })),
        "unknown" => Some(RobotEvent::Rejected(MessageError::WrongOrder { active: 0, found: 0 })),
        other => panic!("{other} is printed and means nothing"),
    }
}
