//! isra-ball: a packet of the ball, and both ends of a poll.

use std::hint::black_box;
use std::time::Duration;

use benches::{Budget, Count, Link, Timing};
use isra_ball::robot_session::{Decoder as _, Encode as _, Session as _};
use isra_ball::{
    Ball, BallConfig, BallEvent, Decoder, ENQ, Frame, Host, HostConfig, HostEvent, Keys, Packet, Status,
    timing,
};

use super::streams::{self, Decoding};
use benches::frames::BALL_PACKET as BYTES;

pub(super) const LINK: Link = Link {
    name: "isra-ball",
    counts: &[
        Count::op("decode a packet", decode).goal(45.0).timed_bytes("decode", Timing::OURS, Packet::LEN),
        Count::op("… by hand", decode_by_hand).timed_bytes("decode", Timing::BY_HAND, Packet::LEN),
        Count::op("decode a packet from the stream", stream),
        Count::op("host: poll, receive the packet", poll).timed("host", Timing::OURS),
        Count::op("ball: new values, receive the poll, send the packet", answer).timed("ball", Timing::OURS),
        Count::op("encode a packet", encode).timed_bytes("encode", Timing::OURS, Packet::LEN),
    ],
    streams: &[streams::rows::<Packets>()],
    budgets,
    ..Link::EMPTY
};

struct Packets;

impl Decoding for Packets {
    type Decoder = Decoder;
    const LEN: usize = Packet::LEN;
    const FRAMES: usize = 1;

    fn decoder() -> Decoder {
        Decoder::new()
    }

    fn valid() -> Vec<u8> {
        BYTES.to_vec()
    }

    /// Heads of packets of 255 bytes, and nothing else.
    fn worst() -> Vec<u8> {
        streams::repeated(&[0xFF, 0x01, 0xAA])
    }
}

fn decode(rounds: u64) {
    for _ in 0..rounds {
        let bytes: &[u8] = black_box(&BYTES);
        let Ok(Some((frame, _))) = Frame::decode(bytes) else { panic!("a good packet") };
        black_box(frame.packet().expect("eight data bytes"));
    }
}

/// Decodes one layout, with header and checksum in one comparison; bytes that are not a packet end the program.
fn decode_by_hand(rounds: u64) {
    for _ in 0..rounds {
        let bytes: &[u8] = black_box(&BYTES);
        let Ok(bytes) = <&[u8; 12]>::try_from(bytes) else { panic!("a whole packet") };
        let (head, rest) = bytes.split_first_chunk::<4>().expect("twelve bytes");
        let sum = rest.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        assert!(u32::from_le_bytes(*head).wrapping_add(u32::from(sum) << 24) == 0xF85D_F808);
        let &[_, _, _, id, x, y, z, mx, my, mz, keys, _] = bytes;
        let status = match id & 0x88 {
            0x00 => Status::Fresh,
            0x08 => Status::Reserved,
            0x80 => Status::Old,
            _ => Status::Reserved11,
        };
        black_box(Packet {
            sensor_type: id >> 4 & 7,
            sensor: id & 7,
            status,
            force: [x, y, z].map(u8::cast_signed),
            moment: [mx, my, mz].map(u8::cast_signed),
            keys: Keys(keys),
        });
    }
}

fn stream(rounds: u64) {
    let mut decoder = Decoder::new();
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(&BYTES)), 12);
        let frame = decoder.next_frame().expect("a whole packet").expect("a good packet");
        black_box(frame.packet().expect("eight data bytes"));
    }
}

/// Runs polls: three deadlines and an event for twelve bytes, so that the codec is the smaller part.
fn poll(rounds: u64) {
    let config = HostConfig::default();
    let exchange = timing::exchange_time(config.baud);
    let mut host = Host::new(config).expect("the defaults work");
    let mut now = config.quiet();
    host.handle_connected(Duration::ZERO);
    let mut out = [0];
    for _ in 0..rounds {
        now += config.period;
        assert_eq!(host.poll_transmit(now, black_box(&mut out)), Some(1));
        host.handle_input(now + exchange, black_box(&BYTES));
        assert!(matches!(black_box(host.poll_event()), Some(HostEvent::Packet(_) | HostEvent::Old(_))));
    }
}

fn answer(rounds: u64) {
    let mut ball = Ball::new(BallConfig::default()).expect("the defaults work");
    ball.handle_connected(Duration::ZERO);
    let mut out = [0; Packet::LEN];
    for _ in 0..rounds {
        ball.measure(black_box([1, -2, 3]), black_box([-4, 5, -6]), black_box(Keys(0x81)));
        ball.handle_input(Duration::ZERO, black_box(&[ENQ]));
        assert_eq!(ball.poll_transmit(Duration::ZERO, black_box(&mut out)), Some(Packet::LEN));
        assert!(matches!(black_box(ball.poll_event()), Some(BallEvent::Reply(_))));
    }
}

fn encode(rounds: u64) {
    let (frame, _) = Frame::decode(&BYTES).expect("good").expect("whole");
    let packet = frame.packet().expect("eight data bytes");
    let mut out = [0; Packet::LEN];
    for _ in 0..rounds {
        black_box(&packet).encode(black_box(&mut out)).expect("it fits");
    }
}

fn budgets() -> Vec<Budget> {
    vec![
        Budget {
            what: "ENQ and its packet at 9600 baud, in the robot's cycle".into(),
            takes: timing::exchange_time(timing::BAUD),
            window: Duration::from_millis(28),
            source: "§4.1, §3.4",
        },
        Budget {
            what: "ENQ and its packet at 9600 baud, in the shortest poll period".into(),
            takes: timing::exchange_time(timing::BAUD),
            window: timing::min_period(timing::BAUD),
            source: "§4.2",
        },
    ]
}
