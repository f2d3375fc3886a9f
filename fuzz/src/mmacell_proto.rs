//! The MM&A cell: commands and replies, both sessions, and the pick-and-place task, whatever they receive and in whatever order.

use core::time::Duration;

use arbitrary::Unstructured;
use mmacell_proto::robot_session::{Encode as _, Session as _};
use mmacell_proto::{
    AnyPose, BLOW, Central, CentralConfig, CentralEvent, Command, Decoder, Device, DeviceConfig, DeviceEvent,
    Dialect, ErrorCode, Line, Miss, Mode, Order, PlatformPose, Pose, Progress, Reply, RobotPose, Status,
    Unfinished, VACUUM,
};
use mmacell_task::{self as task, Event, Failure, Output, Step, Task, TaskConfig};

use crate::{codecs, step, written};

/// The first byte is how long the reads are, the second the dialect, the rest the stream.
pub fn mmacell_proto_command(data: &[u8]) {
    messages(data, |line, dialect| {
        let Ok(command) = Command::<AnyPose>::decode(line, dialect) else { return };
        let mut buffer = [0; Command::<AnyPose>::MAX_LEN];
        match command.encode(&mut buffer) {
            Ok(len) => {
                assert_eq!(len, command.encoded_len());
                let again = Line::new(&buffer[..len - 2]);
                assert_eq!(Command::decode(again, &Dialect::STRICT), Ok(command));
                check_strict(line, again, dialect);
            }
            Err(error) => assert!(dialect.wide_integers, "{error}"),
        }
        let bytes = written(command.in_dialect(*dialect).encoded_len(), |out| {
            command.in_dialect(*dialect).encode(out)
        });
        let bytes = bytes.expect("what a dialect reads it writes");
        let Ok(Some((again, _))) = Line::decode(&bytes, dialect) else { panic!("a whole line") };
        assert_eq!(Command::decode(again, dialect), Ok(command));
    });
}

/// The first byte is how long the reads are, the second the dialect, the rest the stream.
pub fn mmacell_proto_reply(data: &[u8]) {
    fn check<P: Pose>(line: Line<'_>, dialect: &Dialect) {
        let Ok(reply) = Reply::<P>::decode(line, dialect) else { return };
        let mut buffer = [0; 50];
        match reply.encode(&mut buffer) {
            Ok(len) => {
                assert_eq!(len, reply.encoded_len());
                let again = Line::new(&buffer[..len - 2]);
                assert_eq!(Reply::decode(again, &Dialect::STRICT), Ok(reply));
                check_strict(line, again, dialect);
            }
            Err(error) => assert!(dialect.wide_integers, "{error}"),
        }
        let bytes =
            written(reply.in_dialect(*dialect).encoded_len(), |out| reply.in_dialect(*dialect).encode(out));
        let bytes = bytes.expect("what a dialect reads it writes");
        let Ok(Some((again, _))) = Line::decode(&bytes, dialect) else { panic!("a whole line") };
        assert_eq!(Reply::decode(again, dialect), Ok(reply));
    }
    messages(data, |line, dialect| {
        check::<RobotPose>(line, dialect);
        check::<PlatformPose>(line, dialect);
        check::<AnyPose>(line, dialect);
    });
}

/// Commands and replies of any values: what fits its fields is read back the same, and what does not is refused.
pub fn mmacell_proto_message(data: &[u8]) {
    let mut input = Unstructured::new(data);
    let Ok((kind, percent, number, small)) = input.arbitrary::<(u8, u8, i32, i32)>() else { return };
    let Ok([x, y, z, c]) = input.arbitrary::<[i32; 4]>() else { return };
    // Half of the time within the fields.
    let axes = if kind & 1 == 0 { [x, y, z, c] } else { [x, y, z, c].map(|axis| axis % 1_000_000) };
    let number = if kind & 2 == 0 { number } else { small % 40_000 };
    check_message(kind, percent, number, axes, RobotPose::from_units(axes));
    check_message(
        kind,
        percent,
        number,
        [axes[0], axes[1], 0, 0],
        PlatformPose::from_units([axes[0], axes[1]]),
    );
}

fn check_message<P: Pose>(kind: u8, percent: u8, number: i32, axes: [i32; 4], pose: P) {
    let (flag, other) = (kind & 4 != 0, kind & 8 != 0);
    let pose_fits = axes.iter().all(|axis| axis.unsigned_abs() <= 999_999);
    let fits = i16::try_from(number).is_ok();
    let (command, good) = match kind >> 4 {
        0 => (Command::Status, true),
        1 => (Command::Servo { on: flag }, true),
        2 => (Command::Override { percent }, percent <= 100),
        3 | 4 => {
            let mode = if flag { Mode::Absolute } else { Mode::Relative };
            (Command::Move { mode, pose }, pose_fits)
        }
        5 => (Command::Stop, true),
        6 => (Command::Reset, true),
        7 => (Command::Close, true),
        8 => (Command::Acquire { camera: number }, fits),
        _ => (Command::Grip { gripper: number, open: flag }, fits),
    };
    let wire = written(command.encoded_len(), |out| command.encode(out));
    assert_eq!(wire.is_ok(), good, "{command:?}: {wire:?}");
    if let Ok(bytes) = wire {
        assert!(bytes.len() <= Command::<P>::MAX_LEN && bytes.ends_with(b"\r\n"));
        let line = Line::new(&bytes[..bytes.len() - 2]);
        assert_eq!(Command::decode(line, &Dialect::STRICT), Ok(command));
    }
    let error = ErrorCode::from(number);
    let (reply, good) = match kind >> 4 {
        0..4 => (Reply::Ok, true),
        4..8 => (Reply::Error { error }, fits && error != ErrorCode::None),
        _ => {
            let status = Status { moving: flag, pose, servo: other, percent, error };
            (Reply::Status(status), pose_fits && percent <= 100 && fits)
        }
    };
    let wire = written(reply.encoded_len(), |out| reply.encode(out));
    assert_eq!(wire.is_ok(), good, "{reply:?}: {wire:?}");
    if let Ok(bytes) = wire {
        assert!(bytes.len() <= Reply::<P>::MAX_LEN && bytes.ends_with(b"\r\n"));
        let line = Line::new(&bytes[..bytes.len() - 2]);
        assert_eq!(Reply::decode(line, &Dialect::STRICT), Ok(reply));
    }
}

/// Takes the events: each outcome is that of the command that is not finished.
fn settle(session: &mut Central<RobotPose>, outstanding: &mut Option<Command<RobotPose>>) {
    while let Some(event) = session.poll_event() {
        match event {
            CentralEvent::Done { command }
            | CentralEvent::Refused { command, .. }
            | CentralEvent::Aborted { command } => assert_eq!(outstanding.take(), Some(command)),
            CentralEvent::Status { .. } => assert_eq!(outstanding.take(), Some(Command::Status)),
            CentralEvent::Closed { reason: mmacell_proto::Closing::Agreed, .. } => {
                assert_eq!(outstanding.take(), Some(Command::Close));
            }
            CentralEvent::Closed { unfinished, .. } => {
                let command = match unfinished {
                    Unfinished::Nothing => None,
                    Unfinished::NotSent(command) | Unfinished::Unknown(command) => Some(command),
                };
                assert_eq!(outstanding.take(), command, "the command that is not finished is given back");
            }
            CentralEvent::Connected | CentralEvent::Unexpected(_) => {}
            other => panic!("{other:?}"),
        }
    }
}

/// Steps of an operation, a pause, a length, and so many bytes from the line.
pub fn mmacell_proto_central(mut data: &[u8]) {
    let mut session = Central::<RobotPose>::new(CentralConfig::DEFAULT).expect("the defaults work");
    let (mut now, mut buffer) = (Duration::ZERO, [0; 64]);
    session.handle_connected(now);
    let mut outstanding = None;
    while let Some(([operation, pause, _], bytes)) = step(&mut data) {
        now += Duration::from_millis(pause.into());
        match operation {
            0xFF => session.handle_disconnected(now),
            0xFE => session.handle_connected(now),
            0xFD => session.abort(now),
            _ => {}
        }
        // An outcome may wait: then the request is refused.
        let command = any_command(operation);
        if session.request(command).is_ok() {
            assert_eq!(outstanding.replace(command), None, "one command at a time");
        }
        let room = buffer.len().min(usize::from(operation >> 4) * 4);
        while session.poll_transmit(now, &mut buffer[..room]).is_some() {}
        session.handle_input(now, bytes);
        session.handle_timeout(now);
        assert!(session.poll_timeout().is_none_or(|at| at > now));
        settle(&mut session, &mut outstanding);
        assert!(outstanding.is_none() || !session.is_idle());
    }
}

/// Steps of an operation, a length, and so many bytes from the line.
pub fn mmacell_proto_device(mut data: &[u8]) {
    let mut device = Device::new(DeviceConfig::DEFAULT).expect("the defaults work");
    device.set_pose(RobotPose::ORIGIN);
    let (now, mut buffer) = (Duration::ZERO, [0; 64]);
    device.handle_connected(now);
    let mut pending: Option<Order<RobotPose>> = None;
    while let Some(([operation, _], bytes)) = step(&mut data) {
        match operation % 16 {
            0 => device.arrived(),
            1 => device.fail(ErrorCode::from(i32::from(operation))),
            2 => device.set_pose(RobotPose::from_units([i32::from(operation) * 8000; 4])),
            3 => (device.handle_connected(now), pending = None).0,
            4 => (device.handle_disconnected(now), pending = None).0,
            _ => {}
        }
        device.handle_input(now, bytes);
        for turns in 0.. {
            assert!(turns < 200, "a few lines for each byte");
            let event = device.poll_event();
            if let Some(DeviceEvent::Asked { order }) = event {
                assert_eq!(pending.replace(order), None, "one order at a time");
            }
            if let Some(DeviceEvent::Closed { .. }) = event {
                assert!(device.is_ended());
                pending = None;
            }
            // Some owners take their time.
            if let Some(order) = pending.take_if(|_| operation < 0xF0) {
                let before = device.machine().axes;
                if operation & 0x20 == 0 {
                    let refused = device.refuse(order, ErrorCode::Other(77));
                    assert!(refused.is_ok() && device.machine().axes == before, "{order:?}");
                } else if device.accept(order).is_err() {
                    assert_eq!(device.machine().axes, before, "{order:?} was not possible");
                }
            }
            let reply = device.poll_transmit(now, &mut buffer);
            if let Some(length) = reply {
                assert!(pending.is_none(), "the owner has not answered {pending:?}");
                let bytes = &buffer[..length];
                assert!(bytes.ends_with(b"\r\n"));
                Reply::<RobotPose>::decode(Line::new(&bytes[..length - 2]), &Dialect::STRICT)
                    .expect("a reply that a central controller can read");
            }
            if event.is_none() && reply.is_none() {
                break;
            }
        }
    }
    let statistics = device.statistics();
    assert!(statistics.replies <= statistics.lines, "one reply a line: {statistics:?}");
}

/// A byte an event: what happens in the cell, in any order.
pub fn mmacell_task(data: &[u8]) {
    const DEVICES: [task::Device; 5] = [
        task::Device::Robot,
        task::Device::Platform,
        task::Device::Conditioning,
        task::Device::Vision,
        task::Device::Gripper,
    ];
    let mut task = Task::new(TaskConfig::DEFAULT);
    let mut now = Duration::ZERO;
    let mut step: Option<Step> = None;
    let mut busy = [false; 5];
    let mut vacuum = false;
    for &byte in data {
        let device = DEVICES[usize::from(byte >> 4) % 5];
        let index = device as usize;
        now += Duration::from_millis(1);
        let event = match byte & 15 {
            0..=3 => Event::Done(device),
            4 | 5 => {
                let motions =
                    [Progress::Still, Progress::Arrived, Progress::Moving, Progress::Missed(Miss::Elsewhere)];
                Event::Status { device, motion: motions[usize::from(byte & 1) + 2 * usize::from(byte >> 7)] }
            }
            6 => Event::Failed { device, failure: Failure::Lost },
            7 => Event::Failed { device, failure: Failure::Refused(ErrorCode::Generic) },
            8 => Event::Switch { high: byte >> 7 == 1 },
            9 => Event::PartFound { platform: PlatformPose::ORIGIN, pick: RobotPose::ORIGIN },
            10 => Event::SlotFound { place: RobotPose::ORIGIN },
            11 => Event::NotFound,
            12 => Event::Ready(device),
            13 if byte >> 7 == 1 => Event::Abort,
            13 => Event::Next,
            14 => Event::Recover,
            _ => Event::Finish,
        };
        match event {
            Event::Done(_) | Event::Status { .. } | Event::Failed { .. } => busy[index] = false,
            Event::PartFound { .. } | Event::SlotFound { .. } | Event::NotFound => busy[3] = false,
            _ => {}
        }
        task.handle_event(now, event);
        task.handle_timeout(now);
        for outputs in 0.. {
            assert!(outputs < 32, "the orders of a step are few");
            let Some(output) = task.poll_output(now) else { break };
            let device = match output {
                Output::Entered(entered) => {
                    let from = step.replace(entered);
                    let legal = |from: Step| from.transitions().iter().any(|(_, to)| *to == entered);
                    assert!(from.is_none_or(legal), "{from:?} -> {entered:?}");
                    let again = matches!(entered, Step::GoCamera1 | Step::ServosOn | Step::Placed);
                    assert!(!(again && vacuum), "{entered:?} with the vacuum on");
                    continue;
                }
                Output::Robot(_) => 0,
                Output::Platform(_) => 1,
                Output::Conditioning(_) => 2,
                Output::Acquire { .. } => 3,
                Output::Grip { gripper, open } => {
                    assert!(gripper == VACUUM || gripper == BLOW);
                    vacuum = if gripper == VACUUM { open } else { vacuum };
                    4
                }
                other => panic!("{other:?}"),
            };
            assert!(!core::mem::replace(&mut busy[device], true), "{output:?} before the last was answered");
        }
        assert_eq!(step, Some(task.step()));
    }
}

/// Every line of a stream in its dialect.
fn messages(data: &[u8], check: impl Fn(Line<'_>, &Dialect)) {
    let [size, bits, stream @ ..] = data else { return };
    codecs::decoder(&Lines::new(*bits, check), stream, *size);
}

/// Lines in one dialect; `check` is of their messages.
pub(crate) struct Lines<F> {
    dialect: Dialect,
    check: F,
}

impl<F: Fn(Line<'_>, &Dialect)> Lines<F> {
    pub(crate) fn new(bits: u8, check: F) -> Self {
        Self { dialect: any_dialect(bits), check }
    }
}

impl<F: Fn(Line<'_>, &Dialect)> codecs::Side for Lines<F> {
    type Decoder = Decoder;
    /// Its content.
    type Frame = Vec<u8>;

    fn decoder(&self) -> Decoder {
        Decoder::new(self.dialect)
    }

    fn keep(&self, line: Line<'_>) -> Vec<u8> {
        line.content().to_vec()
    }

    fn check(&self, content: &Vec<u8>, _: &[u8], bytes: &[u8]) {
        let line = Line::new(content);
        assert_eq!(Line::decode(bytes, &self.dialect), Ok(Some((line, bytes.len()))));
        (self.check)(line, &self.dialect);
    }

    fn good(&self, _: usize) -> (Vec<u8>, Vec<u8>) {
        (b"STA".to_vec(), b"STA\r\n".to_vec())
    }
}

/// What is accepted strictly encodes to its bytes, but for a zero with a minus.
fn check_strict(line: Line<'_>, again: Line<'_>, dialect: &Dialect) {
    if *dialect == Dialect::STRICT && line != again {
        let (content, again) = (line.content(), again.content());
        assert_eq!(content.len(), again.len());
        let differences = content.iter().zip(again).filter(|(a, b)| a != b);
        differences.for_each(|pair| assert_eq!(pair, (&b'-', &b'+')));
    }
}

fn any_dialect(bits: u8) -> Dialect {
    let bit = |n: u8| bits >> n & 1 == 1;
    Dialect {
        itr: bit(0),
        ovrd: bit(1),
        clos: bit(2),
        off: bit(3),
        lone_lf: bit(4),
        blank: bit(5),
        wide_integers: bit(6),
    }
}

fn any_command(choice: u8) -> Command<RobotPose> {
    match choice & 7 {
        0 | 1 => Command::Status,
        2 => Command::Servo { on: choice & 8 == 0 },
        3 => Command::Override { percent: choice },
        4 | 5 => {
            let mode = if choice & 1 == 0 { Mode::Absolute } else { Mode::Relative };
            Command::Move { mode, pose: RobotPose::from_units([i32::from(choice) * 5_000; 4]) }
        }
        6 => Command::Stop,
        _ => Command::Close,
    }
}
