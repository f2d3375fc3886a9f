//! mmacell-proto: a status of 50 characters, a motion, and both ends of STA.

use core::time::Duration;
use std::hint::black_box;

use benches::{Count, Link, Ratio, Timing};
use mmacell_proto::robot_session::Decoder as _;
use mmacell_proto::robot_session::{Encode as _, Session as _};
use mmacell_proto::{
    Central, CentralConfig, Command, Decoder, Device, DeviceConfig, Dialect, Line, Mode, Reply, RobotPose,
};

use super::streams::{self, Decoding};
use benches::frames::MMA_STATUS as STATUS;

const MOVE: &[u8; 38] = b"MOVA+010.000-002.000+005.999-01.2322\r\n";

const STATUS_READ: &str = "the same from a stream, through the decoder";
const STATUS_WRITTEN: &str = "write the status";
const STA_READ: &str = "STA from a stream, through the decoder";
const STA_WRITTEN: &str = "write STA";
const DEVICE: &str = "device: receive STA, send the status";
const CENTRAL: &str = "central: send STA, receive the status";

pub(super) const LINK: Link = Link {
    name: "mmacell-proto",
    counts: &[
        Count::op("50 characters: the end found, the status read", find_and_parse).goal(220.0).timed_bytes(
            "decode",
            Timing::OURS,
            STATUS.len(),
        ),
        Count::op("… by hand, eight characters at a time", by_hand).timed_bytes(
            "decode",
            Timing::BY_HAND,
            STATUS.len(),
        ),
        Count::op("of that, the status", parse),
        Count::op(STATUS_READ, stream),
        Count::op(STATUS_WRITTEN, write_status).timed_bytes("encode", Timing::OURS, STATUS.len()),
        Count::op(STA_READ, stream_command),
        Count::op(STA_WRITTEN, write_command),
        Count::op("parse a robot's motion", parse_motion).timed_bytes(
            "decode-motion",
            Timing::OURS,
            MOVE.len(),
        ),
        Count::op("encode a robot's motion", encode).timed_bytes("encode-motion", Timing::OURS, MOVE.len()),
        Count::op(DEVICE, serve).timed("device", Timing::OURS),
        Count::op(CENTRAL, ask).timed("central", Timing::OURS),
    ],
    ratios: &[
        Ratio { what: DEVICE, times: 2.0, of: &[STA_READ, STATUS_WRITTEN] },
        Ratio { what: CENTRAL, times: 2.0, of: &[STA_WRITTEN, STATUS_READ] },
    ],
    streams: &[streams::rows::<Replies>()],
    // The source gives no figure to keep: a reply comes "immediately" (§3).
    ..Link::EMPTY
};

struct Replies;

impl Decoding for Replies {
    type Decoder = Decoder;
    const LEN: usize = STATUS.len();
    const FRAMES: usize = 1;

    fn decoder() -> Decoder {
        Decoder::new(Dialect::STRICT)
    }

    fn valid() -> Vec<u8> {
        STATUS.to_vec()
    }

    fn worst() -> Vec<u8> {
        streams::repeated(b"\r")
    }
}

#[inline(always)]
fn status(line: Line<'_>) {
    match &Reply::<RobotPose>::decode(line, &Dialect::STRICT) {
        Ok(reply) => drop(black_box(reply)),
        Err(error) => panic!("{error}"),
    }
}

fn parse(rounds: u64) {
    let (line, _) = Line::decode(STATUS, &Dialect::STRICT).expect("short").expect("whole");
    for _ in 0..rounds {
        status(black_box(line));
    }
}

fn find_and_parse(rounds: u64) {
    for _ in 0..rounds {
        let bytes: &[u8] = black_box(STATUS);
        let Ok(Some((line, _))) = Line::decode(bytes, &Dialect::STRICT) else { panic!("a whole line") };
        status(line);
    }
}

fn stream(rounds: u64) {
    let mut decoder = Decoder::new(Dialect::STRICT);
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(STATUS)), 50);
        let line = decoder.next_frame().expect("whole").expect("short");
        status(line);
    }
}

fn stream_command(rounds: u64) {
    let mut decoder = Decoder::new(Dialect::STRICT);
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(b"STA\r\n")), 5);
        let line = decoder.next_frame().expect("whole").expect("short");
        assert!(black_box(&Command::<RobotPose>::decode(line, &Dialect::STRICT)).is_ok());
    }
}

fn write_command(rounds: u64) {
    let mut buffer = [0; 64];
    for _ in 0..rounds {
        let command = black_box(Command::<RobotPose>::Status);
        assert_eq!(command.in_dialect(Dialect::STRICT).encode(black_box(&mut buffer)), Ok(5));
    }
}

fn write_status(rounds: u64) {
    let (line, _) = Line::decode(STATUS, &Dialect::STRICT).expect("short").expect("whole");
    let reply = Reply::<RobotPose>::decode(line, &Dialect::STRICT).expect("a status");
    let mut buffer = [0; 64];
    for _ in 0..rounds {
        let reply = black_box(reply);
        assert_eq!(reply.in_dialect(Dialect::STRICT).encode(black_box(&mut buffer)), Ok(50));
    }
}

/// Decodes the same status for this one layout. Its characters cannot be line feeds, so that its end needs no search.
fn by_hand(rounds: u64) {
    for _ in 0..rounds {
        black_box(read_by_hand(black_box(STATUS)).expect("a status"));
    }
}

/// The allowed differences of a field's characters from those of zero, as in the crate, and the weight of its digits.
struct Field {
    zero: [u8; 8],
    limit: u64,
    excess: u64,
    used: u64,
    weight: u64,
    minus: i32,
}

const LENGTH: Field = Field {
    zero: *b"+000.000",
    limit: 0x7676_767F_7676_7600,
    excess: 0x8080_8080_8080_80FD,
    used: u64::MAX,
    weight: 1000,
    minus: 2_000_000,
};
const ANGLE: Field = Field { zero: *b"+00.0000", limit: 0x7676_7676_7F76_7600, ..LENGTH };
const INTEGER: Field = Field {
    zero: *b"\0\0+00000",
    limit: 0x7676_7676_7600_0000,
    excess: 0x8080_8080_80FD_0000,
    used: u64::MAX << 16,
    weight: 10_000,
    minus: 200_000,
};

#[inline(always)]
fn read_by_hand(bytes: &[u8]) -> Option<([bool; 2], [i32; 6])> {
    let bytes: &[u8; 50] = bytes.try_into().ok()?;
    let [b'O', b'K', moving @ (b'T' | b'F'), ..] = *bytes else { return None };
    let [.., servo @ (b'T' | b'F'), _, _, _, _, _, _, _, _, _, _, _, _, b'\r', b'\n'] = *bytes else {
        return None;
    };
    let mut misfits = 0;
    let mut value = |at: usize, field: Field| {
        let characters = bytes[at..].first_chunk().map_or(0, |eight| u64::from_le_bytes(*eight));
        let word = characters.wrapping_sub(u64::from_le_bytes(field.zero));
        misfits |= (word | word.wrapping_add(field.limit)) & field.excess;
        let pairs = (word & field.used).wrapping_mul(0xA01) >> 8 & 0x00FF_00FF_00FF_00FF;
        let fours = pairs.wrapping_mul(0x64_0001) >> 16 & 0x0000_FFFF_0000_FFFF;
        let number = (fours.wrapping_mul((field.weight << 32) + 1) >> 32) as i32;
        if number < field.minus { number } else { field.minus.wrapping_sub(number) }
    };
    let axes = [value(3, LENGTH), value(11, LENGTH), value(19, LENGTH), value(27, ANGLE)];
    let (percent, error) = (value(34, INTEGER), value(40, INTEGER));
    let [x, y, z, c] = axes;
    let is_good = misfits == 0 && (0..=100).contains(&percent) && i16::try_from(error).is_ok();
    is_good.then_some(([moving == b'T', servo == b'T'], [x, y, z, c, percent, error]))
}

fn parse_motion(rounds: u64) {
    for _ in 0..rounds {
        let bytes: &[u8] = black_box(MOVE);
        let Ok(Some((line, _))) = Line::decode(bytes, &Dialect::STRICT) else { panic!("a whole line") };
        assert!(black_box(&Command::<RobotPose>::decode(line, &Dialect::STRICT)).is_ok());
    }
}

fn encode(rounds: u64) {
    let pose = RobotPose::from_mm_rad(10.0, -2.0, 5.999, -1.2322);
    let mut buffer = [0; 38];
    for _ in 0..rounds {
        let command = black_box(Command::Move { mode: Mode::Absolute, pose });
        command.encode(black_box(&mut buffer)).expect("it fits");
    }
}

fn serve(rounds: u64) {
    let mut device = Device::new(DeviceConfig::DEFAULT).expect("the defaults work");
    device.set_pose(RobotPose::from_mm_rad(10.0, -2.0, 5.999, -1.2322));
    device.handle_connected(Duration::ZERO);
    let mut buffer = [0; 64];
    for _ in 0..rounds {
        device.handle_input(Duration::ZERO, black_box(b"STA\r\n"));
        assert_eq!(device.poll_transmit(Duration::ZERO, black_box(&mut buffer)), Some(50));
    }
}

fn ask(rounds: u64) {
    let mut central = Central::<RobotPose>::new(CentralConfig::DEFAULT).expect("the defaults work");
    central.handle_connected(Duration::ZERO);
    central.poll_event().expect("connected");
    let mut buffer = [0; 64];
    for _ in 0..rounds {
        central.request(black_box(Command::Status)).expect("idle");
        assert_eq!(central.poll_transmit(Duration::ZERO, black_box(&mut buffer)), Some(5));
        central.handle_input(Duration::ZERO, black_box(STATUS));
        black_box(central.poll_event().expect("the status"));
    }
}
