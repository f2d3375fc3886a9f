//! The sessions over bytes follow the machines: every path of the model is walked by both.

use core::time::Duration;
use std::cell::RefCell;
use std::rc::Rc;

use kawasaki_msg::pc::machine as pc;
use kawasaki_msg::robot::machine::{self as robot, Link};
use kawasaki_msg::robot_session::end::{End as _, Machine as _};
use kawasaki_msg::robot_session::{Decoder as _, Session};
use kawasaki_msg::{
    Decoder, Dialect, FromPc, FromRobot, Job, JobKind, JobSource, LargePc, LargeRobot, Line, PcEvent, Point,
    RobotEvent, Supply,
};
use robot_work_queue::Reader;

use super::machines::{self, packet};
use super::world::{Act, ReportedStart, Setup, TICK, Tag, World};
use crate::model::{Refined, System};

/// Walks every state and every transition of a pair with real sessions.
///
/// # Panics
/// If a session differs from its machine.
pub(super) fn refine(setup: &Setup) -> Refined {
    Refined::by(setup, |path| walk(setup, &path))
}

fn walk(setup: &Setup, path: &[Act]) {
    let (mut ends, mut reader) = Ends::new(setup);
    while ends.at < path.len() {
        let Some(tag) = ends.world.executing else {
            // An idle motion task checks its queue, which sweeps cleared jobs.
            assert_eq!(reader.take().is_some(), !ends.world.queue.is_empty(), "{:?}", &path[..ends.at]);
            ends.step(path);
            reader = ends.reader.take().unwrap_or(reader);
            continue;
        };
        let taken = reader.take_where(|_, job| job.work == line(tag)).expect("the job is in the queue");
        while ends.at < path.len() && path[ends.at] != Act::Done && ends.reader.is_none() {
            ends.step(path);
        }
        if let Some(fresh) = ends.reader.take() {
            reader = fresh;
        } else if ends.at < path.len() {
            ends.robot.job_done(ends.now, Job::clone(&taken).number).expect("it is in the queue");
            taken.complete();
            ends.step(path);
        }
    }
}

/// Returns the line of a job, which encodes its number.
fn line(Tag { start, job }: Tag) -> Line {
    let at = Point::new(i32::from(start), i32::from(job));
    Line { kind: JobKind::Draw, start: at, end: at }
}

/// The jobs of a start, no more of them in an answer than the model has in a packet.
#[derive(Debug)]
struct RefinedJobs {
    start: u8,
    jobs: u32,
    batch: usize,
    taken: Rc<RefCell<Vec<u32>>>,
}

impl JobSource for RefinedJobs {
    type Work = Line;

    fn job(&mut self, index: u32) -> Supply<Line> {
        if index >= self.jobs {
            return Supply::End;
        }
        let mut taken = self.taken.borrow_mut();
        if !taken.contains(&index) {
            taken.push(index);
        }
        if taken.len() > self.batch {
            return Supply::Later;
        }
        Supply::Job(line(Tag { start: self.start, job: index as u8 }))
    }
}

/// Both ends over bytes, and the model's world beside them.
struct Ends<'a> {
    setup: &'a Setup,
    world: World,
    at: usize,
    now: Duration,
    robot: LargeRobot<'static, Line>,
    /// The queue of a robot that was restarted.
    reader: Option<Reader<'static, Job<Line>>>,
    pc: LargePc<RefinedJobs>,
    taken: Rc<RefCell<Vec<u32>>>,
    /// The messages of each packet in flight.
    up: Vec<Vec<Vec<u8>>>,
    down: Vec<Vec<Vec<u8>>>,
}

impl<'a> Ends<'a> {
    fn new(setup: &'a Setup) -> (Self, Reader<'static, Job<Line>>) {
        let (robot, reader) = new_robot(setup);
        let pc = LargePc::with_ranges(setup.pc, Default::default()).expect("a configuration that works");
        let ends = Self {
            setup,
            world: setup.init(),
            at: 0,
            now: Duration::ZERO,
            robot,
            reader: None,
            pc,
            taken: Rc::default(),
            up: Vec::new(),
            down: Vec::new(),
        };
        (ends, reader)
    }

    fn step(&mut self, path: &[Act]) {
        let act = path[self.at];
        self.at += 1;
        let path = &path[..self.at];
        let after = self.setup.step(&self.world, act, None);
        let before = core::mem::replace(&mut self.world, after);
        self.happens(act, &before, path);
        self.compare(&before, path);
    }

    fn happens(&mut self, act: Act, before: &World, path: &[Act]) {
        let now = self.now;
        match act {
            Act::Start => {
                let start = before.starts.len();
                let (jobs, batch) = (self.setup.jobs, self.setup.batch as usize);
                let source = RefinedJobs { start: start as u8, jobs, batch, taken: self.taken.clone() };
                self.pc.start(self.setup.starts[start], source).expect("the PC is idle");
            }
            Act::Interrupt => self.pc.interrupt().expect("there is an order"),
            Act::End => self.pc.end().expect("there is an order"),
            Act::ClearQueue => self.robot.clear_queue().expect("there is an order"),
            Act::ResetOrder => self.robot.reset_order().expect("there is an order"),
            Act::Connect => {
                if !self.setup.datagrams() || !before.pc.is_connected() {
                    self.pc.handle_connected(now);
                }
                self.robot.handle_connected(now);
            }
            Act::RobotTimeout => self.robot.handle_timeout(now),
            Act::PcTimeout => self.pc.handle_timeout(now),
            Act::Transmit => self.transmit(before, path),
            Act::Answer => self.answer(before, path),
            Act::PcReads { packet, count } => {
                let bytes = take(&mut self.up, packet, count);
                self.pc_reads(&bytes, path.len());
            }
            Act::PcReadsCorrupt(count) => {
                let mut packet = self.up.remove(0);
                corrupt(&mut packet[usize::from(count) - 1]);
                self.pc_reads(&packet.concat(), path.len());
            }
            Act::RobotReads { packet, count } => {
                let bytes = take(&mut self.down, packet, count);
                self.robot_reads(&bytes, path.len());
            }
            Act::RobotReadsCorrupt(count) => {
                let mut packet = self.down.remove(0);
                corrupt(&mut packet[usize::from(count) - 1]);
                self.robot_reads(&packet.concat(), path.len());
            }
            // The motion task is the walk's.
            Act::Take(_) | Act::Done => {}
            Act::Lose => self.lose(),
            Act::LoseDatagram { up, packet } => {
                let line = if up { &mut self.up } else { &mut self.down };
                line.remove(packet.into());
            }
            Act::Repeat { up } => {
                let line = if up { &mut self.up } else { &mut self.down };
                line.insert(0, line[0].clone());
            }
            Act::RobotNotices => self.robot.handle_disconnected(now),
            Act::PcNotices => self.pc.handle_disconnected(now),
            Act::RestartPc => {
                self.pc = LargePc::with_ranges(self.setup.pc, Default::default())
                    .expect("a configuration that works");
                if self.setup.datagrams() {
                    self.pc.handle_connected(now);
                } else {
                    self.lose();
                }
            }
            Act::RestartRobot => {
                if !self.setup.datagrams() {
                    self.lose();
                }
                let (robot, reader) = new_robot(self.setup);
                (self.robot, self.reader) = (robot, Some(reader));
                // The session's clock continues where the model's has begun again.
                assert_eq!(self.world.robot.link, Link::Disconnected { connect_at: Duration::ZERO });
            }
            Act::Tick | Act::LateTick => self.now += TICK,
        }
    }

    fn lose(&mut self) {
        self.up.clear();
        self.down.clear();
    }

    fn transmit(&mut self, before: &World, path: &[Act]) {
        let (expected, _) = packet(&before.robot, &self.setup.robot);
        let mut out = [0; <LargeRobot<Line> as Session>::MAX_TRANSMIT];
        let length = self.robot.poll_transmit(self.now, &mut out).expect("a packet is due");
        let (messages, sent) = read(&out[..length], FromRobot::read);
        assert_eq!(sent, expected, "{path:?}");
        if before.line {
            self.up.push(messages);
        }
    }

    fn answer(&mut self, before: &World, path: &[Act]) {
        let mut out = [0; <LargeRobot<Line> as Session>::MAX_TRANSMIT];
        self.taken.borrow_mut().clear();
        let length = self.pc.poll_transmit(self.now, &mut out).expect("an answer is due");
        let (messages, sent) = read(&out[..length], FromPc::read);
        if before.line {
            let expected = self.world.down.last().map(|packet| packet.messages.iter());
            let expected: Vec<_> = expected.into_iter().flatten().filter_map(|sent| sent.message).collect();
            assert_eq!(sent, expected, "{path:?}");
            self.down.push(messages);
        }
    }

    /// Lets the PC read bytes in two pieces; a datagram is read in one.
    fn pc_reads(&mut self, bytes: &[u8], at: usize) {
        let cut = if self.setup.datagrams() { 0 } else { at % (bytes.len() + 1) };
        let (head, tail) = bytes.split_at(cut);
        for piece in [head, tail].into_iter().filter(|piece| !piece.is_empty()) {
            if self.pc.machine().is_connected() {
                self.pc.handle_input(self.now, piece);
            }
        }
    }

    fn robot_reads(&mut self, bytes: &[u8], at: usize) {
        let cut = if self.setup.datagrams() { 0 } else { at % (bytes.len() + 1) };
        let (head, tail) = bytes.split_at(cut);
        for piece in [head, tail].into_iter().filter(|piece| !piece.is_empty()) {
            if self.robot.machine().is_connected() {
                self.robot.handle_input(self.now, piece);
            }
        }
    }

    fn compare(&mut self, before: &World, path: &[Act]) {
        while let Some(event) = self.robot.poll_event() {
            match event {
                RobotEvent::Disconnect => {
                    if !self.setup.datagrams() {
                        self.lose();
                    }
                    self.robot.handle_disconnected(self.now);
                }
                RobotEvent::Unexpected(_) => panic!("{event:?}: {path:?}"),
                _ => {}
            }
        }
        let mut reported = None;
        while let Some(event) = self.pc.poll_event() {
            let executed = (0..self.setup.jobs)
                .fold(0, |mask, index| mask | u8::from(self.pc.is_executed(index)) << index);
            match event {
                PcEvent::Disconnect => {
                    if !self.setup.datagrams() {
                        self.lose();
                    }
                    self.pc.handle_disconnected(self.now);
                    if self.setup.datagrams() {
                        self.pc.handle_connected(self.now);
                    }
                }
                PcEvent::OrderOver { .. } => reported = Some(ReportedStart::Over { executed }),
                PcEvent::OutcomeUnknown { sent, .. } => {
                    reported = Some(ReportedStart::Unknown { executed, sent: sent as u8 });
                }
                PcEvent::OrderRefused { given_up: true, .. } => reported = Some(ReportedStart::GivenUp),
                PcEvent::Unexpected(_) => panic!("{event:?}: {path:?}"),
                _ => {}
            }
        }
        let open = before.starts.last().is_some_and(|start| start.reported == ReportedStart::Nothing);
        let expected = self.world.starts.last().map(|start| start.reported);
        let expected = expected.filter(|reported| {
            open && !matches!(reported, ReportedStart::Nothing | ReportedStart::Abandoned)
        });
        assert_eq!(reported, expected, "{path:?}");
        self.compare_robot(path);
        self.compare_pc(path);
        assert_eq!(self.up.len(), self.world.up.len(), "{path:?}");
        assert_eq!(self.down.len(), self.world.down.len(), "{path:?}");
    }

    fn compare_robot(&self, path: &[Act]) {
        let (mut found, model) = (self.robot.machine().clone(), &self.world.robot);
        robot::Machine::each_time(&mut found, |time| relative(time, self.now));
        assert_eq!(found.link, model.link, "{path:?}");
        assert_eq!(found.order, model.order, "{path:?}");
        assert_eq!((found.queued, found.executed), (model.queued, model.executed), "{path:?}");
        assert_eq!((found.ended, found.replies), (model.ended, model.replies), "{path:?}");
        assert_eq!(found.starts, model.starts, "{path:?}");
        assert_eq!((&found.ahead, found.acked), (&model.ahead, model.acked), "{path:?}");
        assert_eq!(found.acked_ahead, model.acked_ahead, "{path:?}");
        let due = self.robot.poll_timeout().map(|at| at.saturating_sub(self.now));
        assert_eq!(due, model.deadline(), "{path:?}");
    }

    fn compare_pc(&self, path: &[Act]) {
        let (mut found, model): (_, &machines::Pc) = (self.pc.machine().clone(), &self.world.pc);
        found.each_time(|time| relative(time, self.now));
        assert_eq!(found.link, model.link, "{path:?}");
        assert_eq!(found.order, model.order, "{path:?}");
        assert_eq!(found.commands, model.commands, "{path:?}");
        if model.order == pc::Order::Idle {
            return;
        }
        let (found, model) = (&found.count, &model.count);
        assert_eq!(
            (found.executed, found.queued, found.sent, found.total, found.is_unsure),
            (model.executed, model.queued, model.sent, model.total, model.is_unsure),
            "{path:?}"
        );
        assert_eq!(found.ahead, model.ahead, "{path:?}");
    }
}

fn new_robot(setup: &Setup) -> (LargeRobot<'static, Line>, Reader<'static, Job<Line>>) {
    let config = kawasaki_msg::RobotConfig { low_water: Some(setup.low_water), ..setup.robot };
    let (writer, reader) =
        robot_work_queue::boxed(setup.capacity, config.max_number).expect("a queue that works");
    (LargeRobot::with_ranges(config, writer, Default::default()).expect("a configuration that works"), reader)
}

fn relative(time: &mut Duration, now: Duration) {
    if *time != Duration::MAX {
        *time = time.saturating_sub(now);
    }
}

/// Returns the first messages of a packet in flight.
fn take(line: &mut Vec<Vec<Vec<u8>>>, packet: u8, count: u8) -> Vec<u8> {
    let at = usize::from(packet);
    let rest = line[at].split_off(count.into());
    let messages = if rest.is_empty() { line.remove(at) } else { core::mem::replace(&mut line[at], rest) };
    messages.concat()
}

/// Corrupts the end of a message.
fn corrupt(message: &mut [u8]) {
    if let Some(last) = message.last_mut() {
        *last = b'#';
    }
}

/// Returns the messages of a packet, as bytes and decoded.
fn read<M>(
    packet: &[u8],
    understand: impl Fn(kawasaki_msg::Role, &kawasaki_msg::Params) -> M,
) -> (Vec<Vec<u8>>, Vec<M>) {
    let mut decoder = Decoder::new(Dialect::DEFAULT.charset());
    assert_eq!(decoder.push(packet), packet.len());
    let (mut bytes, mut messages, mut at) = (Vec::new(), Vec::new(), 0);
    while let Some(frame) = decoder.next_frame() {
        let (role, params) = Dialect::DEFAULT.read(&frame.expect("a message")).expect("one of the table");
        messages.push(understand(role, &params));
        let end = decoder.position() as usize;
        bytes.push(packet[at..end].to_vec());
        at = end;
    }
    assert_eq!(at, packet.len());
    (bytes, messages)
}
