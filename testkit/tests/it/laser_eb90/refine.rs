//! The sessions over bytes follow the machines: every state and every transition of the model is replayed with both ends.

use core::time::Duration;

use laser_eb90::controller::machine::Answer;
use laser_eb90::{
    Controller, ControllerConfig, ControllerEvent, Host, HostConfig, HostEvent, Instruction, Item, Refusal,
};
use robot_session::Session;
use robot_session::end::{End as _, Machine as _};
use robot_work_queue::Reader as QueueReader;
use testkit::links::laser_eb90::world::{
    Act, Content, Fate, Found, Reported, SWITCH, Setup, Transmission, World,
};
use testkit::links::laser_eb90::{OURS, setup};
use testkit::model::{Options, System, explore};

use crate::laser_eb90::cell::CUT;

/// The index of the frame to which an instruction belongs.
struct Part(u8);

impl TryFrom<Instruction<'_>> for Part {
    type Error = ();

    fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
        match instruction.parameters.next() {
            Some(Ok(Item::U8([job, ..]))) => Ok(Self(*job)),
            _ => Err(()),
        }
    }
}

/// Both ends over bytes, and the model's world beside them.
struct Ends<'a> {
    setup: &'a Setup,
    config: HostConfig,
    world: World,
    now: Duration,
    host: Host,
    /// The first frame of this host: one that has crashed has sent those before.
    first: u8,
    controller: Controller<'static, Part>,
    queue: QueueReader<'static, Part>,
    sent: Vec<Vec<u8>>,
    executed: Vec<u8>,
}

impl<'a> Ends<'a> {
    fn new(setup: &'a Setup, config: HostConfig) -> Self {
        let world = setup.init();
        let jobs = setup.jobs.len();
        // Nobody was there before: it is connected for long enough.
        let now = Duration::from_secs(100);
        let mut host = Host::new(config).unwrap();
        host.handle_connected(Duration::ZERO);
        let (controller, queue) = controller(setup, now);
        let (sent, executed) = (vec![Vec::new(); jobs], vec![0; jobs]);
        Self { setup, config, world, now, host, first: 0, controller, queue, sent, executed }
    }

    fn step(&mut self, act: Act) -> Result<(), String> {
        let next = self.setup.step(&self.world, act, None);
        let mut out = [0; <Host as Session>::MAX_TRANSMIT];
        match act {
            Act::Tick | Act::LateTick => self.tick(),
            Act::Connect => self.host.handle_connected(self.now),
            Act::Submit => submit(
                &mut self.host,
                self.setup.jobs[usize::from(self.world.submitted)],
                self.world.submitted,
            ),
            Act::Send(_) => {
                let length = self.host.poll_transmit(self.now, &mut out).ok_or("the host does not send")?;
                let job = next.down.last().ok_or("no frame")?.job;
                self.sent[usize::from(job)] = out[..length].to_vec();
            }
            Act::Timeout => self.host.handle_timeout(self.now),
            Act::Resume => self.host.resume(),
            // The controller's reaction to a good frame follows from the frame.
            Act::Judge(_) => {}
            Act::Finish(Ok(())) => self.controller.answer(self.now, |_| Ok(())).map_err(|e| e.to_string())?,
            Act::Finish(Err(refusal)) => {
                self.controller.refuse(self.now, refusal).map_err(|e| e.to_string())?;
            }
            Act::Reply(_) => {
                let machine = self.world.controller;
                let answer = machine.transmit(Duration::ZERO, &self.setup.controller).ok_or("no answer")?;
                let length = self.controller.poll_transmit(self.now, &mut out).ok_or("no answer is sent")?;
                equal("the answer", out[..length].to_vec(), bytes(answer))?;
            }
            Act::Noise => self.controller.handle_input(self.now, &[0x55; 4]),
            Act::Crash { .. } => {
                self.host = Host::new(self.config).unwrap();
                self.first = next.submitted;
            }
            Act::Disconnect => self.host.handle_disconnected(self.now),
            Act::Restart => (self.controller, self.queue) = controller(self.setup, self.now),
        }
        let before = core::mem::replace(&mut self.world, next);
        self.compare(&before, act)
    }

    fn tick(&mut self) {
        self.now += self.setup.tick;
        if let Some(front) = self.world.down.first() {
            let paused =
                matches!(front.fate, Fate::Paused { after, ticks } if after == front.passed && ticks > 0);
            let last = front.passed + 1 == self.setup.line && !paused;
            if last && self.setup.reports_transmitted && self.world.down.len() == 1 && self.world.connected {
                self.host.handle_transmitted(self.now);
            }
            if let Some(piece) = self.piece(front) {
                self.controller.handle_input(self.now, &piece);
            }
        }
        let blocked = self.world.is_blocked(self.setup) && self.is_blocked_after();
        if let Some(reply) = self.world.up.first().filter(|reply| reply.ticks == 1 && !blocked) {
            let mut answer = bytes(reply.answer);
            if reply.corrupt {
                answer[6] ^= 0x04;
            }
            if self.world.connected {
                self.host.handle_input(self.now, &answer);
            }
        }
        self.controller.handle_timeout(self.now);
    }

    /// Returns whether the line is still busy after this tick.
    fn is_blocked_after(&self) -> bool {
        let front = self.world.down.first();
        self.world.down.len() > 1 || front.is_some_and(|front| {
            front.passed + 1 < self.setup.line
                || matches!(front.fate, Fate::Paused { after, ticks } if after == front.passed && ticks > 0)
        })
    }

    /// Returns the bytes of this tick.
    fn piece(&self, front: &Transmission) -> Option<Vec<u8>> {
        let mut frame = self.sent[usize::from(front.job)].clone();
        match front.fate {
            Fate::Lost => return None,
            Fate::Cut { after } if front.passed >= after => return None,
            Fate::Paused { after, ticks } if front.passed == after && ticks > 0 => return None,
            Fate::Headless => frame[0] ^= 0x01,
            Fate::Corrupt => *frame.last_mut().unwrap() ^= 0x04,
            _ => {}
        }
        let at = |piece: u8| frame.len() * usize::from(piece) / usize::from(self.setup.line);
        Some(frame[at(front.passed)..at(front.passed + 1)].to_vec())
    }

    fn compare(&mut self, before: &World, act: Act) -> Result<(), String> {
        let mut expected = Vec::new();
        for (job, (old, new)) in before.jobs.iter().zip(&self.world.jobs).enumerate() {
            if old.reported != new.reported && !matches!(act, Act::Crash { .. }) {
                expected.extend(new.reported.map(|reported| (job as u8, reported)));
            }
        }
        let mut found = Vec::new();
        while let Some(event) = self.host.poll_event() {
            let (ticket, reported) = match event {
                HostEvent::Done { first, unanswered, .. } => {
                    (first, Reported::Done { unanswered: unanswered > 0 })
                }
                HostEvent::Refused { first, .. } => (first, Reported::Refused),
                HostEvent::Unknown { first, .. } => (first, Reported::Unknown),
                HostEvent::Corrupt(_) | HostEvent::Unasked { .. } => continue,
                other => return Err(format!("{other:?}")),
            };
            let tickets = if self.setup.jobs[0] == Content::Interpreted { PARTS } else { 1 };
            found.push((self.first + (ticket / tickets) as u8, reported));
        }
        equal("what the host reports", found, expected)?;
        while let Some(event) = self.controller.poll_event() {
            match event {
                ControllerEvent::Execute { .. } => {
                    let part =
                        self.controller.instruction().and_then(|i| Part::try_from(i).ok()).ok_or("no job")?;
                    self.executed[usize::from(part.0)] += 1;
                }
                ControllerEvent::Unexpected(unexpected) => return Err(unexpected.to_string()),
                _ => {}
            }
        }
        let mut parts = vec![0; self.executed.len()];
        while let Some(part) = self.queue.take() {
            parts[usize::from(part.complete().0)] += 1;
        }
        for (executed, parts) in self.executed.iter_mut().zip(parts) {
            *executed += parts / PARTS as u8;
        }
        let mut host = *self.host.machine();
        let mut model = self.world.host;
        equal("the host is", host.name(), model.name())?;
        let (mut times, mut expected) = (Vec::new(), Vec::new());
        host.each_time(|time| times.push(time.saturating_sub(self.now)));
        model.each_time(|time| expected.push(*time));
        equal("the host's times", times, expected)?;
        // The session judges a frame at once.
        if matches!(self.world.found.first(), Some(Found::Frame(_))) && !self.world.is_executing() {
            return Ok(());
        }
        let mut controller = *self.controller.machine();
        controller.each_time(|time| *time = time.saturating_sub(self.now));
        equal("the controller is", controller, self.world.controller)?;
        let executed: Vec<u8> = self.executed.iter().map(|times| (*times).min(2)).collect();
        equal("executed", executed, self.world.jobs.iter().map(|job| job.executed).collect())
    }
}

fn equal<T: PartialEq + core::fmt::Debug>(what: &str, found: T, expected: T) -> Result<(), String> {
    if found == expected { Ok(()) } else { Err(format!("{what}: {found:?}, the model: {expected:?}")) }
}

fn controller(setup: &Setup, now: Duration) -> (Controller<'static, Part>, QueueReader<'static, Part>) {
    let (writer, reader) = robot_work_queue::boxed(32, 9999).unwrap();
    let config = ControllerConfig { tick: Duration::ZERO, ..setup.controller };
    let mut controller = Controller::new(config, writer).unwrap();
    controller.handle_connected(now);
    (controller, reader)
}

/// The instructions of an interpreted frame: a fifth of it is not shorter than the shortest frame, below which
/// corruption is not answered.
const PARTS: u64 = 3;

fn submit(host: &mut Host, content: Content, job: u8) {
    match content {
        Content::Interpreted => {
            for _ in 0..PARTS {
                host.submit(CUT, |payload| payload.u8(&[job; 12]).map(drop)).unwrap();
            }
        }
        Content::Immediate | Content::Mixed => {
            host.submit(SWITCH, |payload| payload.u8(&[job; 48]).map(drop)).unwrap();
        }
    }
}

fn bytes(answer: Answer) -> Vec<u8> {
    let word = match answer {
        Answer::Echo(word) => word,
        Answer::Error(Refusal::BadChecksum) => 0xE001,
        Answer::Error(Refusal::BadFrame) => 0xE002,
        Answer::Error(Refusal::BadParameters) => 0xE005,
        Answer::Error(other) => panic!("{other:?}"),
    };
    let mut buffer = [0; 16];
    let mut payload = laser_eb90::Payload::new(&mut buffer, &laser_eb90::Profile::default());
    payload.word(word).unwrap();
    let mut out = Vec::new();
    payload.frame().unwrap().append_to(&mut out);
    out
}

fn follow(mut setup: Setup) -> usize {
    // Whether the queue is full is known when the frame comes, in the model after that.
    setup.faults.queue_full = false;
    // A frame takes five ticks of 50 ms.
    let mut probe = Host::new(HostConfig { batch: 7, ..setup.host }).unwrap();
    probe.handle_connected(Duration::ZERO);
    submit(&mut probe, setup.jobs[0], 0);
    let length =
        probe.poll_transmit(Duration::from_secs(100), &mut [0; <Host as Session>::MAX_TRANSMIT]).unwrap();
    let config = HostConfig { baud: 40 * length as u32, longest_frame: length, ..setup.host };
    let graph = explore(&setup, &Options { edges: true, ..Options::default() });
    assert!(graph.holds());
    let mut steps = 0;
    for path in graph.walks() {
        let mut ends = Ends::new(&setup, config);
        for (at, act) in path.iter().enumerate() {
            let before = ends.world.clone();
            if let Err(difference) = ends.step(*act) {
                panic!("{difference}\nbefore: {before:?}\npath: {:?}", &path[..=at]);
            }
            steps += 1;
        }
    }
    println!("{} states, {} transitions, {steps} steps", graph.states, graph.edges.len());
    graph.states
}

#[test]
fn the_sessions_follow_the_machines() {
    assert!(follow(setup(OURS, &[Content::Interpreted; 2], 2)) > 5000);
    assert!(follow(setup(OURS, &[Content::Immediate; 2], 2)) > 5000);
}

#[test]
fn the_sessions_follow_the_machines_where_partial_frames_may_be_kept_and_where_the_driver_reports() {
    let mut careful = setup(OURS, &[Content::Interpreted; 2], 2);
    careful.host.controller_drops_partial = false;
    assert!(follow(careful.clone()) > 5000);
    careful.reports_transmitted = true;
    (careful.faults.crash, careful.faults.disconnect) = (false, false);
    assert!(follow(careful) > 2000);
    let mut insists = setup(OURS, &[Content::Interpreted; 2], 2);
    insists.host.resend_on_silence = true;
    assert!(follow(insists) > 5000);
}
