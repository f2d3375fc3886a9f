//! The firmware's log of each crate's events, errors and statistics is the output of `Debug`. A logger of defmt
//! writes it, and it is decoded with the table in this program's own file.

use std::fmt::Debug;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

use defmt::Format;
use defmt_decoder::Table;
use robot_session::{Session, Unexpected};
use robot_work_queue::{NumberError, WorkQueue};

static LOG: Mutex<Vec<u8>> = Mutex::new(Vec::new());

#[defmt::global_logger]
struct Logger;

// SAFETY: the tests log one after the other, in `logged`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {}
    unsafe fn flush() {}
    unsafe fn release() {}
    unsafe fn write(bytes: &[u8]) {
        LOG.lock().unwrap().extend_from_slice(bytes);
    }
}

/// Returns a value's text as decoded from the log.
fn logged(value: &impl Format) -> String {
    static TABLE: OnceLock<Table> = OnceLock::new();
    static ONE: Mutex<()> = Mutex::new(());
    let table = TABLE.get_or_init(|| {
        let program = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        Table::parse(&program).unwrap().expect("a table of texts")
    });
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    defmt::println!("{}", value);
    let bytes = std::mem::take(&mut *LOG.lock().unwrap());
    let (frame, length) = table.decode(&bytes).unwrap();
    assert_eq!(length, bytes.len());
    frame.display_message().to_string()
}

#[track_caller]
fn check<T: Format + Debug>(value: &T) {
    assert_eq!(with_times(&logged(value)), format!("{value:?}"));
}

/// Replaces the fields of each `Duration` in a log, as a derived `Format` shows them, by the form of `Debug`.
fn with_times(text: &str) -> String {
    let mut parts = text.split("Duration { secs: ");
    let mut whole = parts.next().unwrap().to_owned();
    for part in parts {
        let (time, rest) = part.split_once(" }").unwrap();
        let (seconds, nanoseconds) = time.split_once(", nanos: ").unwrap();
        let time = Duration::new(seconds.parse().unwrap(), nanoseconds.parse().unwrap());
        whole += &format!("{time:?}{rest}");
    }
    whole
}

/// Runs three seconds of both ends, with noise and a lost connection: reports all events and counters. `call` is called
/// every ten milliseconds for their users.
fn talk<A, B>(a: &mut A, b: &mut B, mut call: impl FnMut(&mut A, &mut B, Duration))
where
    A: Session<Event: Format + Debug, Statistics: Format>,
    B: Session<Event: Format + Debug, Statistics: Format>,
{
    let (mut events, noise) = ([0, 0], (0..=255).collect::<Vec<u8>>());
    for step in 0..300 {
        let now = Duration::from_millis(10 * step);
        if step == 200 {
            a.handle_disconnected(now);
            b.handle_disconnected(now);
        }
        if step % 200 == 0 {
            a.handle_connected(now);
            b.handle_connected(now);
        }
        if step == 100 {
            a.handle_input(now, &noise);
            b.handle_input(now, &noise);
        }
        call(a, b, now);
        events[0] += turn(a, b, now);
        events[1] += turn(b, a, now);
    }
    check(&a.statistics());
    check(&b.statistics());
    assert!(events.iter().all(|count| *count > 0), "{events:?}");
}

/// Passes the bytes of one end on to the other. Returns the number of reported events.
fn turn<A, B>(from: &mut A, to: &mut B, now: Duration) -> usize
where
    A: Session<Event: Format + Debug>,
    B: Session,
{
    let (mut events, mut buffer) = (0, vec![0; A::MAX_TRANSMIT]);
    from.handle_timeout(now);
    while let Some(event) = from.poll_event() {
        check(&event);
        events += 1;
    }
    while let Some(length) = from.poll_transmit(now, &mut buffer) {
        to.handle_input(now, &buffer[..length]);
    }
    events
}

/// Checks that a type can be logged: a derived `Format` of a type with parameters applies only if its fields have it, which
/// building the crate does not show.
fn can_be_logged<T: Format>() {}

#[test]
fn types_with_parameters() {
    can_be_logged::<kawasaki_msg::Job<kawasaki_msg::Line>>();
    can_be_logged::<kawasaki_msg::Message<'_>>();
    can_be_logged::<kawasaki_msg::Field>();
    can_be_logged::<mmacell_proto::Command<mmacell_proto::AnyPose>>();
    can_be_logged::<mmacell_proto::Reply<mmacell_proto::AnyPose>>();
    can_be_logged::<mmacell_proto::CentralEvent<mmacell_proto::PlatformPose>>();
    can_be_logged::<mmacell_proto::DeviceEvent<mmacell_proto::PlatformPose>>();
    can_be_logged::<fanuc_hmi_modbus::Request<'_>>();
    can_be_logged::<fanuc_hmi_modbus::Reply<'_>>();
    can_be_logged::<fanuc_hmi_modbus::Assignment<'_>>();
}

#[test]
fn the_contract_and_the_queue() {
    let unexpected = Unexpected { state: "Idle", input: "Reply" };
    assert_eq!(logged(&unexpected), r#"Unexpected { state: "Idle", input: "Reply" }"#);
    check(&NumberError::Unexpected { expected: 7, found: 9 });
    check(&WorkQueue::<u64, 4>::new(2).unwrap_err());
}

#[test]
fn the_control_ball() {
    use isra_ball::{Ball, BallConfig, Host, HostConfig, Keys};
    let mut host = Host::new(HostConfig::default()).unwrap();
    let mut ball = Ball::new(BallConfig::default()).unwrap();
    talk(&mut host, &mut ball, |_, ball, now| {
        ball.measure([1, -2, 3], [4, 5, now.as_millis() as i8 & 7], Keys(5));
    });
    assert_eq!(logged(&Keys(5)), "Keys(5)");
    check(&Host::new(HostConfig { period: Duration::ZERO, ..HostConfig::default() }).unwrap_err());
}

#[test]
fn the_workstation() {
    use val2_viewer::{Host, HostConfig, Workstation, WorkstationConfig};
    let mut host = Host::new(HostConfig::default()).unwrap();
    let mut station = Workstation::new(WorkstationConfig::default()).unwrap();
    talk(&mut host, &mut station, |host, _, now| host.set_pose(now, [-1; 12]));
    check(&Host::new(HostConfig { interval: Duration::ZERO, ..HostConfig::default() }).unwrap_err());
}

#[test]
fn alter() {
    use val2_alter::{Controller, ControllerConfig, Host, HostConfig, List};
    check(&List::new(&[1, -2]).unwrap());
    let mut host = Host::new(HostConfig::default()).unwrap();
    let mut controller = Controller::new(ControllerConfig::default()).unwrap();
    talk(&mut host, &mut controller, |host, controller, now| {
        if now.is_zero() {
            controller.start(now).unwrap();
        }
        host.set_target(now, [1; 6]);
    });
}

#[test]
fn kawasaki() {
    use kawasaki_msg::motion::JobQueue;
    use kawasaki_msg::{Charset, JobKind, Line, Message, Pc, PcConfig, Point, Robot, RobotConfig};
    const LINES: [Line; 1] = [Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(1, 0) }];
    let mut queue = JobQueue::<Line, 64>::new(9999).unwrap();
    let (jobs, mut motion) = queue.split();
    let mut pc = Pc::new(PcConfig::tcp()).unwrap();
    let mut robot = Robot::new(RobotConfig::tcp(), jobs).unwrap();
    let (message, _) = Message::decode(b"<order$$8#-7$mm$\xB5m#>", Charset::Latin1).unwrap().unwrap();
    check(&message);
    let mut order = 0;
    talk(&mut pc, &mut robot, |pc, _, _| {
        order += u16::from(pc.start(order + 1, &LINES[..]).is_ok());
        while let Some(job) = motion.take() {
            check(&*job);
            job.complete();
        }
    });
}

#[test]
fn the_laser() {
    use laser_eb90::{Controller, ControllerConfig, Host, HostConfig, Instruction};
    struct Any;
    impl TryFrom<Instruction<'_>> for Any {
        type Error = ();
        fn try_from(_: Instruction<'_>) -> Result<Self, ()> {
            Ok(Self)
        }
    }
    let mut queue = WorkQueue::<Any, 7>::new(9999).unwrap();
    let (writer, mut reader) = queue.split();
    let mut host = Host::new(HostConfig::default()).unwrap();
    let mut controller = Controller::new(ControllerConfig::default(), writer).unwrap();
    talk(&mut host, &mut controller, |host, _, _| {
        let _ = host.submit(0x0101, |parameters| parameters.f32(&[1.0, 2.0]).map(drop));
        while let Some(job) = reader.take() {
            job.complete();
        }
    });
}

#[test]
fn the_cell() {
    use mmacell_proto::{Central, CentralConfig, Command, Device, DeviceConfig, RobotPose};
    let mut central = Central::<RobotPose>::new(CentralConfig::DEFAULT).unwrap();
    let mut device = Device::<RobotPose>::new(DeviceConfig::DEFAULT).unwrap();
    talk(&mut central, &mut device, |central, device, _| {
        let _ = central.request(Command::Status);
        device.set_pose(RobotPose::from_units([1; 4]));
    });
    check(&mmacell_task::Event::Ready(mmacell_task::Device::Robot));
}

#[test]
fn the_fanuc() {
    use fanuc_hmi_modbus::{
        Bits, Client, ClientConfig, Exception, Registers, Request, Server, ServerConfig, TelemetryBlock,
        Words, WordsMut,
    };
    struct Board;
    impl Registers for Board {
        fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
            out.copy_from(&[1; 37]);
            Ok(())
        }
    }
    let mut client = Client::<1>::new(ClientConfig::tcp()).unwrap();
    let mut server = Server::<_, 1>::new(ServerConfig::tcp(), Board).unwrap();
    talk(&mut client, &mut server, |client, _, _| {
        let _ = client.request(1, &TelemetryBlock::request());
    });
    check(&TelemetryBlock::request());
    check(&Request::WriteRegisters { address: 7, values: Words::from(&[1, 0xFFFF]) });
    check(&Request::WriteCoils { address: 7, values: Bits::from(&[true, false]) });
}
