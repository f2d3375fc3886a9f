//! A laser robot that misbehaves, on a virtual clock and over TCP.

#![allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, clippy::cast_sign_loss)]

use core::time::Duration;

use cellwire_sim::laser::{CLEAR, GO_ON, HALT, LaserEvent, LaserRobot, POSITION, STATUS};
use cellwire_sim::robot_session::Session as _;
use cellwire_sim::{
    Bench, Device as _, Fault, Faults, Laser, LaserHost, Script, Settings as _, SimulatorReport,
};
use laser_eb90::robot_session::tokio::{Reconnect, Tcp};
use laser_eb90::tokio::{Command, Error, host};
use laser_eb90::{Host, HostConfig, HostEvent, Item, Refusal, UnknownReason};

const CUT: u16 = 0x0101;
const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);
/// Nobody has sent anything before, and the robot drops what it has of a corrupt frame.
const FRESH: fn() -> HostConfig = || HostConfig {
    longest_frame: 0,
    controller_drops_partial: true,
    execution_timeout: Duration::from_secs(1),
    ..HostConfig::default()
};

fn cut(x: f32) -> Command {
    Command::new(CUT, move |parameters| parameters.f32(&[x]).map(drop))
}

#[tokio::test]
async fn a_run_is_cut_once_although_answers_are_corrupt() {
    let robot = Laser { execution: MS, ..Laser::default() };
    let sim = robot.listen("127.0.0.1:0").unwrap();
    sim.faults().follow(Script::new().every_request(3, Fault::Corrupt).answer(4, Fault::Delay(50 * MS)));
    let (laser, task) = host(FRESH(), Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.run());
    laser.run((0..30).map(|n| cut(n as f32))).await.unwrap();
    assert!(sim.wait_for(30, 10 * S));
    let cuts: Vec<f32> = sim.executed().iter().map(|done| done.work.floats(&robot.config)[0]).collect();
    assert_eq!(cuts, (0..30).map(|n| n as f32).collect::<Vec<_>>());
    assert!(sim.faults().happened().len() > 2, "{:?}", sim.faults().happened());
}

#[tokio::test]
async fn what_a_restart_leaves_open_is_said_and_the_next_run_goes_on() {
    let sim = Laser { execution: 100 * S, ..Laser::default() }.listen("127.0.0.1:0").unwrap();
    let (laser, task) = host(FRESH(), Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    laser.run([cut(1.0)]).await.unwrap();
    sim.faults().next_answer(Fault::Restart(20 * MS));
    let unknown = laser.run([cut(2.0), cut(3.0)]).await;
    assert!(matches!(unknown, Err(Error::Unknown { taken: 0, count: 2, .. })), "{unknown:?}");
    let status = laser.query(Command::bare(STATUS)).await.unwrap();
    let Some(Ok(Item::I16(values))) = status.items().next() else { panic!("{status:?}") };
    assert_eq!(values.array::<3>(), Some([2, 64, 0]), "started twice, and nothing is held");
}

/// The robot of an hour, in which every hundredth answer is lost: each instruction reported as accepted was cut, once
/// and in sequence.
#[test]
fn an_hour_of_cutting_with_lost_answers() {
    let robot = Laser { execution: 40 * MS, ..Laser::default() };
    let mut bench = robot.bench(Host::new(FRESH()).unwrap()).unwrap();
    bench.wire.baud = Some(115_200);
    bench.faults().follow(Script::new().every_answer(100, Fault::Drop));
    let (mut next, mut taken, mut unknown) = (0u32, 0, 0);
    while bench.now() < 3600 * S {
        while bench.session_mut().submit(CUT, |parameters| parameters.f32(&[next as f32]).map(drop)).is_ok() {
            next += 1;
        }
        match bench.next_event(60 * S) {
            Some(HostEvent::Done { count, .. }) => taken += u64::from(count),
            Some(HostEvent::Unknown { count, reason: UnknownReason::Silence, .. }) => {
                unknown += u64::from(count);
                bench.session_mut().resume();
            }
            other => panic!("{other:?} at {:?}", bench.now()),
        }
    }
    bench.run_for(10 * S);
    let cut = bench.executed().iter().map(|done| done.work.floats(&robot.config)[0] as u32);
    let cut: Vec<u32> = cut.collect();
    assert!(cut.windows(2).all(|two| two[0] < two[1]), "nothing is cut twice");
    assert!(taken > 40_000 && unknown > 100, "{taken} {unknown}");
    // Of the unknown ones some were cut, and some were refused by a full queue.
    assert!((taken..=taken + unknown).contains(&(cut.len() as u64)), "{taken} {unknown} {}", cut.len());
}

#[test]
fn what_goes_wrong_is_what_was_asked_for() {
    let mut bench = Laser::default().bench(Host::new(FRESH()).unwrap()).unwrap();
    let query = |bench: &mut cellwire_sim::Bench<Host, _>, word| {
        bench.session_mut().submit(word, |_| Ok(())).unwrap();
        let begun = bench.now();
        (bench.next_event(60 * S).unwrap(), bench.now() - begun)
    };
    bench.run_for(3 * S);
    let (event, usual) = query(&mut bench, STATUS);
    assert!(matches!(event, HostEvent::Answer { .. }) && usual < 30 * MS, "{event:?} {usual:?}");
    bench.faults().delay_next(200 * MS);
    let delayed = query(&mut bench, STATUS).1;
    assert!((200 * MS..200 * MS + 2 * usual).contains(&delayed), "{delayed:?}");
    bench.faults().freeze(300 * MS);
    let frozen = query(&mut bench, STATUS).1;
    assert!((300 * MS..300 * MS + 2 * usual).contains(&frozen), "{frozen:?}");
    bench.faults().cut_next();
    let (event, _) = query(&mut bench, STATUS);
    let reason = UnknownReason::Disconnected;
    assert!(matches!(event, HostEvent::Unknown { count: 1, reason: why, .. } if why == reason), "{event:?}");
    assert!(bench.told().iter().any(|(_, told)| matches!(told, SimulatorReport::Close(_))));
    bench.session_mut().resume();
    bench.faults().next_request(Fault::Drop);
    let (event, _) = query(&mut bench, STATUS);
    assert!(matches!(event, HostEvent::Unknown { reason: UnknownReason::Silence, .. }), "{event:?}");
    bench.session_mut().resume();
    // Halted, it holds seven; they are dropped.
    query(&mut bench, HALT);
    for x in 0..7u8 {
        bench.session_mut().submit(CUT, |parameters| parameters.f32(&[x.into()]).map(drop)).unwrap();
    }
    assert!(matches!(bench.next_event(S), Some(HostEvent::Done { count: 7, .. })));
    assert_eq!(bench.device().held(), 7);
    bench.faults().forget();
    bench.run_for(S);
    assert_eq!((bench.device().held(), bench.executed().len()), (0, 0));
    query(&mut bench, CLEAR);
}

/// Sends the robot an instruction; returns the host's event.
fn told(bench: &mut Bench<Host, LaserRobot>, word: u16) -> HostEvent {
    bench.session_mut().submit(word, |_| Ok(())).unwrap();
    bench.next_event(S).unwrap()
}

/// Submits an instruction to cut for each of these, at once; returns the next event.
fn cuts(bench: &mut Bench<Host, LaserRobot>, xs: core::ops::Range<u8>) -> HostEvent {
    for x in xs {
        bench.session_mut().submit(CUT, |parameters| parameters.f32(&[x.into()]).map(drop)).unwrap();
    }
    bench.next_event(S).unwrap()
}

#[test]
fn a_halted_robot_holds_its_queue_and_goes_on_when_it_is_told_to() {
    let robot = Laser { execution: 400 * MS, queue: 3, ..Laser::default() };
    let config = HostConfig { full_timeout: Duration::ZERO, ..FRESH() };
    let mut bench = robot.bench(Host::new(config).unwrap()).unwrap();
    bench.run_for(3 * S);
    assert!(matches!(told(&mut bench, HALT), HostEvent::Done { count: 1, .. }));
    assert!(matches!(cuts(&mut bench, 0..3), HostEvent::Done { count: 3, .. }));
    bench.run_for(10 * S);
    assert_eq!((bench.device().held(), bench.executed().len(), bench.device().due()), (3, 0, None));
    // The queue is full, and has free space again as soon as it was emptied.
    assert!(matches!(cuts(&mut bench, 3..4), HostEvent::Refused { refusal: Refusal::QueueFull, .. }));
    bench.session_mut().resume();
    assert!(matches!(told(&mut bench, CLEAR), HostEvent::Done { count: 1, .. }));
    assert_eq!(bench.device().held(), 0);
    assert!(matches!(cuts(&mut bench, 5..8), HostEvent::Done { count: 3, .. }));
    assert_eq!(bench.device().held(), 3);
    assert!(matches!(told(&mut bench, GO_ON), HostEvent::Done { count: 1, .. }));
    let first = bench.device().due().unwrap();
    for (x, end) in [(5.0, first), (6.0, first + 400 * MS), (7.0, first + 800 * MS)] {
        let before = bench.executed().len();
        assert!(bench.run_until(S, |bench| bench.executed().len() > before));
        let done = bench.executed().last().unwrap();
        assert_eq!((done.work.floats(&robot.config), done.at, bench.now()), (vec![x], end, end));
    }
    assert_eq!((bench.executed().len(), bench.device().due()), (3, None));
    let noted: Vec<_> = bench
        .told()
        .iter()
        .filter_map(|(_, told)| match told {
            SimulatorReport::Device(LaserEvent::Queued(count)) => Some(Ok(*count)),
            SimulatorReport::Device(LaserEvent::Refused(refusal)) => Some(Err(*refusal)),
            _ => None,
        })
        .collect();
    assert_eq!(noted, [Ok(3), Err(Refusal::QueueFull), Ok(3)]);
}

/// A simulated host and a simulated robot: instructions refused by the full queue are sent again after the pause, and
/// each is cut once.
#[test]
fn a_host_sends_again_what_was_refused_after_a_pause() {
    let instructions = (0..9u8).map(|x| (CUT, vec![f32::from(x)])).collect();
    let config = HostConfig { full_timeout: Duration::ZERO, batch: 3, ..FRESH() };
    let host = LaserHost { config, instructions, pause: 300 * MS };
    let robot = Laser { execution: 2 * S, queue: 4, ..Laser::default() };
    let mut bench = host.bench(robot.simulator().unwrap()).unwrap();
    assert!(bench.run_until(60 * S, |bench| bench.session().device().held() == 3));
    bench.run_for(60 * S);
    let cut: Vec<f32> = core::iter::from_fn(|| bench.session_mut().poll_executed())
        .map(|done| done.work.floats(&robot.config)[0])
        .collect();
    assert_eq!(cut, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    let refused = bench.executed().iter().filter(|done| matches!(done.work, HostEvent::Refused { .. }));
    let refused: Vec<Duration> = refused.map(|done| done.at).collect();
    assert!(refused.len() > 3, "{refused:?}");
    let pauses = refused.windows(2).map(|two| two[1] - two[0]);
    assert!(pauses.clone().all(|pause| (300 * MS..600 * MS).contains(&pause)), "{refused:?}");
    assert_eq!(bench.device().due(), None, "there is nothing left to do");
}

/// Runs a host at this port that cuts once.
#[cfg(unix)]
fn cut_once(port: Box<dyn serialport::SerialPort>) {
    use core::ops::ControlFlow;
    use laser_eb90::robot_session::{Driver, EndReason, Serial, Session as _, now};
    let (mut host, mut driver) = (Host::new(FRESH()).unwrap(), Driver::new(Serial(port)));
    host.handle_connected(now());
    host.submit(CUT, |parameters| parameters.f32(&[1.5]).map(drop)).unwrap();
    let event = loop {
        match driver.turn(&mut host, None, |_, event| ControlFlow::Break(event)).unwrap() {
            ControlFlow::Break(EndReason::ByHandler(event)) => break event,
            ControlFlow::Break(EndReason::ByPeer | EndReason::Stalled) => panic!("the port is gone"),
            ControlFlow::Continue(()) => {}
        }
    };
    assert!(matches!(event, HostEvent::Done { count: 1, .. }), "{event:?}");
}

#[cfg(unix)]
#[test]
fn a_pseudo_terminal_is_a_port() {
    let sim = Laser { execution: MS, ..Laser::default() }.pty().unwrap();
    cut_once(serialport::new(sim.path(), 9600).open().unwrap());
    assert!(sim.wait_for(1, S));
}

/// A program that closes its end ends the connection: what was to be sent to it, or was not read, is not for the next one.
#[cfg(unix)]
#[test]
fn the_next_program_of_a_pseudo_terminal_reads_nothing_of_the_one_before() {
    use std::io::{Read as _, Write as _};
    let sim = Laser { execution: MS, ..Laser::default() }.pty().unwrap();
    let open = || serialport::new(sim.path(), 9600).timeout(S / 5).open().unwrap();
    for wait in [Duration::ZERO, S / 10] {
        let mut program = open();
        program.write_all(&[0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 3, 0x90, 0x82, 0xF6]).unwrap();
        std::thread::sleep(wait);
        drop(program);
        std::thread::sleep(S / 5);
        let unasked = open().read(&mut [0; 64]).map_err(|error| error.kind());
        assert_eq!(unasked, Err(std::io::ErrorKind::TimedOut));
        std::thread::sleep(S / 20);
    }
    cut_once(open());
    assert!(sim.wait_for(1, S));
}

#[cfg(unix)]
#[test]
fn a_device_is_on_the_port_of_a_path() {
    use serialport::{SerialPort as _, TTYPort};
    let (host, port) = TTYPort::pair().unwrap();
    let path = port.name().unwrap();
    drop(port); // who opens a port locks it
    let sim = Laser { execution: MS, ..Laser::default() }.port(&path, 9600).unwrap();
    cut_once(Box::new(host));
    assert!(sim.wait_for(1, S));
}

#[test]
fn a_query_for_the_position_is_answered_with_what_was_executed_last() {
    let mut bench = Laser::default().bench(Host::new(FRESH()).unwrap()).unwrap();
    bench.run_for(3 * S);
    let position = |bench: &mut Bench<Host, LaserRobot>| {
        let event = told(bench, POSITION);
        assert!(matches!(event, HostEvent::Answer { .. }), "{event:?}");
        let items = bench.session().answer().flatten();
        let floats = items.filter_map(|item| match item {
            Item::F32(values) => Some(values.iter().collect::<Vec<_>>()),
            _ => None,
        });
        floats.flatten().collect::<Vec<f32>>()
    };
    assert_eq!(position(&mut bench), [0.0; 0], "nothing was");
    cuts(&mut bench, 3..6);
    bench.run_for(S);
    assert_eq!(position(&mut bench), [5.0]);
}

/// Returns the cuts of a simulated host by a robot that takes 2 s for each, when something has happened to the host
/// after 3 s.
fn cut_by_list(happens: impl FnOnce(&Faults)) -> Vec<f32> {
    let instructions = (0..9u8).map(|x| (CUT, vec![f32::from(x)])).collect();
    let host = LaserHost { config: HostConfig { batch: 1, ..FRESH() }, instructions, ..LaserHost::default() };
    let robot = Laser { execution: 2 * S, queue: 1, ..Laser::default() };
    let mut bench = host.bench(robot.simulator().unwrap()).unwrap();
    assert!(bench.run_until(60 * S, |bench| bench.session().device().held() == 1));
    bench.run_for(3 * S);
    happens(bench.faults());
    bench.run_for(100 * S);
    let robot_session = bench.session().device().session().statistics();
    assert_eq!(bench.session().statistics(), robot_session, "a simulator counts what its device does");
    assert_ne!(robot_session, robot.device().unwrap().session().statistics());
    core::iter::from_fn(|| bench.session_mut().poll_executed())
        .map(|done| done.work.floats(&robot.config)[0])
        .collect()
}

#[test]
fn a_host_that_restarts_sends_its_list_again_and_one_that_forgets_sends_no_more_of_it() {
    let all = cut_by_list(|_| {});
    assert_eq!(all, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    let forgotten = cut_by_list(Faults::forget);
    assert!((1..5).contains(&forgotten.len()) && all.starts_with(&forgotten), "{forgotten:?}");
    let again = cut_by_list(|faults| faults.restart(S));
    let begins = again.iter().filter(|x| **x == 0.0).count();
    assert!(begins == 2 && again.ends_with(&all), "{again:?}");
}
