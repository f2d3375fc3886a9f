//! The ISRA ball: its packets, its stream decoder, and both ends on any line at any time.

use core::time::Duration;

use arbitrary::Unstructured;
use isra_ball::robot_session::{Encode as _, Session as _};
use isra_ball::{
    Ball, BallConfig, BallEvent, Decoder, Frame, Host, HostConfig, HostEvent, Keys, Packet, Status, timing,
};

use crate::{codecs, step, written};

const GOOD: Packet = Packet {
    sensor_type: 1,
    sensor: 2,
    status: Status::Fresh,
    force: [1, -2, 3],
    moment: [-4, 5, -6],
    keys: Keys(0x81),
};

/// The first byte is how long the reads are, the rest the stream.
pub fn isra_ball_decoder(data: &[u8]) {
    let Some((&size, stream)) = data.split_first() else { return };
    codecs::decoder(&Sent, stream, size);
}

/// What the ball sends.
pub(crate) struct Sent;

impl codecs::Side for Sent {
    type Decoder = Decoder;
    type Frame = Vec<u8>;

    fn decoder(&self) -> Decoder {
        Decoder::new()
    }

    fn keep(&self, frame: Frame<'_>) -> Vec<u8> {
        frame.data().to_vec()
    }

    fn check(&self, data: &Vec<u8>, _: &[u8], bytes: &[u8]) {
        let frame = Frame::new(data).unwrap();
        assert_eq!(Frame::decode(bytes), Ok(Some((frame, bytes.len()))));
        assert_eq!(frame.encoded_len(), bytes.len());
        if let Ok(packet) = frame.packet() {
            assert_eq!(packet.to_bytes().unwrap(), bytes, "an accepted packet encodes to its bytes");
        }
    }

    fn good(&self, _: usize) -> (Vec<u8>, Vec<u8>) {
        let bytes = GOOD.to_bytes().unwrap();
        (Frame::decode(&bytes).unwrap().unwrap().0.data().to_vec(), bytes.to_vec())
    }
}

/// A packet of any values: what can be written is read back the same.
pub fn isra_ball_message(data: &[u8]) {
    let mut input = Unstructured::new(data);
    let Ok((sensor_type, sensor, status, keys)) = input.arbitrary::<(u8, u8, u8, u8)>() else { return };
    let Ok([force, moment]) = input.arbitrary::<[[i8; 3]; 2]>() else { return };
    let statuses = [Status::Fresh, Status::Old, Status::Reserved, Status::Reserved11];
    let status = statuses[usize::from(status & 3)];
    let packet = Packet { sensor_type, sensor, status, force, moment, keys: Keys(keys) };
    match written(packet.encoded_len(), |out| packet.encode(out)) {
        Ok(bytes) => {
            let (frame, used) = Frame::decode(&bytes).unwrap().unwrap();
            assert_eq!((frame.packet(), used), (Ok(packet), bytes.len()));
            assert_eq!(written(frame.encoded_len(), |out| frame.encode(out)), Ok(bytes));
        }
        Err(error) => assert!(sensor_type > 7 || sensor > 7, "{error}"),
    }
}

/// Steps of an action, a length, and so many bytes from the line.
pub fn isra_ball_ball(mut data: &[u8]) {
    let config = BallConfig { sensor_type: GOOD.sensor_type, sensor: GOOD.sensor, ..BallConfig::default() };
    let mut ball = Ball::new(config).unwrap();
    let (mut out, now) = ([0; Packet::LEN], Duration::ZERO);
    let (mut connected, mut asked, mut measured) = (false, 0, GOOD);
    while let Some(([action, length], bytes)) = step(&mut data) {
        if action & 1 == 1 {
            measured =
                Packet { force: [action.cast_signed(); 3], moment: [0; 3], keys: Keys(length), ..GOOD };
            ball.measure(measured.force, measured.moment, measured.keys);
        }
        match action >> 2 & 7 {
            0 => (connected, asked) = (false, 0),
            1 => (connected, asked) = (true, 0),
            _ => {}
        }
        match action >> 2 & 7 {
            0 => ball.handle_disconnected(now),
            1 => ball.handle_connected(now),
            _ => {}
        }
        ball.handle_input(now, bytes);
        if connected {
            asked += bytes.iter().filter(|byte| **byte == isra_ball::ENQ).count();
        }
        assert_eq!(ball.poll_timeout(), None);
        if action & 2 != 0 {
            continue; // the caller is late
        }
        let events = core::iter::from_fn(|| ball.poll_event()).count();
        assert!(events <= 8, "the queue is bounded");
        if ball.poll_transmit(now, &mut out).is_some() {
            assert!(connected && asked > 0, "the ball sends nothing unasked");
            asked = 0;
            let (frame, used) = Frame::decode(&out).unwrap().unwrap();
            assert_eq!(used, Packet::LEN);
            let packet = frame.packet().unwrap();
            assert_eq!(ball.poll_event(), Some(BallEvent::Reply(packet)));
            if packet.status == Status::Fresh {
                assert_eq!(packet, measured, "new values are the newest");
            }
        }
        assert_eq!(ball.poll_transmit(now, &mut out), None, "one reply at a time");
    }
}

/// Steps of a pause in milliseconds, a length, and so many bytes from the line. The longest pause is a new connection.
pub fn isra_ball_host(mut data: &[u8]) {
    let config = HostConfig::default();
    let mut host = Host::new(config).unwrap();
    let (mut now, mut last_poll, mut out) = (Duration::ZERO, None, [0; 16]);
    let (mut open, mut is_live) = (false, false);
    host.handle_connected(now);
    while let Some(([pause, _], bytes)) = step(&mut data) {
        now += Duration::from_millis(pause.into());
        if pause == 255 {
            host.handle_connected(now);
        }
        host.handle_input(now, bytes);
        let mut events = 0;
        while let Some(event) = host.poll_event() {
            events += 1;
            assert!(events <= 8, "the queue is bounded");
            match event {
                HostEvent::Packet(_) | HostEvent::Old(_) | HostEvent::Missed => {
                    assert!(open, "a poll has one outcome");
                    open = false;
                    is_live |= matches!(event, HostEvent::Packet(_));
                    if let HostEvent::Packet(packet) = event {
                        assert!(packet.status.is_fresh());
                    }
                }
                HostEvent::Stale => {
                    assert!(is_live, "stale, once");
                    is_live = false;
                }
                HostEvent::Unexpected(unexpected) => panic!("{unexpected}"),
                _ => {}
            }
        }
        assert_eq!(host.live_until().is_some(), is_live);
        assert!(host.live_until().is_none_or(|until| now < until && until < now + config.max_age));
        if host.poll_transmit(now, &mut out).is_some() {
            assert_eq!(out[0], isra_ball::ENQ);
            assert!(!open, "one poll at a time");
            open = true;
            assert!(last_poll.is_none_or(|last| now - last >= timing::min_period(9600)), "polled too fast");
            last_poll = Some(now);
        }
        assert_eq!(host.poll_transmit(now, &mut out), None, "one poll at a time");
        assert!(host.poll_timeout().unwrap() > now || host.poll_event().is_some());
    }
}
