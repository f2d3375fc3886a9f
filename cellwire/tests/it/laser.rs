//! `cellwire simulate laser` as a process that is killed while a host talks to it.

use core::time::Duration;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread;

use core::ops::ControlFlow;

use cellwire_io::serial;
use laser_eb90::{Host, HostConfig, HostEvent, Item, UnknownReason};
use robot_session::{Driver, EndReason, Serial, Session as _, now};

const CUT: u16 = 0x0101;
const STATUS: u16 = 0x0301;

struct Robot {
    process: Child,
    events: BufReader<ChildStdout>,
}

impl Robot {
    fn start(path: &Path) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_cellwire"))
            .args(["simulate", "laser", "--pty"])
            .arg(path)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let events = BufReader::new(process.stdout.take().unwrap());
        let mut robot = Self { process, events };
        assert!(robot.event().contains("ready"));
        robot
    }

    fn event(&mut self) -> String {
        let mut line = String::new();
        self.events.read_line(&mut line).unwrap();
        line
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        drop(self.process.kill());
        drop(self.process.wait());
    }
}

/// Sends what is due, and waits for an outcome.
fn outcome(host: &mut Host, driver: &mut Driver<Serial>) -> HostEvent {
    loop {
        let turn = driver.turn(host, None, |_, event| match event {
            HostEvent::Corrupt(_) => ControlFlow::Continue(()),
            event => ControlFlow::Break(event),
        });
        match turn.unwrap() {
            ControlFlow::Continue(()) => {}
            ControlFlow::Break(EndReason::ByHandler(event)) => return event,
            ControlFlow::Break(EndReason::ByPeer | EndReason::Stalled) => panic!("the port is gone"),
        }
    }
}

fn open(path: &Path) -> Driver<Serial> {
    Driver::new(Serial(serial::open(path.to_str().unwrap(), 9600).unwrap()))
}

#[test]
fn a_batch_in_which_the_robot_is_killed_is_unknown_and_not_sent_again() {
    let path = std::env::temp_dir().join(format!("cellwire-laser-{}", std::process::id()));
    let robot = Robot::start(&path);
    let mut driver = open(&path);
    // Nobody has sent anything before, and nothing pauses.
    let config = HostConfig { longest_frame: 0, max_pause: Duration::ZERO, ..HostConfig::default() };
    let mut host = Host::new(HostConfig { execution_timeout: Duration::from_secs(2), ..config }).unwrap();
    host.handle_connected(now());
    for x in 0..7u8 {
        host.submit(CUT, |parameters| parameters.f32(&[x.into(); 6]).map(drop)).unwrap();
    }
    while host.statistics().frames == 0 {
        assert!(
            driver
                .turn(&mut host, Some(Duration::ZERO), |_, event| ControlFlow::Break(event))
                .unwrap()
                .is_continue()
        );
    }
    thread::sleep(Duration::from_millis(100)); // of the 226 ms that the frame takes at 9600 baud
    drop(robot);

    let mut robot = Robot::start(&path);
    let mut driver = open(&path);
    let reason = UnknownReason::Silence;
    assert_eq!(outcome(&mut host, &mut driver), HostEvent::Unknown { first: 0, count: 7, reason });
    assert_eq!(host.poll_timeout(), None, "nothing is sent again");

    host.resume();
    host.submit(STATUS, |_| Ok(())).unwrap();
    assert_eq!(outcome(&mut host, &mut driver), HostEvent::Answer { ticket: 7 });
    let held = match host.answer().next() {
        Some(Ok(Item::I16(values))) => values.array::<3>().unwrap()[2],
        other => panic!("{other:?}"),
    };
    assert_eq!(held, 0);
    assert!(robot.event().contains("query"), "nothing came before the question");
    drop(std::fs::remove_file(path));
}
