//! The sessions over bytes do what the machines do: every state and every transition of the model is replayed with both ends.

use core::time::Duration;

use robot_session::Session as _;
use robot_session::end::{End as _, Machine as _};
use testkit::links::val2_alter::{Act, Alter, Fate, Message as Sent, Reply as Answer, TICK, World};
use testkit::model::{Edge, Options, System, explore};
use val2_alter::{
    Accumulation, Controller, ControllerEvent, Exception, ExceptionOutcome, Frame, Framing, Host, HostEvent,
    HostMessage, Message as _, Mode, Policy, RobotMessage, Unselected,
};

const GRIP: Exception = Exception::CloseGripper;
/// Both bytes of it are doubled.
const MOVES: i16 = 0x1010;

/// Both ends over bytes, and the model's world beside them.
struct Ends<'a> {
    system: &'a Alter,
    world: World,
    now: Duration,
    host: Host,
    controller: Controller,
    down: Vec<Vec<u8>>,
    up: Vec<Vec<u8>>,
}

impl<'a> Ends<'a> {
    fn new(system: &'a Alter) -> Self {
        let now = Duration::from_secs(1000);
        let (host, controller) = (host(system, now), controller(system, now));
        Self { system, world: system.init(), now, host, controller, down: Vec::new(), up: Vec::new() }
    }

    fn step(&mut self, act: Act) -> Result<(), String> {
        let mut edges = Vec::new();
        let next = self.system.step(&self.world, act, Some(&mut edges));
        let mut out = [0; Frame::MAX_LEN];
        let now = self.now;
        match act {
            Act::Send(fate) => {
                let due = self
                    .world
                    .controller
                    .transmit(Duration::ZERO, &self.system.controller)
                    .ok_or("nothing is due")?;
                let length = self.controller.poll_transmit(now, &mut out).ok_or("nothing is sent")?;
                equal("the message", message(&out[..length])?, Sent::from(due))?;
                carry(&mut self.down, &out[..length], fate);
            }
            Act::Read => {
                let bytes = self.down.remove(0);
                self.host.handle_input(now, &bytes);
            }
            Act::Answer(fate) => {
                let good = self.system.step(&self.world, Act::Answer(Fate::Good), None);
                let sent = good.up.len() > self.world.up.len();
                let expected = good.up.last().filter(|_| sent).map(|(answer, _)| *answer);
                let length = self.host.poll_transmit(now, &mut out);
                let found = length.map(|length| answer(&out[..length], expected)).transpose()?;
                equal("the answer", found, expected)?;
                match length {
                    Some(length) => carry(&mut self.up, &out[..length], fate),
                    None => self.host.handle_timeout(now),
                }
            }
            Act::Arrive => {
                let bytes = self.up.remove(0);
                self.controller.handle_input(now, &bytes);
            }
            Act::Noise => self.controller.handle_input(now, b"\x10\x10\x02\x00\x10\x04"),
            Act::Ask => self.host.exception(now, GRIP).map_err(|error| error.to_string())?,
            Act::Target(moving) => {
                let target = core::array::from_fn(|axis| MOVES * i16::from(moving >> axis & 1));
                self.host.set_target(now, target);
            }
            Act::Stop => self.host.stop(now),
            Act::Accept => self.host.set_policy(now, Policy::Accept),
            Act::Return => self.controller.resume(now).map_err(|error| error.to_string())?,
            Act::Start => self.controller.start(now).map_err(|error| error.to_string())?,
            Act::Finish | Act::End => {
                self.controller.finish(now).map_err(|error| error.to_string())?;
            }
            Act::Interrupt => self.controller.interrupt(now).map_err(|error| error.to_string())?,
            Act::RestartHost => self.host = host(self.system, now),
            Act::RestartController => self.controller = controller(self.system, now),
            Act::Reopen => {
                self.host.handle_disconnected(now);
                self.host.handle_connected(now);
            }
            Act::Tick | Act::LateTick => {
                self.now += TICK;
                self.controller.handle_timeout(self.now);
                self.host.handle_timeout(self.now);
            }
        }
        self.world = next;
        self.compare(&edges)
    }

    fn compare(&mut self, edges: &[Edge]) -> Result<(), String> {
        let mut host = self.host.machine().clone();
        host.each_time(|time| *time = time.saturating_sub(self.now));
        equal("the host is", host, self.world.host.clone())?;
        let mut controller = self.controller.machine().clone();
        controller.each_time(|time| *time = time.saturating_sub(self.now));
        equal("the controller is", controller, self.world.controller.clone())?;

        let mut found = Vec::new();
        while let Some(event) = self.host.poll_event() {
            found.extend(match event {
                HostEvent::Missed => Some("missed"),
                HostEvent::Rejected(_) => Some("rejected"),
                HostEvent::TargetStale => Some("target stale"),
                HostEvent::Stopped => Some("stopped"),
                HostEvent::Lost(_) => Some("lost"),
                HostEvent::Exception { outcome: ExceptionOutcome::Done, .. } => Some("exception done"),
                HostEvent::Exception { outcome: ExceptionOutcome::NotDone, .. } => Some("exception not done"),
                HostEvent::Exception { outcome: ExceptionOutcome::Unknown(_), .. } => {
                    Some("exception unknown")
                }
                HostEvent::Unexpected(unexpected) => return Err(unexpected.to_string()),
                // An end message is an event whether or not it ends something.
                _ => None,
            });
        }
        let expected = actions(edges, "host", &["ended", "accept", "repeat", "refuse", "reply"]);
        equal("the host reports", sorted(found), expected)?;

        let (mut found, is_offset) =
            (Vec::new(), self.system.host.mode.accumulation() == Accumulation::NonCumulative);
        while let Some(event) = self.controller.poll_event() {
            found.extend(match event {
                ControllerEvent::Reply { values, .. } => {
                    if values != [0; 6] || is_offset {
                        equal("the words", words(values), self.world.held)?;
                    }
                    None
                }
                ControllerEvent::BadReply(_) => Some("bad reply"),
                ControllerEvent::Exception(_) => Some("exception"),
                ControllerEvent::Stray(_) => Some("stray"),
                ControllerEvent::Ended(_) => Some("ended"),
                ControllerEvent::Started => Some("started"),
                ControllerEvent::Refused => Some("refused"),
                ControllerEvent::GaveUp => Some("gaveup"),
                ControllerEvent::Unexpected(unexpected) => return Err(unexpected.to_string()),
                _ => None,
            });
        }
        let messages =
            ["move", "start message", "standard message", "standard message, interrupted", "end message"];
        equal("the controller reports", sorted(found), actions(edges, "controller", &messages))
    }
}

fn host(system: &Alter, now: Duration) -> Host {
    let mut host = Host::new(system.host).unwrap();
    host.handle_connected(now);
    host
}

fn controller(system: &Alter, now: Duration) -> Controller {
    let mut controller = Controller::new(system.controller).unwrap();
    controller.handle_connected(now);
    controller
}

/// What an end does in these transitions, without what is sent.
fn actions(edges: &[Edge], end: &str, sent: &[&str]) -> Vec<String> {
    let edges = edges.iter().filter(|edge| edge.end == end && !sent.contains(&edge.action.as_str()));
    let actions = edges.flat_map(|edge| edge.action.split(", ").map(String::from));
    let skipped = ["", "interrupted", "reply with the exception"];
    let shown = |action: &String| !sent.contains(&action.as_str()) && !skipped.contains(&action.as_str());
    let mut actions: Vec<String> = actions.filter(shown).collect();
    actions.sort();
    actions
}

fn sorted(found: Vec<&str>) -> Vec<String> {
    let mut found: Vec<String> = found.into_iter().map(String::from).collect();
    found.sort();
    found
}

fn words(values: [i16; 6]) -> u8 {
    values.iter().rev().fold(0, |mask, value| 2 * mask + u8::from(*value != 0))
}

fn message(bytes: &[u8]) -> Result<Sent, String> {
    let (frame, _) = Frame::decode(bytes, Framing::DEFAULT).map_err(|e| e.to_string())?.ok_or("a part")?;
    Ok(match RobotMessage::decode(frame.data(), Framing::DEFAULT).map_err(|e| e.to_string())? {
        RobotMessage::Start(start) => Sent::Start(start.error),
        RobotMessage::Motion(motion) => Sent::Motion(motion.phase, motion.error),
        RobotMessage::End(end) => Sent::End(end.error),
    })
}

/// An answer as the model has it; whose exception it carries is not in the bytes.
fn answer(bytes: &[u8], expected: Option<Answer>) -> Result<Answer, String> {
    let (frame, _) = Frame::decode(bytes, Framing::DEFAULT).map_err(|e| e.to_string())?.ok_or("a part")?;
    Ok(match HostMessage::decode(frame.data(), Framing::DEFAULT).map_err(|e| e.to_string())? {
        HostMessage::StartReply(code) => Answer::Start(code),
        HostMessage::Reply(reply) => {
            let select = reply.values.iter().rev().fold(0, |mask, word| 2 * mask + u8::from(word.is_some()));
            let moving = words(reply.values.map(Option::unwrap_or_default));
            let whose = expected.and_then(|expected| match expected {
                Answer::Values { job, .. } => job,
                Answer::Start(_) | Answer::Corrupt => None,
            });
            let job = (reply.exception == GRIP).then_some(whose.unwrap_or(u8::MAX));
            Answer::Values { select, moving, job }
        }
    })
}

fn carry(line: &mut Vec<Vec<u8>>, bytes: &[u8], fate: Fate) {
    let mut bytes = bytes.to_vec();
    match fate {
        Fate::Good | Fate::Late => line.push(bytes),
        Fate::Lost => {}
        Fate::Corrupt => {
            *bytes.last_mut().unwrap() ^= 0x04;
            line.push(bytes);
        }
    }
}

fn equal<T: PartialEq + core::fmt::Debug>(what: &str, found: T, expected: T) -> Result<(), String> {
    if found == expected { Ok(()) } else { Err(format!("{what}: {found:?}, the model: {expected:?}")) }
}

#[test]
fn the_sessions_do_what_the_machines_do() {
    for mode in [19, 18] {
        let mut system = Alter { faults: 1, jobs: 1, takes_all: false, ..Alter::new(Mode(mode)) };
        system.controller.unselected = Unselected::Hold;
        let graph = explore(&system, &Options { edges: true, ..Options::default() });
        assert!(graph.holds());
        let (mut walks, mut steps) = (0, 0);
        for path in graph.walks() {
            let mut ends = Ends::new(&system);
            for (at, act) in path.iter().enumerate() {
                let before = ends.world.clone();
                if let Err(difference) = ends.step(*act) {
                    panic!("{difference}\nbefore: {before:?}\npath: {:?}", &path[..=at]);
                }
            }
            (walks, steps) = (walks + 1, steps + path.len());
        }
        println!("{} states, {} transitions, {walks} walks, {steps} steps", graph.states, graph.edges.len());
        assert!(graph.states > 30_000 && walks > 1000, "{} {walks}", graph.states);
    }
}
