//! ALTER: the messages and the stream decoder of both sides, and both sessions on any line at any time.

use core::time::Duration;

use arbitrary::Unstructured;
use robot_session::Session as _;
use val2_alter::{
    Controller, ControllerConfig, ControllerState, Decoder, End, ErrorCode, Exception, Frame, Framing, Host,
    HostConfig, HostMessage, HostState, LeadingDle, Limits, List, Message, Mode, Motion, MotionPhase, Policy,
    Received, Reply, RobotMessage, SegmentStatus, Start, StartCode, Transform,
};

use crate::{codecs, step, written};

/// The first byte is the side and the framing, the second how long the reads are, the rest the stream.
pub fn val2_alter_decoder(data: &[u8]) {
    let [options, size, stream @ ..] = data else { return };
    match options & 16 {
        0 => codecs::decoder(&Sent::robot(*options), stream, *size),
        _ => codecs::decoder(&Sent::host(*options), stream, *size),
    }
}

/// What one side sends.
pub(crate) struct Sent<M> {
    framing: Framing,
    good: M,
    /// Whether a message is written in one way.
    is_canonical: fn(&M, Framing) -> bool,
}

impl Sent<RobotMessage> {
    pub(crate) fn robot(options: u8) -> Self {
        let good = RobotMessage::End(End { error: ErrorCode::Timeout });
        let is_canonical = |message: &RobotMessage, _| match message {
            RobotMessage::Start(Start { marked, .. }) => *marked,
            RobotMessage::Motion(_) => true,
            RobotMessage::End(_) => false, // the source does not say what may follow the control byte
        };
        Self { framing: framing(options), good, is_canonical }
    }
}

impl Sent<HostMessage> {
    pub(crate) fn host(options: u8) -> Self {
        let good = HostMessage::Reply(Reply::all([1, -2, 3, -4, 0x1010, 0x0210]));
        Self { framing: framing(options), good, is_canonical: |_, framing| !framing.ignore_spare_select }
    }
}

impl<M: Message + 'static> codecs::Side for Sent<M> {
    type Decoder = Decoder<M>;
    type Frame = Received<M>;

    fn decoder(&self) -> Decoder<M> {
        Decoder::new(self.framing)
    }

    fn keep(&self, received: Received<M>) -> Received<M> {
        received
    }

    fn check(&self, received: &Received<M>, before: &[u8], bytes: &[u8]) {
        let Received { offset, length, message } = received;
        assert_eq!((*offset, *length), (before.len(), bytes.len()));
        let mut out = [0; Frame::MAX_LEN];
        let written = message.encode(self.framing, &mut out).unwrap();
        assert_eq!(written, message.encoded_len(self.framing));
        if (self.is_canonical)(message, self.framing) {
            // But for DLEs before the start mark, and a first one that was the checksum of the frame before.
            let backwards = bytes.iter().rev().chain(before.iter().rev()).take(written);
            assert!(backwards.eq(out[..written].iter().rev()), "an accepted frame encodes to its bytes");
        }
    }

    fn good(&self, offset: usize) -> (Received<M>, Vec<u8>) {
        let mut out = [0; Frame::MAX_LEN];
        let length = self.good.encode(self.framing, &mut out).unwrap();
        (Received { offset, length, message: self.good }, out[..length].to_vec())
    }
}

fn framing(options: u8) -> Framing {
    Framing {
        leading_dle: if options & 1 == 0 { LeadingDle::Two } else { LeadingDle::One },
        negated_sum: options & 2 != 0,
        stuffed_checksum: options & 4 != 0,
        ignore_spare_select: options & 8 != 0,
    }
}

/// Messages of any values in any framing: what is written is read back the same, alone and one behind the other.
pub fn val2_alter_message(data: &[u8]) {
    let mut input = Unstructured::new(data);
    let Ok((options, code)) = input.arbitrary::<(u8, u8)>() else { return };
    let (framing, mut wire) = (framing(options), Vec::new());
    if options & 16 == 0 {
        let error = ErrorCode::from(code & 7);
        let Ok((kind, mode, status, segment, percent, transform)) = input.arbitrary::<(u8, _, u8, _, _, _)>()
        else {
            return;
        };
        let phase = if kind & 16 == 0 { MotionPhase::Running } else { MotionPhase::Interrupted };
        let Ok(words) = input.arbitrary::<Vec<i16>>() else { return };
        let message = match (kind % 3, List::new(&words)) {
            (0, Ok(data)) => RobotMessage::Start(Start { error, ..Start::new(Mode(mode), data) }),
            (0, Err(_)) => return assert!(words.len() > List::MAX),
            (1, _) => RobotMessage::Motion(Motion {
                phase,
                error,
                segment_status: SegmentStatus::from(status),
                segment,
                percent,
                transform: Option::map(transform, Transform),
            }),
            _ => RobotMessage::End(End { error }),
        };
        round_trip(framing, message, &mut wire);
    } else {
        let replies = [StartCode::Accept, StartCode::Repeat, StartCode::Refuse];
        let Ok(values) = input.arbitrary() else { return };
        let message = match usize::from(options >> 5) {
            index @ 0..3 => HostMessage::StartReply(replies[index]),
            _ => HostMessage::Reply(Reply { exception: Exception::from(code), values }),
        };
        round_trip(framing, message, &mut wire);
    }
}

fn round_trip<M: Message + 'static>(framing: Framing, message: M, wire: &mut Vec<u8>) {
    let bytes = written(message.encoded_len(framing), |out| message.encode(framing, out)).unwrap();
    let (frame, used) = Frame::decode(&bytes, framing).unwrap().unwrap();
    assert_eq!((M::decode(frame.data(), framing), used), (Ok(message), bytes.len()));
    for whole in 0..bytes.len() {
        assert_eq!(Frame::decode(&bytes[..whole], framing), Ok(None), "{whole} bytes are no frame");
    }
    wire.extend(bytes.repeat(3));
    let items = codecs::items(&Sent { framing, good: message, is_canonical: |_, _| true }, wire, 7);
    assert!(items.len() == 3 && items.iter().all(|(item, _)| item.is_ok_and(|item| item.message == message)));
}

/// Steps of what the caller does, a pause in milliseconds, a length, and so many bytes from the line.
pub fn val2_alter_host(mut data: &[u8]) {
    let limits = Limits { velocity: [60; 6], acceleration: [7; 6] };
    let config = HostConfig { limits, subroutine: true, ..HostConfig::default() };
    let mut host = Host::new(config).unwrap();
    let (mut now, mut out) = (Duration::ZERO, [0; Host::MAX_TRANSMIT]);
    let (mut last, mut stood) = ([0; 6], 0);
    host.handle_connected(now);
    while let Some(([act, pause, length], bytes)) = step(&mut data) {
        now += Duration::from_millis(pause.into());
        host.handle_input(now, bytes);
        host.handle_timeout(now);
        assert!(host.poll_timeout().is_none_or(|at| at > now), "no timeout stays in the past");
        let events = core::iter::from_fn(|| host.poll_event()).count();
        assert!(events <= 16, "the queue is bounded");
        match act % 16 {
            0 => host.set_target(now, [i16::from(pause) * 100; 6]),
            1 => host.set_target(now, [-i16::from(length) * 100; 6]),
            2 => _ = host.exception(now, Exception::from(pause)),
            3 => host.stop(now),
            4 => host.set_policy(now, Policy::Accept),
            5 => host.set_policy(now, Policy::Refuse),
            6 => host.clear_target(now),
            7 => {
                host.handle_disconnected(now);
                host.handle_connected(now);
            }
            _ => {}
        }
        assert_eq!(host.statistics().unexpected, 0, "this caller keeps the contract");
        if act % 16 == 15 {
            continue; // the caller is late
        }
        if let Some(len) = host.poll_transmit(now, &mut out) {
            let (frame, used) = Frame::decode(&out[..len], Framing::DEFAULT).unwrap().unwrap();
            assert_eq!(used, len);
            // After a start, or a cycle in which the arm was at rest, the values begin again from rest.
            let statistics = host.statistics();
            let rests = statistics.starts + statistics.rejected + statistics.missed;
            let interrupted = host.state() == HostState::Interrupted;
            if core::mem::replace(&mut stood, rests) != rests || interrupted {
                last = [0; 6];
            }
            match HostMessage::decode(frame.data(), Framing::DEFAULT).unwrap() {
                HostMessage::Reply(Reply { values, .. }) => {
                    let values = values.map(Option::unwrap_or_default);
                    assert!(!interrupted || values == last, "the controller has brought the arm to rest");
                    for (value, last) in values.iter().zip(last) {
                        assert!((value - last).abs() <= 7 && value.abs() <= 60, "{last} then {value}");
                    }
                    last = values;
                }
                HostMessage::StartReply(_) => last = [0; 6],
            }
        }
        assert_eq!(host.poll_transmit(now, &mut out), None, "one answer a message");
        let waits = host.state() == HostState::Idle && host.reply_by().is_some();
        assert!(!waits, "after poll_transmit nothing is due");
    }
}

/// The same for the controller; the first byte is the mode.
pub fn val2_alter_controller(data: &[u8]) {
    let Some((mode, mut data)) = data.split_first() else { return };
    let config = ControllerConfig { mode: Mode(*mode), subroutine: mode & 0x80 != 0, ..Default::default() };
    let mut controller = Controller::new(config).unwrap();
    let (mut now, mut out) = (Duration::ZERO, [0; Frame::MAX_LEN]);
    let mut last_sent: Option<Duration> = None;
    controller.handle_connected(now);
    while let Some(([act, pause, _], bytes)) = step(&mut data) {
        now += Duration::from_millis(pause.into());
        let values = controller.values();
        let off = controller.state() == ControllerState::Off;
        controller.handle_input(now, bytes);
        controller.handle_timeout(now);
        if off {
            assert_eq!(controller.values(), values, "without ALTER the arm is at rest");
        }
        match act % 8 {
            0 | 1 if controller.start(now).is_ok() => last_sent = None,
            2 => _ = controller.finish(now),
            3 => _ = controller.resume(now),
            5 => _ = controller.interrupt(now),
            4 => {
                controller.handle_disconnected(now);
                controller.handle_connected(now);
                last_sent = None;
            }
            _ => {}
        }
        if let Some(len) = controller.poll_transmit(now, &mut out) {
            let (frame, used) = Frame::decode(&out[..len], Framing::DEFAULT).unwrap().unwrap();
            assert_eq!(used, len);
            RobotMessage::decode(frame.data(), Framing::DEFAULT).unwrap();
            let apart = last_sent.is_none_or(|last| now - last >= Duration::from_millis(15));
            assert!(apart, "two messages in one window");
            last_sent = Some(now);
        }
        assert_eq!(controller.poll_transmit(now, &mut out), None, "one message at a time");
        assert!(controller.poll_timeout().is_none_or(|at| at > now), "no timeout stays in the past");
        let events = core::iter::from_fn(|| controller.poll_event()).count();
        assert!(events <= 16, "the queue is bounded");
        assert_eq!(controller.statistics().unexpected, 0, "this caller keeps the contract");
    }
}
