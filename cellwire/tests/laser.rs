//! `cellwire simulate laser` as a process that is killed while a host talks to it.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::time::Duration;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread;

use cellwire::line::Clock;
use cellwire::serial;
use laser_eb90::{Doubt, Frame, Host, HostConfig, HostEvent, Item};
use serialport::SerialPort;

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

/// Sends what is due, and hears until there is an event.
fn drive<T>(
    host: &mut Host,
    port: &mut dyn SerialPort,
    clock: Clock,
    take: impl Fn(HostEvent<'_>) -> T,
) -> T {
    let mut buffer = [0; Frame::MAX_LEN];
    loop {
        if let Some(n) = host.poll_transmit(clock.now(), &mut buffer) {
            port.write_all(&buffer[..n]).unwrap();
        }
        if let Ok(n) = port.read(&mut buffer) {
            host.handle_input(clock.now(), &buffer[..n]);
        }
        host.handle_timeout(clock.now());
        if let Some(event) = host.poll_event() {
            return take(event);
        }
    }
}

#[test]
fn a_batch_in_which_the_robot_is_killed_is_unknown_and_not_sent_again() {
    let path = std::env::temp_dir().join(format!("cellwire-laser-{}", std::process::id()));
    let robot = Robot::start(&path);
    let mut port = serial::open(path.to_str().unwrap(), 9600).unwrap();
    let clock = Clock::start();
    let mut host = Host::new(HostConfig::default());
    for x in 0..7u8 {
        host.submit(CUT, |parameters| parameters.f32(&[x.into(); 6]).map(drop)).unwrap();
    }
    let mut frame = [0; Frame::MAX_LEN];
    let n = host.poll_transmit(clock.now(), &mut frame).unwrap();
    port.write_all(&frame[..n]).unwrap();
    thread::sleep(Duration::from_millis(100)); // of the 226 ms that the frame takes at 9600 baud
    drop(robot);

    let mut robot = Robot::start(&path);
    let mut port = serial::open(path.to_str().unwrap(), 9600).unwrap();
    drive(&mut host, &mut *port, clock, |event| {
        assert_eq!(event, HostEvent::Unknown { first: 0, count: 7, cause: Doubt::Silence });
    });
    assert_eq!(host.poll_transmit(clock.now() + Duration::from_secs(60), &mut frame), None);

    host.resume();
    host.submit(STATUS, |_| Ok(())).unwrap();
    let held = drive(&mut host, &mut *port, clock, |event| match event {
        HostEvent::Answer { ticket: 7, mut values } => match values.next() {
            Some(Ok(Item::I16(values))) => values.array::<3>().unwrap()[2],
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    });
    assert_eq!(held, 0);
    assert!(robot.event().contains("query"), "nothing came before the question");
    drop(std::fs::remove_file(path));
}
