use core::time::Duration;
use std::hint::black_box;

use benches::{Count, Link, Ratio};
use mmacell_proto::robot_session::Decoder as _;
use mmacell_proto::{
    Central, CentralConfig, Command, Decoder, Device, DeviceConfig, Dialect, Encode, Line, Mode, Reply,
    RobotPose, Session,
};

use crate::streams;

const STATUS: &[u8; 50] = b"OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n";
const MOVE: &[u8; 38] = b"MOVA+010.000-002.000+005.999-01.2322\r\n";

const STATUS_READ: &str = "the same from a stream, through the decoder";
const STATUS_WRITTEN: &str = "write the status";
const STA_READ: &str = "STA from a stream, through the decoder";
const STA_WRITTEN: &str = "write STA";
const DEVICE: &str = "device: receive STA, send the status";
const CENTRAL: &str = "central: send STA, receive the status";

pub const LINK: Link = Link {
    name: "mmacell-proto",
    counts: &[
        Count {
            what: "50 characters: the end found, the status read",
            goal: Some(220.0),
            units: 1.0,
            unit: "op",
            run: find_and_parse,
        },
        Count {
            what: "… by hand, character by character", goal: None, units: 1.0, unit: "op", run: by_hand
        },
        Count { what: "of that, the status", goal: None, units: 1.0, unit: "op", run: parse },
        Count { what: STATUS_READ, goal: None, units: 1.0, unit: "op", run: stream },
        Count { what: STATUS_WRITTEN, goal: None, units: 1.0, unit: "op", run: write_status },
        Count { what: STA_READ, goal: None, units: 1.0, unit: "op", run: stream_command },
        Count { what: STA_WRITTEN, goal: None, units: 1.0, unit: "op", run: write_command },
        Count { what: "parse a robot's motion", goal: None, units: 1.0, unit: "op", run: parse_motion },
        Count { what: "encode a robot's motion", goal: None, units: 1.0, unit: "op", run: encode },
        Count { what: DEVICE, goal: None, units: 1.0, unit: "op", run: serve },
        Count { what: CENTRAL, goal: None, units: 1.0, unit: "op", run: ask },
        streams::valid(STATUS.len() as f64, |rounds| {
            streams::push(rounds, Decoder::new(Dialect::STRICT), STATUS, 1)
        }),
        streams::noisy(streams::RANDOM_WHOLE, |rounds| {
            streams::push_whole(rounds, Decoder::new(Dialect::STRICT), &streams::noise())
        }),
        streams::noisy_bytes(streams::RANDOM, |rounds| {
            streams::push_noise(rounds, Decoder::new(Dialect::STRICT), &streams::noise())
        }),
        streams::noisy(streams::WORST_WHOLE, |rounds| {
            streams::push_whole(rounds, Decoder::new(Dialect::STRICT), &streams::repeated(b"\r"))
        }),
        streams::noisy_bytes(streams::WORST, |rounds| {
            streams::push_noise(rounds, Decoder::new(Dialect::STRICT), &streams::repeated(b"\r"))
        }),
        streams::LIMIT,
    ],
    ratios: &[
        Ratio { what: DEVICE, times: 2.0, of: &[STA_READ, STATUS_WRITTEN] },
        Ratio { what: CENTRAL, times: 2.0, of: &[STA_WRITTEN, STATUS_READ] },
        streams::RATIOS[0],
        streams::RATIOS[1],
    ],
    // The source gives no figure to keep: a reply comes "immediately" (§3).
    budgets: Vec::new,
};

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

/// The same status and checks in a loop for this one layout.
fn by_hand(rounds: u64) {
    const LAYOUT: &[u8; 50] = b"OKB+000.000+000.000+000.000+00.0000B+00000+00000\r\n";
    for _ in 0..rounds {
        let bytes: &[u8] = black_box(STATUS);
        let (mut flags, mut values) = ([false; 2], [0i32; 6]);
        let (mut flag, mut value, mut minus) = (0, 0, false);
        for (at, (byte, expected)) in bytes.iter().zip(LAYOUT).enumerate() {
            match (expected, byte) {
                (b'B', b'T' | b'F') => {
                    flags[flag] = *byte == b'T';
                    flag += 1;
                }
                (b'+', b'+' | b'-') => minus = *byte == b'-',
                (b'0', b'0'..=b'9') => values[value] = values[value] * 10 + i32::from(byte - b'0'),
                (expected, byte) if expected == byte => {}
                _ => panic!("no status"),
            }
            if matches!(at, 10 | 18 | 26 | 34 | 41 | 47) {
                values[value] = if minus { -values[value] } else { values[value] };
                value += 1;
            }
        }
        assert!(bytes.len() == 50 && (0..=100).contains(&values[4]));
        black_box((flags, values));
    }
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
