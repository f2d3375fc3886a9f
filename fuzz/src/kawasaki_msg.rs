//! Kawasaki: messages and packets, the stream of them, and both sessions at the mercy of whatever is at the other end.

use core::time::Duration;

use arbitrary::Unstructured;
use kawasaki_msg::robot_session::{Decoder as _, Session as _};
use kawasaki_msg::{
    Acks, Bounds, Charset, Decoder, Dialect, EncodeError, Job, JobKind, LargePc, LargeRobot, Limits, Line,
    Message, MessageError, Name, Packet, Params, PcConfig, PcEvent, Point, RobotConfig, RobotEvent, Role,
    Room, Supply, Value, Values,
};
use robot_work_queue::Reader;

use crate::{codecs, step, written};

/// The first byte is how long the reads are and which character set it is, the rest the stream.
pub fn kawasaki_msg_decoder(data: &[u8]) {
    let Some((&first, stream)) = data.split_first() else { return };
    codecs::decoder(&Sent::new(first), stream, first & 0x7F);
}

/// What both sides send, in one character set.
pub(crate) struct Sent {
    charset: Charset,
}

impl Sent {
    pub(crate) fn new(settings: u8) -> Self {
        Self { charset: if settings & 0x80 == 0 { Charset::Ascii } else { Charset::Latin1 } }
    }
}

impl codecs::Side for Sent {
    type Decoder = Decoder;
    /// Its bytes, as they are written.
    type Frame = Vec<u8>;

    fn decoder(&self) -> Decoder {
        Decoder::new(self.charset)
    }

    fn keep(&self, message: Message<'_>) -> Vec<u8> {
        let mut written = vec![0; message.encoded_len()];
        assert_eq!(message.encode(self.charset, &mut written), Ok(written.len()));
        written
    }

    fn check(&self, written: &Vec<u8>, _: &[u8], bytes: &[u8]) {
        let (message, used) = Message::decode(bytes, self.charset).unwrap().unwrap();
        assert_eq!(used, bytes.len());
        let (again, _) = Message::decode(written, self.charset).unwrap().unwrap();
        assert_eq!(again, message, "what is written is what was read");
        match written.len() < bytes.len() {
            true => assert_eq!(*written, plain_length(bytes), "only what is around the length is left out"),
            false => assert_eq!(written, bytes, "an accepted message encodes to its bytes"),
        }
        if let Ok((role, params)) = Dialect::DEFAULT.read(&message)
            && role != Role::Job
        {
            let mut out = [0; 256];
            let n = Dialect::DEFAULT.write(role, &params, &mut out).unwrap();
            let (again, _) = Message::decode(&out[..n], Charset::Ascii).unwrap().unwrap();
            assert_eq!(Dialect::DEFAULT.read(&again), Ok((role, params)));
        }
    }

    fn good(&self, _: usize) -> (Vec<u8>, Vec<u8>) {
        let good = b"<TilausAlkaa$4#50$1#>".to_vec();
        (good.clone(), good)
    }
}

/// The message with its length as we write it.
fn plain_length(bytes: &[u8]) -> Vec<u8> {
    let data = bytes.iter().position(|byte| *byte == b'#').unwrap();
    let length = bytes[..data].iter().rposition(|byte| *byte == b'$').unwrap();
    let digits = bytes.len() - data - "##>".len();
    [&bytes[..=length], digits.to_string().as_bytes(), &bytes[data..]].concat()
}

/// A message of any name and values: what can be written is read back the same, alone and many in a packet.
pub fn kawasaki_msg_message(data: &[u8]) {
    let mut input = Unstructured::new(data);
    let Ok((latin1, element, name)) = input.arbitrary::<(bool, u8, String)>() else { return };
    let Ok((header, fields)) = input.arbitrary::<(Vec<Any>, Vec<Any>)>() else { return };
    let charset = if latin1 { Charset::Latin1 } else { Charset::Ascii };
    let (header, fields) = (values(&header), values(&fields));
    let header = if header.is_empty() { Values::NONE } else { Values::List(&header) };
    let message = Message { name: Value::Text(&name), header, fields: Values::List(&fields) };
    match written(message.encoded_len(), |out| message.encode(charset, out)) {
        Ok(bytes) => {
            let (again, used) = Message::decode(&bytes, charset).unwrap().unwrap();
            let read = if fields == [Value::Text("")] {
                Message { fields: Values::NONE, ..message }
            } else {
                message
            };
            assert_eq!((again, used), (read, bytes.len()));
            check_packets(&message, &bytes, Limits { element: element.into(), packet: 1472 }, charset);
        }
        Err(EncodeError::NoName) => assert!(name.is_empty()),
        Err(EncodeError::Forbidden { found }) => assert!(b"<>$#".contains(&found)),
        Err(EncodeError::Character { found }) => {
            assert!(!u8::try_from(found).is_ok_and(|byte| charset.has(byte)));
        }
        Err(EncodeError::TooLong { length, limit }) => assert!(length > limit),
        Err(error) => panic!("{error}"),
    }
}

#[derive(Debug, arbitrary::Arbitrary)]
enum Any {
    Number(i32),
    Text(String),
}

fn values(any: &[Any]) -> Vec<Value<'_>> {
    let value = |any| match any {
        &Any::Number(number) => Value::Number(number),
        Any::Text(text) => Value::Text(text),
    };
    any.iter().map(value).collect()
}

/// As many of a message as a packet takes: whole ones, in strings that are full but for the last.
fn check_packets(message: &Message<'_>, bytes: &[u8], limits: Limits, charset: Charset) {
    let mut buffer = [0; 1500];
    let mut packet = Packet::new(&mut buffer, limits, charset);
    let outcome = loop {
        match packet.push(message) {
            Ok(Room::Added) => {}
            outcome => break outcome,
        }
    };
    let fits = limits.packet / bytes.len();
    let too_long = Err(EncodeError::TooLong { length: bytes.len(), limit: limits.packet });
    assert_eq!(outcome, if fits > 0 { Ok(Room::Full) } else { too_long });
    assert_eq!(packet.as_bytes(), bytes.repeat(fits));
    let element = limits.element.max(1);
    let strings: Vec<_> = packet.elements().map(<[u8]>::len).collect();
    assert_eq!(strings.len(), packet.as_bytes().len().div_ceil(element));
    assert!(strings.iter().rev().skip(1).all(|length| *length == element));
}

/// The next bytes of a script, after their number.
fn bytes<'a>(script: &mut &'a [u8]) -> &'a [u8] {
    step::<1>(script).map_or(&[], |(_, bytes)| bytes)
}

/// The next byte of a script, which is 0 after the last.
fn byte(script: &mut &[u8]) -> u8 {
    script.split_off_first().copied().unwrap_or(0)
}

/// Too long to be compared at once.
pub(crate) const WORDY: &str = "TyoJokaLuetaanYleisestiEikaNopeasti";

/// A table in which a job has that name.
pub(crate) fn wordy() -> Dialect<'static> {
    static TABLE: std::sync::OnceLock<Dialect<'static>> = std::sync::OnceLock::new();
    *TABLE.get_or_init(|| {
        let mut table = Dialect::DEFAULT.entries().to_vec();
        table.iter_mut().filter(|entry| entry.role == Role::Job).for_each(|entry| entry.name = WORDY);
        Dialect::new(table.leak()).unwrap()
    })
}

/// A robot and its motion task, which may execute no job twice and leave none out.
struct Motion {
    robot: LargeRobot<'static, Line>,
    reader: Reader<'static, Job<Line>>,
    /// The jobs of the active order that were executed.
    executed: u32,
    max_number: u16,
}

impl Motion {
    fn new(bounds: Bounds, config: RobotConfig<'static>, capacity: usize, max_number: u16) -> Self {
        let (writer, reader) = robot_work_queue::boxed(capacity, max_number).unwrap();
        let config = RobotConfig { max_number, ..config };
        Self {
            robot: LargeRobot::sized(config, writer).unwrap().with_ranges(bounds).unwrap(),
            reader,
            executed: 0,
            max_number,
        }
    }

    fn execute(&mut self, now: Duration) {
        let Some(job) = self.reader.take() else { return };
        let expected = self.executed % u32::from(self.max_number) + 1;
        assert_eq!(u32::from(job.number), expected, "no job is executed twice, and none is left out");
        assert!(self.robot.order().is_some(), "a job without an order");
        self.executed += 1;
        self.robot.job_done(now, job.number).unwrap();
        job.complete();
    }

    /// One pass of the loop; what is sent.
    fn pass(&mut self, now: Duration, connects: bool) -> (Vec<u8>, Vec<RobotEvent>) {
        self.robot.handle_timeout(now);
        let mut events = Vec::new();
        while let Some(event) = self.robot.poll_event() {
            assert!(events.len() < 40, "the queue of events is bounded");
            match event {
                RobotEvent::Connect if connects => self.robot.handle_connected(now),
                RobotEvent::Connect | RobotEvent::Disconnect => self.robot.handle_disconnected(now),
                RobotEvent::OrderStarted { .. } => self.executed = 0,
                _ => {}
            }
            events.push(event);
        }
        let mut out = [0; 4096];
        let sent =
            self.robot.poll_transmit(now, &mut out).map_or(Vec::new(), |length| out[..length].to_vec());
        assert_eq!(self.robot.poll_transmit(now, &mut out), None, "one packet in a cycle");
        let next = self.robot.poll_timeout();
        assert!(next.is_none_or(|at| at > now), "the loop would spin: {next:?} at {now:?}");
        assert!(self.robot.executed() <= self.robot.queued());
        check_packet(&sent);
        (sent, events)
    }
}

/// A packet of ours is whole messages of the table.
fn check_packet(packet: &[u8]) -> Vec<(Role, Params)> {
    let (mut decoder, mut messages) = (Decoder::new(Charset::Ascii), Vec::new());
    assert_eq!(decoder.push(packet), packet.len());
    while let Some(frame) = decoder.next_frame() {
        messages.push(Dialect::DEFAULT.read(&frame.unwrap()).unwrap());
    }
    assert_eq!(decoder.position(), packet.len() as u64);
    messages
}

/// Steps of the clock, answers good and bad, executed jobs, resets and lost connections, for a robot that reads jobs in one pass
/// and one that reads them the general way: both do the same.
pub fn kawasaki_msg_robot(mut script: &[u8]) {
    let bounds = Bounds { min: Point::new(-100, -100), max: Point::new(100_000, 100) };
    let first = byte(&mut script);
    let (capacity, max_number) = [(1, 2), (3, 5), (7, 40), (64, 9999)][usize::from(first % 4)];
    let acks = if first & 4 == 0 { Acks::Individual } else { RobotConfig::TCP.acks };
    let (refuse_repeated_start, end_foreign_order) = (first & 8 != 0, first & 16 != 0);
    let config = RobotConfig { acks, refuse_repeated_start, end_foreign_order, ..RobotConfig::TCP };
    let mut quick = Motion::new(bounds, config, capacity, max_number);
    let mut slow = Motion::new(bounds, RobotConfig { dialect: wordy(), ..config }, capacity, max_number);
    let mut now = Duration::ZERO;
    while let Some(&action) = script.split_off_first() {
        let answer = match action {
            0..=49 => bytes(&mut script).to_vec(),
            50..=149 => jobs(&mut script, &quick.robot, action),
            150..=169 => b"<TilausAlkaa$4#50$1#>".to_vec(),
            170..=174 => b"<TilausKeskeytyy$2#50#>".to_vec(),
            175..=179 => b"<TilausLoppuu$2#50#>".to_vec(),
            180..=184 => b"<Tila$7#51$2$$$#>".to_vec(),
            _ => Vec::new(),
        };
        for motion in [&mut quick, &mut slow] {
            match action {
                185..=224 => (0..=action % 8).for_each(|_| motion.execute(now)),
                225..=229 => _ = motion.robot.clear_queue(),
                230..=234 => _ = motion.robot.reset_order(),
                235..=239 => motion.robot.handle_disconnected(now),
                _ => {}
            }
        }
        now += Duration::from_millis(if action >= 240 { 1000 } else { 40 });
        let connects = action != 255;
        let (sent, events) = quick.pass(now, connects);
        let (same, others) = slow.pass(now, connects);
        assert_eq!(sent, same, "both ways of reading jobs come to the same");
        // The name that the other table has is another one in each.
        let differs = |event: &RobotEvent| match event {
            RobotEvent::Corrupt(_) => true,
            RobotEvent::Rejected(MessageError::UnknownName { name }) => {
                [WORDY, "Tyo"].map(Name::of).contains(name)
            }
            _ => false,
        };
        let known = |events: Vec<RobotEvent>| events.into_iter().filter(|e| !differs(e)).collect::<Vec<_>>();
        let dropped = |motion: &Motion| motion.robot.statistics().dropped_notices;
        if dropped(&quick) + dropped(&slow) == 0 {
            assert_eq!(known(events), known(others));
        }
        let answer = if has_long(&answer) { Vec::new() } else { unbroken(answer) };
        quick.robot.handle_input(now, &answer);
        slow.robot.handle_input(now, &renamed(&answer));
        assert_eq!(quick.robot.queued(), slow.robot.queued());
    }
}

/// A packet of jobs from about the next one on; the fuzzer's bytes say where it goes wrong.
fn jobs(script: &mut &[u8], robot: &LargeRobot<'_, Line>, action: u8) -> Vec<u8> {
    let mut number = robot.queued() + 1;
    let mut packet = Vec::new();
    for wrong in bytes(script) {
        let x = if *wrong == 255 { 1_000_000 } else { i32::from(*wrong) };
        let data = format!("50${number}$1${x}$-7$0$0");
        let length = data.len() + usize::from(*wrong == 254);
        packet.extend(format!("<Tyo${length}#{data}#>").bytes());
        number += match wrong {
            250 => 2,
            251 => 0,
            _ => 1,
        };
    }
    if action == 149 {
        packet.truncate(packet.len() / 2);
    }
    packet
}

/// Whether a message says that it is so long that the longer name makes it too long.
fn has_long(answer: &[u8]) -> bool {
    let long = |w: &[u8]| w[0] == b'$' && w[1] >= b'4' && w[1..].iter().all(u8::is_ascii_digit);
    answer.windows(5).any(long) || answer.windows(6).any(long)
}

/// An answer that does not end inside a name: what is renamed has to be whole.
fn unbroken(mut answer: Vec<u8>) -> Vec<u8> {
    let name = format!("<{WORDY}$");
    let name = name.as_bytes();
    if (1..name.len()).any(|length| answer.ends_with(&name[..length])) {
        answer.push(b'.');
    }
    answer
}

/// The same answer in the wordy table. Every place that looks like the beginning of a job is one.
fn renamed(answer: &[u8]) -> Vec<u8> {
    let mut renamed = Vec::new();
    let mut rest = answer;
    let wordy = format!("<{WORDY}$");
    let wordy = wordy.as_bytes();
    while let Some((first, tail)) = rest.split_first() {
        if let Some(tail) = rest.strip_prefix(b"<Tyo$") {
            renamed.extend(wordy);
            rest = tail;
        } else if let Some(tail) = rest.strip_prefix(wordy) {
            renamed.extend(b"<Tyo$");
            rest = tail;
        } else {
            renamed.push(*first);
            rest = tail;
        }
    }
    renamed
}

/// Steps of the clock, messages good and bad, orders and lost connections for a PC.
pub fn kawasaki_msg_pc(mut script: &[u8]) {
    let first = byte(&mut script);
    let (max_number, total) = ([2, 5, 40, 9999][usize::from(first % 4)], u32::from(first) * 3);
    let cumulative_acks = first & 4 == 0;
    let config = PcConfig {
        max_number,
        cumulative_acks,
        ..if first & 8 == 0 { PcConfig::TCP } else { PcConfig::UDP }
    };
    let mut pc = LargePc::sized(config).unwrap();
    let source = move |index: u32| if index < total { Supply::Job(line(index)) } else { Supply::End };
    let (mut now, mut out, mut heard, mut executed) = (Duration::ZERO, [0; 4096], false, 0);
    pc.handle_connected(now);
    while let Some(&action) = script.split_off_first() {
        now += Duration::from_millis(u64::from(action));
        let number = |offset: u32| (pc.executed() + offset) % u32::from(max_number) + 1;
        let order = pc.order().unwrap_or(50);
        let message = match action {
            0..=49 => bytes(&mut script).to_vec(),
            50..=99 => said("TyoPyynto", &[order.into(), number(byte(&mut script).into())]),
            100..=149 => said("TyoKuittaus", &[order.into(), number(byte(&mut script).into())]),
            150..=179 => said("TilausKuittaus", &[order.into()]),
            180..=184 => said("TilausKuittaus", &[(action % 2).into()]),
            185..=189 => said("LoppuKuittaus", &[order.into(), 0, number(0)]),
            190..=199 => said("Tila", &[order.into(), 2, number(1), number(0), 1]),
            200..=204 => {
                said("Tila", &[0, 0, number(1), number(0), u32::from(action % 2) * u32::from(order)])
            }
            _ => Vec::new(),
        };
        match action {
            205..=234 if pc.start(50 + u16::from(action % 2), source).is_ok() => executed = 0,
            235..=237 => _ = pc.end(),
            238..=240 => _ = pc.interrupt(),
            241..=245 => {
                pc.handle_disconnected(now);
                pc.handle_connected(now);
                heard = false;
            }
            _ => {}
        }
        pc.handle_input(now, &message);
        heard |= !message.is_empty();
        pc.handle_timeout(now);
        let mut events = 0;
        while let Some(event) = pc.poll_event() {
            events += 1;
            assert!(events < 50, "the queue of events is bounded");
            if event == PcEvent::Disconnect {
                pc.handle_disconnected(now);
                pc.handle_connected(now);
                heard = false;
            }
        }
        assert!(
            pc.executed() >= executed && pc.executed() <= pc.sent(),
            "executed is true and never goes back"
        );
        assert!(pc.queued() <= pc.sent() && pc.sent() <= total);
        executed = pc.executed();
        let at = now + Duration::from_millis(2);
        if let Some(length) = pc.poll_transmit(at, &mut out) {
            assert!(heard, "the PC speaks only when it is spoken to");
            check_jobs(&out[..length], &pc, config);
            assert_eq!(pc.poll_transmit(at, &mut out), None, "one answer");
            heard = false;
        }
        let next = pc.poll_timeout();
        assert!(next.is_none_or(|next| next > now), "the loop would spin: {next:?} at {now:?}");
    }
}

fn said(name: &str, values: &[u32]) -> Vec<u8> {
    let data = values.iter().map(u32::to_string).collect::<Vec<_>>().join("$");
    format!("<{name}${}#{data}#>", data.len()).into_bytes()
}

fn line(index: u32) -> Line {
    let at = |n: u32| Point::new(i32::try_from(n).unwrap(), 7);
    Line { kind: JobKind::Draw, start: at(index), end: at(index + 1) }
}

/// The jobs in an answer follow one another, each under the number of its place.
fn check_jobs<S: kawasaki_msg::JobSource>(packet: &[u8], pc: &LargePc<'_, S>, config: PcConfig<'_>) {
    assert!(!packet.is_empty() && packet.len() <= config.limits.packet);
    let mut last = None;
    check_packet(packet);
    let mut decoder = Decoder::new(Charset::Ascii);
    assert_eq!(decoder.push(packet), packet.len());
    while let Some(Ok(message)) = decoder.next_frame() {
        if message.name == "Tyo" {
            let job: Job<Line> = Dialect::DEFAULT.read_job(&message, &Bounds::WIDEST).unwrap();
            let index = u32::try_from(job.work.start.x).unwrap();
            assert_eq!(job.work, line(index));
            assert_eq!(u32::from(job.number), index % u32::from(config.max_number) + 1);
            assert!(last.is_none_or(|last| index == last + 1), "{index} after {last:?}");
            assert!(index >= pc.executed() && index < pc.sent(), "{index}");
            last = Some(index);
        }
    }
}
