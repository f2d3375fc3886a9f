//! Both ends on a simulated line, the state tables, and every rule of the source.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Debug;
use core::time::Duration;
use std::collections::BTreeMap;

use laser_eb90::state::{ControllerInput, ControllerState, HostInput, HostState};
use laser_eb90::{
    Class, Controller, ControllerConfig, ControllerEvent, DecodeError, Doubt, EncodeError, ErrorCodes, Frame,
    Host, HostConfig, HostEvent, Instruction, Item, Payload, Profile, Refusal, SessionError, Width, Words,
    timing,
};
use robot_work_queue::Reader;
use testkit::link::{Delivery, End, Faults, Link};

const MS: Duration = Duration::from_millis(1);
/// An interpreted, an immediate and a query instruction of the default words.
const CUT: u16 = 0x0101;
const STOP: u16 = 0x0201;
const WHERE: u16 = 0x0301;

/// A cut that knows which one it is.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cut {
    index: u32,
    x: f32,
}

impl TryFrom<Instruction<'_>> for Cut {
    type Error = ();

    fn try_from(instruction: Instruction<'_>) -> Result<Self, ()> {
        let mut items = instruction.parameters;
        match (instruction.word, items.next(), items.next(), items.next()) {
            (CUT, Some(Ok(Item::I16(index))), Some(Ok(Item::F32(x))), None) => {
                let [low, high] = index.array().ok_or(())?.map(i16::cast_unsigned);
                let [x] = x.array().ok_or(())?;
                Ok(Self { index: u32::from(high) << 16 | u32::from(low), x })
            }
            _ => Err(()),
        }
    }
}

fn cut(index: u32) -> Cut {
    Cut { index, x: index as f32 * 0.25 }
}

fn write_cut(payload: &mut Payload<'_>, cut: Cut) -> Result<(), EncodeError> {
    let index = [(cut.index & 0xFFFF) as i16, (cut.index >> 16) as i16];
    payload.i16(&index)?.f32(&[cut.x]).map(drop)
}

fn controller(config: ControllerConfig, capacity: usize) -> (Controller<'static, Cut>, Reader<'static, Cut>) {
    let (writer, reader) = robot_work_queue::boxed(capacity, 9999).unwrap();
    (Controller::new(config, writer), reader)
}

/// The two ends on a line, the motion task behind the controller, and what it has executed.
struct Cell {
    now: Duration,
    link: Link,
    host: Host,
    controller: Controller<'static, Cut>,
    reader: Reader<'static, Cut>,
    /// The motion task executes nothing while it is set.
    halted: bool,
    executed: Vec<Cut>,
    events: Vec<Event>,
    frames_sent: usize,
}

#[derive(Debug, Clone, PartialEq)]
enum Event {
    Done { first: u64, count: u8, resends: u8, unanswered: u8 },
    Answer { ticket: u64, values: Vec<f32> },
    Refused { first: u64, count: u8, refusal: Refusal },
    Unknown { first: u64, count: u8, cause: Doubt },
}

impl From<HostEvent<'_>> for Event {
    fn from(event: HostEvent<'_>) -> Self {
        match event {
            HostEvent::Done { first, count, resends, unanswered } => {
                Event::Done { first, count, resends, unanswered }
            }
            HostEvent::Answer { ticket, values } => {
                let values = values.flat_map(|item| match item.unwrap() {
                    Item::F32(values) => values.iter().collect::<Vec<_>>(),
                    other => panic!("{other:?}"),
                });
                Event::Answer { ticket, values: values.collect() }
            }
            HostEvent::Refused { first, count, refusal } => Event::Refused { first, count, refusal },
            HostEvent::Unknown { first, count, cause } => Event::Unknown { first, count, cause },
        }
    }
}

impl Cell {
    fn new(seed: u64, faults: Faults, host: HostConfig, config: ControllerConfig) -> Self {
        let (controller, reader) = controller(config, 21);
        Self {
            now: Duration::ZERO,
            link: Link::new(seed, faults),
            host: Host::new(host),
            controller,
            reader,
            halted: false,
            executed: Vec::new(),
            events: Vec::new(),
            frames_sent: 0,
        }
    }

    fn clean() -> Self {
        let faults = Faults { latency: Duration::ZERO, ..Faults::NONE }.at_baud(9600);
        Self::new(1, faults, HostConfig::default(), ControllerConfig::default())
    }

    fn submit(&mut self, index: u32) -> Result<u64, SessionError> {
        self.host.submit(CUT, |payload| write_cut(payload, cut(index)))
    }

    /// Everything that can happen now, once.
    fn step(&mut self) {
        let mut out = [0; Frame::MAX_LEN];
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(End::A, self.now) {
            self.host.handle_input(self.now, &bytes);
        }
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(End::B, self.now) {
            self.controller.handle_input(self.now, &bytes);
        }
        self.host.handle_timeout(self.now);
        self.controller.handle_timeout(self.now);
        while let Some(event) = self.host.poll_event() {
            self.events.push(event.into());
        }
        while let Some(event) = self.controller.poll_event() {
            if let ControllerEvent::Execute { class, instruction } = event {
                let found = instruction.parameters.check();
                assert_eq!(found, Ok(()));
                self.controller
                    .answer(self.now, |payload| match class {
                        Class::Query => payload.f32(&[1.5, -2.5]).map(drop),
                        _ => Ok(()),
                    })
                    .unwrap();
            }
        }
        while !self.halted
            && let Some(job) = self.reader.take()
        {
            self.executed.push(job.complete());
        }
        while let Some(n) = self.host.poll_transmit(self.now, &mut out) {
            self.frames_sent += 1;
            self.link.send(End::A, self.now, &out[..n]);
        }
        while let Some(n) = self.controller.poll_transmit(self.now, &mut out) {
            self.link.send(End::B, self.now, &out[..n]);
        }
    }

    fn run_until(&mut self, end: Duration) {
        loop {
            self.step();
            let next = [self.host.poll_timeout(), self.controller.poll_timeout(), self.link.next_delivery()];
            let next = next.into_iter().flatten().min().unwrap_or(end);
            if next >= end {
                self.now = end;
                return self.step();
            }
            self.now = next.max(self.now + Duration::from_micros(100));
        }
    }

    fn run_for(&mut self, time: Duration) {
        self.run_until(self.now + time);
    }
}

fn matrix<S: Copy + Debug, I: Copy + Debug, A: Debug>(
    states: &[S],
    inputs: &[I],
    on: impl Fn(S, I) -> (S, A),
) -> String {
    let rows = states.iter().flat_map(|s| inputs.iter().map(move |i| (s, i)));
    rows.map(|(s, i)| {
        let (next, action) = on(*s, *i);
        format!("{s:?} × {i:?} -> {next:?}, {action:?}\n")
    })
    .collect()
}

#[test]
fn every_state_and_event_is_defined() {
    use ControllerInput as C;
    use HostInput as H;
    let host = [HostState::Idle, HostState::Awaiting, HostState::Resending, HostState::Held];
    let host_inputs = [
        H::Send,
        H::Echo,
        H::Refusal,
        H::LastRefusal,
        H::OtherWord,
        H::Silence,
        H::RetriedSilence,
        H::Resume,
    ];
    let controller = [ControllerState::Listening, ControllerState::Executing, ControllerState::Answering];
    let controller_inputs = [C::Decided, C::Immediate, C::Damaged, C::Done, C::Sent];
    let text = matrix(&host, &host_inputs, HostState::on)
        + &matrix(&controller, &controller_inputs, ControllerState::on);
    assert_eq!(text, include_str!("state_matrix.txt"));
}

/// §3(6): "在一个数据报里同时发送了多条指令,而下位机只需应答第一条指令": several instructions travel in one frame, and only the
/// first is answered. §2: an interpreted one is answered as soon as it is queued.
#[test]
fn seven_instructions_travel_together_and_the_first_is_answered() {
    let mut cell = Cell::clean();
    cell.halted = true;
    for index in 0..7 {
        assert_eq!(cell.submit(index), Ok(u64::from(index)));
    }
    assert_eq!(cell.submit(7), Err(SessionError::Full));
    cell.run_for(Duration::from_secs(1));
    assert_eq!(cell.events, [Event::Done { first: 0, count: 7, resends: 0, unanswered: 0 }]);
    assert_eq!(cell.frames_sent, 1);
    assert_eq!(cell.reader.len(), 7);
    cell.halted = false;
    cell.run_for(MS);
    assert_eq!(cell.executed, (0..7).map(cut).collect::<Vec<_>>());
}

/// §4.1: "在一个时钟周期内(16ms),所有任务执行一遍": an answer leaves at the end of a 16 ms cycle.
#[test]
fn an_answer_leaves_at_the_end_of_the_cycle() {
    let mut cell = Cell::clean();
    cell.submit(0).unwrap();
    cell.run_for(Duration::from_millis(30));
    assert!(cell.events.is_empty());
    // 23 bytes take 23.96 ms, the cycle ends at 32 ms, 11 bytes of answer take 11.46 ms.
    cell.run_until(Duration::from_micros(43_400));
    assert!(cell.events.is_empty());
    cell.run_until(Duration::from_micros(43_600));
    assert_eq!(cell.events.len(), 1);
}

/// §3(5): "只有在确认前一包指令正确应答之后,才可以发下一包指令": the next frame only after the answer to the last.
#[test]
fn one_frame_at_a_time() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    assert!(host.poll_transmit(MS, &mut out).is_some());
    host.submit(CUT, |p| write_cut(p, cut(1))).unwrap();
    assert_eq!(host.poll_transmit(MS * 2, &mut out), None);
    host.handle_input(MS * 3, &echo(CUT));
    assert_eq!(host.poll_transmit(MS * 3, &mut out), None, "its outcome has not been taken yet");
    assert!(host.poll_event().is_some());
    assert!(host.poll_transmit(MS * 3, &mut out).is_some());
}

fn echo(word: u16) -> Vec<u8> {
    let mut buffer = [0; 16];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    payload.word(word).unwrap();
    let mut out = Vec::new();
    payload.frame().unwrap().append_to(&mut out);
    out
}

/// §3(6): "控件只允许解释执行指令成组发送,对于立即指令,只能发送单指令数据报": immediate instructions travel alone.
#[test]
fn immediate_instructions_and_queries_travel_alone() {
    let mut cell = Cell::clean();
    cell.submit(0).unwrap();
    assert_eq!(cell.host.submit(STOP, |_| Ok(())), Err(SessionError::Full));
    cell.run_for(MS);
    cell.host.submit(STOP, |p| p.i16(&[1]).map(drop)).unwrap();
    assert_eq!(cell.submit(1), Err(SessionError::Full));
    assert_eq!(cell.host.submit(WHERE, |_| Ok(())), Err(SessionError::Full));
    cell.run_for(MS * 200);
    cell.host.submit(WHERE, |_| Ok(())).unwrap();
    cell.run_for(MS * 200);
    assert_eq!(
        cell.events,
        [
            Event::Done { first: 0, count: 1, resends: 0, unanswered: 0 },
            Event::Done { first: 1, count: 1, resends: 0, unanswered: 0 },
            Event::Answer { ticket: 2, values: vec![1.5, -2.5] },
        ]
    );
}

/// §2: "对于立即执行指令,先执行该指令,然后才返回应答": executed first, then answered, however long it takes.
#[test]
fn an_immediate_instruction_is_executed_before_it_is_answered() {
    let (mut controller, _reader) = controller(ControllerConfig::default(), 7);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &echo(STOP));
    let Some(ControllerEvent::Execute { class: Class::Immediate, instruction }) = controller.poll_event()
    else {
        panic!("nothing to execute")
    };
    assert_eq!((instruction.word, instruction.parameters.is_empty()), (STOP, true));
    assert_eq!(controller.poll_transmit(MS * 5000, &mut out), None);
    controller.answer(MS * 5001, |_| Ok(())).unwrap();
    assert_eq!(controller.poll_timeout(), Some(MS * 5008), "the end of a cycle");
    let n = controller.poll_transmit(MS * 5008, &mut out).unwrap();
    assert_eq!(out[..n], echo(STOP));
    assert_eq!(controller.answer(MS * 5009, |_| Ok(())), Err(SessionError::NotExecuting));
    assert_eq!(controller.refuse(MS * 5009, Refusal::BadParameters), Err(SessionError::NotExecuting));
}

/// §3(4): a damaged frame is dropped and answered with an error code; the host keeps a backup "直到确认接收正确了,才将其消除" and
/// sends it again.
#[test]
fn an_error_code_is_answered_from_the_backup() {
    let mut cell = Cell::clean();
    for index in 0..7 {
        cell.submit(index).unwrap();
    }
    let mut out = [0; Frame::MAX_LEN];
    let n = cell.host.poll_transmit(cell.now, &mut out).unwrap();
    let sent = out[..n].to_vec();
    let mut damaged = sent.clone();
    damaged[20] ^= 0x04;
    cell.link.send(End::A, cell.now, &damaged);
    cell.run_for(Duration::from_secs(1));
    assert_eq!(cell.events, [Event::Done { first: 0, count: 7, resends: 1, unanswered: 0 }]);
    assert_eq!(cell.executed, (0..7).map(cut).collect::<Vec<_>>());
}

#[test]
fn resends_end_at_the_limit() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    let mut now = Duration::ZERO;
    let mut frames = Vec::new();
    for _ in 0..4 {
        let n = host.poll_transmit(now, &mut out).unwrap();
        frames.push(out[..n].to_vec());
        host.handle_input(now + MS, &echo(0xE001));
        let settled = now + MS + timing::transmission_time(n, 9600) + MS * 100;
        assert_eq!(host.poll_transmit(settled - MS, &mut out), None, "the line has not settled");
        now = settled;
    }
    assert!(frames.windows(2).all(|w| w[0] == w[1]));
    assert_eq!(host.poll_transmit(now, &mut out), None);
    let event = host.poll_event().map(Event::from);
    assert_eq!(event, Some(Event::Refused { first: 0, count: 1, refusal: Refusal::BadChecksum }));
    assert!(host.is_held());
    host.submit(CUT, |p| write_cut(p, cut(1))).unwrap();
    assert_eq!(host.poll_transmit(now, &mut out), None, "held until the caller resumes");
    host.resume();
    assert!(host.poll_transmit(now, &mut out).is_some());
}

/// There is no sequence number: a lost answer looks like a lost frame, so silence must not be answered by a resend.
#[test]
fn silence_is_an_unknown_outcome_and_nothing_is_sent_again() {
    let mut cell = Cell::clean();
    cell.submit(0).unwrap();
    cell.run_until(MS * 30);
    cell.link.disconnect(cell.now);
    cell.run_for(Duration::from_secs(5));
    assert_eq!(cell.events, [Event::Unknown { first: 0, count: 1, cause: Doubt::Silence }]);
    assert_eq!((cell.frames_sent, cell.executed.len()), (1, 1));
    assert_eq!(cell.host.poll_timeout(), None);
}

#[test]
fn a_resend_on_silence_is_asked_for_and_says_what_it_may_have_done() {
    let config = HostConfig { resend_on_silence: true, ..HostConfig::default() };
    let faults = Faults::NONE.at_baud(9600);
    let mut cell = Cell::new(1, faults, config, ControllerConfig::default());
    cell.submit(0).unwrap();
    cell.run_until(MS * 35);
    cell.link.disconnect(cell.now);
    cell.link.reconnect(); // the answer, which left at 32 ms, is lost
    cell.run_for(Duration::from_secs(5));
    assert_eq!(cell.events, [Event::Done { first: 0, count: 1, resends: 1, unanswered: 1 }]);
    assert_eq!(cell.executed, [cut(0), cut(0)], "executed twice: this is why it must be asked for");
}

/// An error code speaks of the last transmission only: an unanswered one before it may have been taken.
#[test]
fn after_a_resend_on_silence_an_error_code_proves_nothing() {
    let mut host = Host::new(HostConfig { resend_on_silence: true, resends: 1, ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.poll_transmit(Duration::ZERO, &mut out).unwrap();
    host.handle_timeout(MS * 1000);
    host.poll_transmit(MS * 1200, &mut out).unwrap();
    host.handle_input(MS * 1250, &echo(0xE002));
    let event = host.poll_event().map(Event::from);
    let cause = Doubt::OtherWord { expected: CUT, found: 0xE002 };
    assert_eq!(event, Some(Event::Unknown { first: 0, count: 1, cause }));
}

/// §3(5): "将其中的命令字与保留的命令字比较,如果一样,则说明发送正确": the echo is compared with the word that was sent.
#[test]
fn another_word_in_the_answer_is_an_unknown_outcome() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.poll_transmit(MS, &mut out).unwrap();
    host.handle_input(MS * 2, &echo(0x0102));
    let event = host.poll_event().map(Event::from);
    let cause = Doubt::OtherWord { expected: CUT, found: 0x0102 };
    assert_eq!(event, Some(Event::Unknown { first: 0, count: 1, cause }));
}

#[test]
fn a_damaged_answer_is_an_unknown_outcome_that_says_what_was_wrong() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.poll_transmit(MS, &mut out).unwrap();
    let mut answer = echo(CUT);
    *answer.last_mut().unwrap() ^= 1;
    host.handle_input(MS * 2, &answer);
    assert_eq!(host.poll_event(), None, "a good answer may still follow");
    host.handle_timeout(MS * 500);
    let event = host.poll_event().map(Event::from);
    let error = DecodeError::Checksum { offset: 10, expected: 0xF4, found: 0xF5 };
    assert_eq!(event, Some(Event::Unknown { first: 0, count: 1, cause: Doubt::Damaged(error) }));
}

#[test]
fn what_comes_unasked_is_ignored() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, &echo(CUT));
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.handle_input(MS, &echo(CUT)[..7]);
    host.poll_transmit(MS, &mut out).unwrap();
    host.handle_input(MS * 2, &echo(CUT)[7..]);
    assert_eq!(host.poll_event(), None, "half of that answer came before the frame was sent");
}

#[test]
fn a_full_queue_takes_the_whole_frame_or_nothing() {
    let mut cell = Cell::clean();
    cell.halted = true;
    for batch in 0..4 {
        for index in 0..6 {
            cell.submit(batch * 6 + index).unwrap();
        }
        cell.run_for(MS * 400);
    }
    assert_eq!(cell.reader.len(), 18, "three are free, six do not fit");
    assert_eq!(cell.events.len(), 3);
    assert!(cell.frames_sent > 4, "asks again and again: {}", cell.frames_sent);
    cell.halted = false;
    cell.run_for(MS * 400);
    assert_eq!(cell.events.len(), 4);
    assert_eq!(cell.events[3], Event::Done { first: 18, count: 6, resends: 0, unanswered: 0 });
    assert_eq!(cell.executed, (0..24).map(cut).collect::<Vec<_>>());
}

#[test]
fn a_queue_that_stays_full_is_a_refusal() {
    let mut cell = Cell::clean();
    cell.halted = true;
    for batch in 0..4 {
        for index in 0..7 {
            cell.submit(batch * 7 + index).unwrap();
        }
        cell.run_for(MS * 500);
    }
    cell.run_for(Duration::from_secs(61));
    assert_eq!(cell.events[3], Event::Refused { first: 21, count: 7, refusal: Refusal::QueueFull });
    cell.halted = false;
    cell.run_for(Duration::from_secs(1));
    assert_eq!(cell.executed, (0..21).map(cut).collect::<Vec<_>>());
}

fn send_to_controller(stream: &[u8]) -> (Option<Vec<u8>>, usize) {
    let (mut controller, reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, stream);
    let mut answers = Vec::new();
    for ms in 2..300 {
        if let Some(n) = controller.poll_transmit(MS * ms, &mut out) {
            answers.push(out[..n].to_vec());
        }
    }
    assert!(answers.len() <= 1, "two answers: {answers:02X?}");
    (answers.pop(), reader.len())
}

fn frame(indices: &[u32], extra: impl FnOnce(&mut Payload<'_>)) -> Vec<u8> {
    let mut buffer = [0; 512];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    for index in indices {
        payload.word(CUT).unwrap();
        write_cut(&mut payload, cut(*index)).unwrap();
    }
    extra(&mut payload);
    let mut out = Vec::new();
    payload.frame().unwrap().append_to(&mut out);
    out
}

/// Two answers to one frame would make the host send it again, and the robot execute it twice.
#[test]
fn a_stretch_of_bytes_is_answered_once() {
    let good = frame(&[1, 2], |_| ());
    let mut bad = good.clone();
    bad[9] ^= 0x40;
    let junk = [0x55; 40];
    let queued = |stream: &[&[u8]]| send_to_controller(&stream.concat());
    assert_eq!(queued(&[&good]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&junk, &good]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&bad, &good]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&good, &bad]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&good, &junk]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&bad]), (Some(echo(0xE001)), 0));
    assert_eq!(queued(&[&bad, &bad]), (Some(echo(0xE001)), 0));
    assert_eq!(queued(&[&junk]), (Some(echo(0xE002)), 0));
    assert_eq!(queued(&[&good[..good.len() - 1]]), (Some(echo(0xE002)), 0));
    assert_eq!(queued(&[&junk[..Frame::MIN_LEN - 1]]), (None, 0), "too short for a frame");
    assert_eq!(queued(&[&[0xEB, 0x90, 0x82, 0x00]]), (None, 0), "a false head in noise");
}

#[test]
fn what_the_controller_refuses() {
    let refused = |frame: Vec<u8>| {
        let (answer, queued) = send_to_controller(&frame);
        assert_eq!(queued, 0, "nothing of a refused frame is queued");
        answer.unwrap()
    };
    assert_eq!(refused(echo(0x7777)), echo(0xE003));
    assert_eq!(refused(frame(&[1, 2, 3, 4, 5, 6, 7, 8], |_| ())), echo(0xE004));
    assert_eq!(refused(frame(&[1], |p| drop(p.word(STOP)))), echo(0xE004));
    assert_eq!(refused(frame(&[1], |p| drop(p.word(0x7777)))), echo(0xE003));
    assert_eq!(refused(frame(&[1], |p| drop(p.word(CUT)))), echo(0xE005));
    assert_eq!(refused(frame(&[], |p| drop(p.u8(&[1])))), echo(0xE002));
}

/// The host has stopped waiting for the first answer: it would take it for the second's.
#[test]
fn a_frame_withdraws_the_answer_that_it_overtakes() {
    let (mut controller, mut reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &echo(STOP));
    assert!(controller.poll_event().is_some());
    controller.handle_input(MS * 100, &frame(&[5], |_| ()));
    assert!(reader.is_empty(), "the robot is busy");
    controller.answer(MS * 200, |_| Ok(())).unwrap();
    let n = controller.poll_transmit(MS * 208, &mut out).unwrap();
    assert_eq!(out[..n], echo(CUT));
    assert_eq!(controller.poll_transmit(MS * 300, &mut out), None);
    assert_eq!(reader.take().map(|job| *job), Some(cut(5)));
}

#[test]
fn the_controller_does_not_speak_while_it_hears() {
    let (mut controller, _reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &frame(&[1], |_| ()));
    controller.handle_input(MS * 10, &frame(&[2], |_| ())[..9]);
    assert_eq!(controller.poll_transmit(MS * 16, &mut out), None);
    assert_eq!(controller.poll_timeout(), Some(MS * 60));
    let n = controller.poll_transmit(MS * 60, &mut out).unwrap();
    assert_eq!(out[..n], echo(CUT), "the rest never came");
    assert_eq!(controller.poll_transmit(MS * 200, &mut out), None);
}

/// A PC that pauses within a frame gets an error code for each half. The second must not be taken for the answer to the
/// resend, which would then be sent, and executed, twice.
#[test]
fn a_second_error_code_for_the_same_damage_is_not_the_resends() {
    let mut cell = Cell::clean();
    for index in 0..7 {
        cell.submit(index).unwrap();
    }
    let mut out = [0; Frame::MAX_LEN];
    let n = cell.host.poll_transmit(cell.now, &mut out).unwrap();
    let (head, tail) = out[..n].split_at(n / 2);
    cell.link.send(End::A, cell.now, head);
    cell.run_until(MS * 140); // an error code has come at 124 ms
    cell.link.send(End::A, cell.now, tail);
    cell.run_for(Duration::from_secs(3));
    assert_eq!(cell.events.len(), 1);
    assert_eq!(cell.executed, (0..7).map(cut).collect::<Vec<_>>());
}

#[test]
fn a_controller_that_restarts_within_a_batch_leaves_it_unknown() {
    let mut cell = Cell::clean();
    for index in 0..7 {
        cell.submit(index).unwrap();
    }
    cell.run_until(MS * 126); // the frame takes 124 ms, the cycle ends at 128 ms
    assert_eq!(cell.executed.len(), 7, "queued and executed, but not answered");
    (cell.controller, cell.reader) = controller(ControllerConfig::default(), 21);
    cell.run_for(Duration::from_secs(5));
    assert_eq!(cell.events, [Event::Unknown { first: 0, count: 7, cause: Doubt::Silence }]);
    assert_eq!((cell.frames_sent, cell.executed.len()), (1, 7), "not sent again");
}

#[test]
fn parameters_that_read_as_a_command_word_are_refused() {
    let mut host = Host::new(HostConfig::default());
    assert_eq!(host.submit(CUT, |p| p.i16(&[1]).map(drop)), Err(SessionError::LoneShort));
    assert_eq!(host.submit(0x7777, |_| Ok(())), Err(SessionError::UnknownWord { word: 0x7777 }));
    let error = EncodeError::TooManyValues { count: 256 };
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 256]).map(drop)), Err(SessionError::Encode(error)));
    assert!(host.is_idle());
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 255]).map(drop)), Ok(0));
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 255]).map(drop)), Err(SessionError::Full), "512 bytes");
    assert_eq!(host.take_back(), 1);
    assert!(host.is_idle());
}

#[test]
fn every_word_has_one_meaning() {
    const TWICE: &[(core::ops::RangeInclusive<u16>, Class)] =
        &[(1..=9, Class::Interpreted), (5..=20, Class::Immediate)];
    const ERROR: &[(core::ops::RangeInclusive<u16>, Class)] = &[(0xE000..=0xE00F, Class::Query)];
    let message = |words: Result<Words, SessionError>| words.unwrap_err().to_string();
    assert_eq!(
        message(Words::new(TWICE, ErrorCodes::default())),
        "0005h is a command word and a command word at once"
    );
    assert_eq!(
        message(Words::new(ERROR, ErrorCodes::default())),
        "E001h is a command word and an error code at once"
    );
    let codes = ErrorCodes { queue_full: 0xE001, ..ErrorCodes::default() };
    assert_eq!(message(Words::new(&[], codes)), "E001h is an error code and an error code at once");
    let words = Words::default();
    assert_eq!(
        [0x00FF, 0x0100, 0x01FF, 0x0200, 0x02FF, 0x0300, 0x03FF, 0x0400].map(|word| words.class(word)),
        [
            None,
            Some(Class::Interpreted),
            Some(Class::Interpreted),
            Some(Class::Immediate),
            Some(Class::Immediate),
            Some(Class::Query),
            Some(Class::Query),
            None
        ]
    );
}

#[test]
fn a_cycle_ends_at_its_multiples() {
    let end = |micros| timing::end_of_tick(Duration::from_micros(micros), timing::TICK).as_micros();
    assert_eq!([0, 1, 15_999, 16_000, 16_001].map(end), [0, 16_000, 16_000, 16_000, 32_000]);
    assert_eq!(timing::end_of_tick(MS, Duration::ZERO), MS);
    assert_eq!(timing::transmission_time(217, 9600).as_micros(), 226_041);
    assert_eq!(timing::exchange_time(217, 11, 9600, timing::TICK).as_micros(), 253_500);
    assert_eq!(timing::transmission_time(1, 0), Duration::MAX);
    // An instruction of 30 bytes at 9600 baud: 64 ms alone, 240 ms for seven.
    assert_eq!(timing::period(37, 11, 9600, timing::TICK), MS * 64);
    assert_eq!(timing::period(217, 11, 9600, timing::TICK), MS * 240);
}

/// What the host says of an instruction.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Known {
    Taken,
    Refused,
    Nothing,
}

/// How a run over a bad line ended.
#[derive(Debug, Default)]
struct Count {
    sent: u32,
    unknown: u32,
    refused: u32,
    /// Executed, though nobody sent it: damage that the checksum could not see.
    invented: u32,
    /// Neither executed nor reported.
    lost: u32,
    /// Executed twice, or executed though reported as refused.
    repeated: u32,
    resends: u32,
}

/// Sends cuts over a bad line until `cuts` have been reported.
fn run_over(seed: u64, faults: Faults, checksum: Width, cuts: u32, count: &mut Count) {
    let profile = Profile { checksum, ..Profile::default() };
    let host = HostConfig { profile, baud: 115_200, ..HostConfig::default() };
    let mut cell = Cell::new(
        seed,
        faults.at_baud(115_200),
        host,
        ControllerConfig { profile, ..ControllerConfig::default() },
    );
    let mut status: Vec<Option<Known>> = vec![None; cuts as usize];
    let mut next = 0;
    while status.iter().any(Option::is_none) {
        while next < cuts && cell.submit(next).is_ok() {
            next += 1;
        }
        cell.run_for(MS * 5);
        for event in cell.events.drain(..) {
            let (first, number, known) = match event {
                Event::Done { first, count: number, resends, unanswered: 0 } => {
                    count.resends += u32::from(resends);
                    (first, number, Known::Taken)
                }
                Event::Refused { first, count, .. } => (first, count, Known::Refused),
                Event::Unknown { first, count, .. } => (first, count, Known::Nothing),
                other => panic!("{other:?}"),
            };
            for ticket in first..first + u64::from(number) {
                assert_eq!(status[usize::try_from(ticket).unwrap()].replace(known), None, "reported twice");
            }
        }
        cell.host.resume();
        assert!(cell.now < Duration::from_secs(3600), "stands still");
    }
    cell.run_for(Duration::from_secs(1));
    let mut times = BTreeMap::<u32, u32>::new();
    for job in &cell.executed {
        if job.index < cuts && *job == cut(job.index) {
            *times.entry(job.index).or_default() += 1;
        } else {
            count.invented += 1;
        }
    }
    count.sent += cuts;
    for (index, known) in (0..).zip(status) {
        let times = times.get(&index).copied().unwrap_or(0);
        count.unknown += u32::from(known == Some(Known::Nothing));
        count.refused += u32::from(known == Some(Known::Refused));
        count.repeated += u32::from(times > 1 || (known == Some(Known::Refused) && times > 0));
        count.lost += u32::from(known == Some(Known::Taken) && times == 0);
    }
}

const BYTE_IN_1000: Faults = Faults {
    flip: 0.0004,
    lose_byte: 0.0003,
    insert: 0.0003,
    split: 0.3,
    merge: 0.3,
    delay: 0.05,
    max_delay: Duration::from_millis(20),
    ..Faults::NONE
};

/// One byte in 1000 damaged: every instruction is executed exactly once or reported unknown. Where the checksum cannot see
/// the damage, an instruction that nobody sent stands in for one that was.
#[test]
fn every_instruction_is_executed_once_or_reported_unknown() {
    let mut count = Count::default();
    for seed in 0..40 {
        run_over(seed, BYTE_IN_1000, Width::U8, 200, &mut count);
    }
    println!("{count:?}");
    assert_eq!(count.repeated, 0, "{count:?}");
    assert!(count.lost <= count.invented, "{count:?}");
    assert!(count.resends > 50 && count.unknown > 50, "the line was bad: {count:?}");
}

#[test]
fn a_line_that_also_falls_silent_loses_nothing_unreported() {
    let mut count = Count::default();
    for seed in 0..40 {
        run_over(seed, Faults::SERIAL, Width::U16Le, 100, &mut count);
    }
    println!("{count:?}");
    assert_eq!(count.repeated, 0, "{count:?}");
    assert!(count.lost <= count.invented, "{count:?}");
}
