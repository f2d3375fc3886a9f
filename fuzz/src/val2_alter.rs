//! ALTER: the stream decoder of both sides, and both sessions on any line at any time.

use core::time::Duration;

use val2_alter::{
    Controller, ControllerConfig, ControllerState, DecodeError, Decoder, Exception, Frame, Framing, Host,
    HostConfig, HostMessage, HostState, LeadingDle, Limits, Message, Mode, Policy, Received, Reply,
    RobotMessage, Start,
};

/// The first byte is the side and the framing, the second how long the reads are, the rest the stream.
pub fn val2_alter_decoder(data: &[u8]) {
    let [options, size, stream @ ..] = data else { return };
    let framing = Framing {
        leading_dle: if options & 1 == 0 { LeadingDle::Two } else { LeadingDle::One },
        negated_sum: options & 2 != 0,
        stuffed_checksum: options & 4 != 0,
        ignore_spare_select: options & 8 != 0,
    };
    let size = usize::from(*size).max(1);
    if options & 16 == 0 {
        check::<RobotMessage>(framing, stream, size, |message| match message {
            RobotMessage::Start(Start { marked, .. }) => *marked,
            RobotMessage::Motion(_) => true,
            RobotMessage::End(_) => false, // the source does not say what may follow the control byte
        });
    } else {
        check::<HostMessage>(framing, stream, size, |_| !framing.ignore_spare_select);
    }
}

/// `canonical` messages are written in one way.
fn check<M: Message>(framing: Framing, stream: &[u8], size: usize, canonical: impl Fn(&M) -> bool) {
    let items = decode::<M>(framing, stream, size);
    assert_eq!(items, decode(framing, stream, usize::MAX), "how the stream is cut changes nothing");
    let mut at = 0;
    for item in &items {
        let Ok(Received { offset, length, message }) = item else { continue };
        assert!(offset + 1 >= at, "the frame at {offset} begins before {at}");
        at = offset + length;
        let mut out = [0; Frame::MAX_LEN];
        let written = message.encode(framing, &mut out).unwrap();
        assert_eq!(written, message.encoded_len(framing));
        if canonical(message) {
            assert_eq!(out[..written], stream[*offset..at], "an accepted frame encodes to its bytes");
        }
    }
    assert!(at <= stream.len());
    let errors = items.iter().filter_map(|item| item.as_ref().err());
    assert!(errors.clone().all(|error| error.offset() <= stream.len()), "an error is inside the stream");
    assert!(items.len() <= stream.len(), "an item costs a byte");
    assert!(!stream.is_empty() || items.is_empty());
}

fn decode<M: Message>(framing: Framing, stream: &[u8], size: usize) -> Vec<Result<Received<M>, DecodeError>> {
    let mut decoder = Decoder::new(framing);
    let mut items = Vec::new();
    for mut chunk in stream.chunks(size) {
        while !chunk.is_empty() {
            let taken = decoder.push(chunk);
            assert!(taken > 0, "a drained decoder has room");
            chunk = &chunk[taken..];
            items.extend(core::iter::from_fn(|| decoder.next_frame()));
        }
    }
    decoder.flush();
    items.extend(core::iter::from_fn(|| decoder.next_frame()));
    assert_eq!(decoder.pending(), 0);
    items
}

/// Steps of what the caller does, a pause in milliseconds, a length, and so many bytes from the line.
pub fn val2_alter_host(mut data: &[u8]) {
    let limits = Limits { velocity: [60; 6], acceleration: [7; 6] };
    let mut host = Host::new(HostConfig { limits, subroutine: true, ..HostConfig::default() });
    let (mut now, mut out) = (Duration::ZERO, [0; Host::MAX_TRANSMIT]);
    let (mut last, mut stood) = ([0; 6], 0);
    while let [act, pause, length, rest @ ..] = data {
        let (bytes, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        data = rest;
        now += Duration::from_millis((*pause).into());
        host.handle_input(now, bytes);
        host.handle_timeout(now);
        assert!(host.poll_timeout().is_none_or(|at| at > now), "no timeout stays behind");
        let events = core::iter::from_fn(|| host.poll_event()).count();
        assert!(events <= 16, "the queue is bounded");
        match act % 8 {
            0 => host.set_target([i16::from(*pause) * 100; 6]),
            1 => host.set_target([-i16::from(*length) * 100; 6]),
            2 => drop(host.exception(Exception::from(*pause))),
            3 => host.stop(),
            4 => host.set_policy(Policy::Accept),
            5 => host.set_policy(Policy::Refuse),
            _ => {}
        }
        if act % 16 == 15 {
            continue; // the caller is late
        }
        if let Some(len) = host.poll_transmit(now, &mut out) {
            let (frame, used) = Frame::decode(&out[..len], Framing::DEFAULT).unwrap().unwrap();
            assert_eq!(used, len);
            // After a start, or a cycle in which the arm stood, the values begin again from rest.
            let stats = host.stats();
            if core::mem::replace(&mut stood, stats.starts + stats.rejected + stats.missed) != stood {
                last = [0; 6];
            }
            match HostMessage::decode(frame.data(), Framing::DEFAULT).unwrap() {
                HostMessage::Reply(Reply { values, .. }) if host.mode() == Mode::CUMULATIVE_23 => {
                    let values = values.map(Option::unwrap);
                    for (value, last) in values.iter().zip(last) {
                        assert!((value - last).abs() <= 7 && value.abs() <= 60, "{last} then {value}");
                    }
                    last = values;
                }
                HostMessage::Reply(_) | HostMessage::StartReply(_) => last = [0; 6],
            }
        }
        assert_eq!(host.poll_transmit(now, &mut out), None, "one answer a message");
        let waits = host.state() == HostState::Idle && host.reply_by().is_some();
        assert!(!waits || host.stats().damaged > 0, "only a damaged start message is answered without ALTER");
    }
}

/// The same for the controller; the first byte is the mode.
pub fn val2_alter_controller(data: &[u8]) {
    let Some((mode, mut data)) = data.split_first() else { return };
    let config = ControllerConfig { mode: Mode(*mode), subroutine: mode & 0x80 != 0, ..Default::default() };
    let mut controller = Controller::new(config);
    let (mut now, mut out) = (Duration::ZERO, [0; Frame::MAX_LEN]);
    let mut last_sent: Option<Duration> = None;
    while let [act, pause, length, rest @ ..] = data {
        let (bytes, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        data = rest;
        now += Duration::from_millis((*pause).into());
        let pose = controller.pose();
        let off = controller.state() == ControllerState::Off;
        controller.handle_input(now, bytes);
        controller.handle_timeout(now);
        if off {
            assert_eq!(controller.pose(), pose, "without ALTER the arm stands");
        }
        match act % 8 {
            0 | 1 if controller.start(now).is_ok() => last_sent = None,
            2 => controller.finish(),
            3 => controller.resume(),
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
        assert!(controller.poll_timeout().is_none_or(|at| at > now), "no timeout stays behind");
        let events = core::iter::from_fn(|| controller.poll_event()).count();
        assert!(events <= 16, "the queue is bounded");
        assert!(controller.pose().orthonormality() < 1e-9, "{:?}", controller.pose());
    }
}
