//! A controller and a host on a serial line. A job is a reply that moves the arm, or an exception for the gripper.

use core::time::Duration;

use val2_alter::{
    Accumulation, Controller, ControllerConfig, ControllerEvent, ControllerState, DecodeError, ErrorCode,
    Exception, Frame, Framing, Host, HostConfig, HostEvent, HostMessage, HostState, Limits, Message, Mode,
    MotionPhase, RobotMessage, Select, Unselected,
};

use super::{Check, Ledger, Log, Mark, Row, Tally, Told, Unseen, Wire};
use crate::link::{Delivery, End, Faults};
use crate::rng::Rng;

pub(super) const SERIAL: Row =
    Row { link: "val2-alter", transport: "serial", job: "replies", one_in: Some(256), session };

const MS: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(300);

type Values = [i16; 6];

/// The values of a job: they say which one it is, and are never all zero. Some stay as they were, or are zero.
fn values(job: usize) -> Values {
    let n = job as i16 + 1;
    [n, n / 2, (n / 4).wrapping_mul(31), (n & 1) * 0x1010, 0x0210, -n]
}

struct Cell {
    now: Duration,
    log: Log,
    wire: Wire,
    ledger: Ledger,
    /// Taken by the controller, and nobody sent it; and whether the host was misled.
    aliens: Vec<(HostMessage, bool)>,
    controller: Controller,
    host: Host,
    /// Whether values are offsets from the path, and which ones hold.
    holds: bool,
    applied: Values,
    /// Whether the robot's exception subroutine runs.
    interrupted: bool,
    /// When the robot's program executes ALTER again.
    again_at: Option<Duration>,
    /// Before the message that the host answers next: what it says may be wrong too.
    cause: Mark,
    /// Whether the controller keeps the words that a reply leaves out: then one that is wrong stays so, up to the next start.
    keeps: bool,
    /// The mode of the controller, and whether the host has heard of another: then all that it says may be wrong, up to the end.
    mode: Mode,
    misled: bool,
    /// The reply, and the exception, whose fate is not known yet.
    reply: Option<usize>,
    exception: Option<(usize, Exception)>,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.1, 0.5, 2.0][rng.below(3)];
    // A pause of more than 4 ms ends a frame. All delays of a cycle together stay below 11 ms: a reply that comes as late as
    // the next message would pass for the reply to that, since it has no number.
    let (pause, max_delay) = [(MS, 4 * MS), (5 * MS, MS / 2)][rng.below(2)];
    let faults = Faults {
        flip: 0.002 * bad,
        lose_byte: 0.001 * bad,
        insert: 0.001 * bad,
        lose: 0.02 * bad,
        pause,
        max_delay,
        ..Faults::SERIAL
    };
    let config = ControllerConfig {
        mode: [Mode::CUMULATIVE_23, Mode(19), Mode::NON_CUMULATIVE_22, Mode(18)][rng.below(4)],
        subroutine: true,
        unselected: [Unselected::ByMode, Unselected::Hold, Unselected::Zero][rng.below(3)],
        ..ControllerConfig::default()
    };
    let host = HostConfig {
        limits: Limits::NONE,
        subroutine: true,
        select: [Select::All, Select::Needed][rng.below(2)],
        unselected: config.unselected,
        ..HostConfig::default()
    };
    let mut cell = Cell {
        now: Duration::ZERO,
        log,
        wire: Wire::new(seed, faults.at_baud(config.baud), ["controller", "host"], false, log),
        ledger: Ledger::default(),
        aliens: Vec::new(),
        controller: Controller::new(config),
        host: Host::new(host),
        holds: config.mode.accumulation() == Accumulation::NonCumulative,
        applied: [0; 6],
        interrupted: false,
        again_at: Some(Duration::ZERO),
        cause: Mark::default(),
        keeps: host.select == Select::Needed && host.unselected != Unselected::Zero,
        mode: config.mode,
        misled: false,
        reply: None,
        exception: None,
    };
    let jobs = 5 + rng.below(60);
    while cell.ledger.len() < jobs && cell.now < LIMIT {
        cell.users(&mut rng);
        cell.step();
    }
    log.say(cell.now, format_args!("the host stops"));
    cell.host.stop();
    let end = cell.now + Duration::from_secs(1);
    while cell.now < end && (cell.host.state() != HostState::Idle || cell.open()) {
        cell.step();
    }
    cell.settle()
}

impl Cell {
    fn open(&self) -> bool {
        self.reply.is_some() || self.exception.is_some()
    }

    /// What the robot's program and the operator do.
    fn users(&mut self, rng: &mut Rng) {
        if self.controller.state() == ControllerState::Off {
            let again_at = *self.again_at.get_or_insert_with(|| self.now + MS * rng.below(100) as u32);
            if again_at <= self.now {
                self.log.say(self.now, format_args!("the robot's program executes ALTER"));
                self.controller.start(self.now).unwrap();
                (self.again_at, self.interrupted, self.applied) = (None, false, [0; 6]);
            }
        }
        if self.interrupted && rng.chance(0.1) {
            self.log.say(self.now, format_args!("the exception subroutine returns"));
            self.controller.resume();
            self.interrupted = false;
        }
        if rng.chance(0.003) {
            self.log.say(self.now, format_args!("the robot's program ends ALTER"));
            self.controller.finish();
        }
        if self.exception.is_none() && rng.chance(0.03) {
            let exception = [Exception::CloseGripper, Exception::OpenGripper][rng.below(2)];
            if self.host.exception(exception).is_ok() {
                let job = self.ledger.send(self.cause);
                self.log.say(self.now, format_args!("job {job}: {exception:?}"));
                self.exception = Some((job, exception));
            }
        }
    }

    fn step(&mut self) {
        let mut out = [0; Frame::MAX_LEN];
        while let Some(Delivery::Bytes(bytes)) = self.wire.receive(End::A, self.now) {
            self.controller.handle_input(self.now, &bytes);
        }
        self.controller.handle_timeout(self.now);
        self.obey();
        while let Some(len) = self.controller.poll_transmit(self.now, &mut out) {
            self.wire.send(End::A, self.now, &out[..len]);
        }
        self.obey();
        while let Some(Delivery::Bytes(bytes)) = self.wire.receive(End::B, self.now) {
            self.host.handle_input(self.now, &bytes);
        }
        self.host.handle_timeout(self.now);
        self.hear();
        let job = self.ledger.len();
        self.host.set_target(values(job));
        let runs = self.host.state() == HostState::Running;
        while let Some(len) = self.host.poll_transmit(self.now, &mut out) {
            if runs && self.host.values() == values(job) {
                self.ledger.send(self.cause);
                self.log.say(self.now, format_args!("job {job}: {:?}", values(job)));
                self.reply = Some(job);
            }
            if !self.keeps && !self.misled {
                self.cause = self.wire.mark();
            }
            self.wire.send(End::B, self.now, &out[..len]);
        }
        self.hear();
        let times = [self.host.poll_timeout(), self.controller.poll_timeout(), self.again_at];
        self.now = self.wire.next(self.now, times);
    }

    fn obey(&mut self) {
        while let Some(event) = self.controller.poll_event() {
            self.log.say(self.now, format_args!("  controller: {event:?}"));
            match event {
                // While the subroutine runs the arm stands.
                ControllerEvent::Reply(reply) if !self.interrupted => {
                    let taken = self.controller.values();
                    let job = (0..self.ledger.len()).rposition(|job| values(job) == taken);
                    // An offset that stays is no job.
                    let stays = self.holds && taken == self.applied;
                    match job {
                        _ if stays => {}
                        _ if taken == [0; 6] => self.applied = taken,
                        Some(job) => {
                            self.applied = taken;
                            self.ledger.execute(job);
                        }
                        // The one that it has replaced comes again and is no job either.
                        None => self.aliens.push((HostMessage::Reply(reply), self.misled)),
                    }
                }
                ControllerEvent::Exception(exception) => {
                    self.interrupted = true;
                    match self.exception {
                        Some((job, sent)) if sent == exception => _ = self.ledger.execute(job),
                        _ => {
                            let reply = val2_alter::Reply { exception, ..val2_alter::Reply::NOTHING };
                            self.aliens.push((HostMessage::Reply(reply), self.misled));
                        }
                    }
                }
                _ => {}
            }
        }
    }

    fn hear(&mut self) {
        while let Some(event) = self.host.poll_event() {
            self.log.say(self.now, format_args!("  host: {event:?}"));
            let mark = self.wire.mark();
            let told = match event {
                HostEvent::Motion(motion) => {
                    if motion.phase == MotionPhase::Interrupted
                        && let Some((job, _)) = self.exception.take()
                    {
                        self.ledger.tell(job, Told::Done, mark);
                    }
                    (motion.error == ErrorCode::None).then_some(Told::Done)
                }
                HostEvent::Rejected(_) => Some(Told::NotDone),
                HostEvent::Start(_) | HostEvent::End(_) | HostEvent::Lost => {
                    self.misled = matches!(&event, HostEvent::Start(start) if start.mode != self.mode);
                    if !self.misled {
                        self.cause = mark;
                    }
                    if let Some((job, _)) = self.exception.take() {
                        self.ledger.tell(job, Told::Unknown, mark);
                    }
                    Some(Told::Unknown)
                }
                _ => None,
            };
            if let (Some(told), Some(job)) = (told, self.reply) {
                self.reply = None;
                self.ledger.tell(job, told, mark);
            }
        }
    }

    fn settle(self) -> Tally {
        let mut tally = Tally::default();
        let unseen = self.wire.settle(self.now, &mut tally, Frame::MAX_LEN, |from, bytes| {
            let (frame, len) = match Frame::decode(bytes, Framing::DEFAULT) {
                Ok(Some(found)) => found,
                Err(DecodeError::Checksum { .. }) => return Check::Refused,
                Ok(None) | Err(_) => return Check::Nothing,
            };
            let reads = match from {
                End::A => RobotMessage::decode(frame.data(), Framing::DEFAULT).is_ok(),
                End::B => HostMessage::decode(frame.data(), Framing::DEFAULT).is_ok(),
            };
            if reads { Check::Good(len) } else { Check::Nothing }
        });
        for (alien, misled) in self.aliens {
            // An exception is sent again by a host that was told, wrongly, that it was not read.
            let again = matches!(alien, HostMessage::Reply(reply) if reply.exception != Exception::None);
            let made = |unseen: &Unseen| match unseen.from {
                End::A => again || misled,
                End::B => self.keeps || says(&unseen.bytes, alien),
            };
            if !unseen.iter().any(made) {
                self.log.say(self.now, format_args!("!!! nobody sent {alien:?}"));
                tally.invented += 1;
            }
        }
        self.ledger.settle(self.now, self.log, &mut tally, |job| {
            unseen.iter().any(|unseen| unseen.is_between(job.from, job.to))
        });
        tally
    }
}

/// Whether a frame that damage has made says this: its values, or for an exception, that.
fn says(bytes: &[u8], alien: HostMessage) -> bool {
    let Ok(Some((frame, _))) = Frame::decode(bytes, Framing::DEFAULT) else { return false };
    match (HostMessage::decode(frame.data(), Framing::DEFAULT), alien) {
        (Ok(HostMessage::Reply(found)), HostMessage::Reply(alien)) => {
            found == alien || alien.exception != Exception::None && found.exception == alien.exception
        }
        _ => false,
    }
}
