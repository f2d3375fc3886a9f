//! val2-viewer: a pose as a line of text, and both ends of its exchange.

use std::hint::black_box;
use std::time::Duration;

use benches::{Budget, Count, Link, Timing};
use val2_viewer::robot_session::{Decoder as _, Encode as _, Session as _};
use val2_viewer::{
    Decoder, ENQ, Host, HostConfig, HostEvent, PosePacket, Workstation, WorkstationConfig, WorkstationEvent,
    timing,
};

use super::streams::{self, Decoding};
use benches::frames::VIEWER_POSE as LINE;

pub(super) const LINK: Link = Link {
    name: "val2-viewer",
    counts: &[
        Count::op("decode a pose", decode).timed_bytes("decode", Timing::OURS, LINE.len()),
        Count::op("decode a pose from the stream", stream),
        Count::op("encode a pose", encode).timed_bytes("encode", Timing::OURS, LINE.len()),
        Count::op("host: a new pose, receive ENQ, send the pose", answer).timed("host", Timing::OURS),
        Count::op("workstation: draw, send ENQ, receive the pose", draw).timed("workstation", Timing::OURS),
    ],
    streams: &[streams::rows::<Poses>()],
    budgets,
    ..Link::EMPTY
};

struct Poses;

impl Decoding for Poses {
    type Decoder = Decoder;
    const LEN: usize = LINE.len();
    const FRAMES: usize = 1;

    fn decoder() -> Decoder {
        Decoder::new()
    }

    fn valid() -> Vec<u8> {
        LINE.to_vec()
    }

    fn worst() -> Vec<u8> {
        streams::repeated(b"$")
    }
}

fn decode(rounds: u64) {
    for _ in 0..rounds {
        let Ok(Some(packet)) = PosePacket::decode(black_box(LINE)) else { panic!("a good line") };
        black_box(packet);
    }
}

fn stream(rounds: u64) {
    let mut decoder = Decoder::new();
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(LINE)), LINE.len());
        black_box(decoder.next_frame().expect("a whole line").expect("a good line"));
    }
}

fn packet() -> PosePacket {
    PosePacket::decode(LINE).expect("good").expect("whole").0
}

fn encode(rounds: u64) {
    let packet = packet();
    let mut out = [0; PosePacket::MAX_LEN];
    for _ in 0..rounds {
        black_box(&packet).encode(black_box(&mut out)).expect("it fits");
    }
}

fn answer(rounds: u64) {
    let config = HostConfig::default();
    let mut host = Host::new(config).expect("the defaults work");
    let (pose, mut out, mut now) = (packet().pose, [0; Host::MAX_TRANSMIT], Duration::ZERO);
    host.handle_connected(now);
    for _ in 0..rounds {
        now += config.interval;
        host.set_pose(now, black_box(pose));
        host.handle_input(now, black_box(&[ENQ]));
        assert!(black_box(host.poll_transmit(now, black_box(&mut out))).is_some());
        assert_eq!(host.poll_event(), Some(HostEvent::Asked));
        assert!(matches!(black_box(host.poll_event()), Some(HostEvent::Sent(_))));
    }
}

fn draw(rounds: u64) {
    let mut workstation = Workstation::new(WorkstationConfig::default()).expect("the defaults work");
    let (mut out, mut now) = ([0], Duration::ZERO);
    workstation.handle_connected(now);
    for _ in 0..rounds {
        now += timing::CYCLE;
        workstation.draw(now);
        assert_eq!(workstation.poll_transmit(now, black_box(&mut out)), Some(1));
        workstation.handle_input(now, black_box(LINE));
        assert!(matches!(black_box(workstation.poll_event()), Some(WorkstationEvent::Pose(_))));
    }
}

fn budgets() -> Vec<Budget> {
    vec![Budget {
        what: "ENQ and the longest pose at 19200 baud, in a display cycle".into(),
        takes: timing::exchange_time(timing::BAUD),
        window: timing::CYCLE,
        source: "§5",
    }]
}
