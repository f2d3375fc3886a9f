//! A device in a thread: when waiting for it ends, and when it ends itself.

use core::time::Duration;
use std::io::{ErrorKind, Read, Write as _};
use std::net::TcpStream;
use std::time::Instant;

use cellwire_sim::robot_session::Session as _;
use cellwire_sim::{RunningDevice, Simulator};

use crate::gadget::{Gadget, Line};

const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);
const NOW: Duration = Duration::ZERO;

#[test]
fn waiting_ends_with_what_is_waited_for_or_with_its_time() {
    let gadget = Gadget { work: Some(NOW), ..Gadget::default() };
    let sim = RunningDevice::listen(Simulator::new(gadget), "127.0.0.1:0").unwrap();
    let begun = Instant::now();
    assert!(sim.wait_for(1, 20 * S) && begun.elapsed() < 10 * S, "{:?}", begun.elapsed());
    assert!(!sim.wait_for(2, MS));
}

#[test]
fn a_call_runs_once_in_the_thread_of_the_device_or_not_at_all() {
    let gadget = Gadget { work: Some(NOW), ..Gadget::default() };
    let mut simulator = Simulator::new(gadget.clone());
    let remote = simulator.remote();
    let begun = Instant::now();
    assert_eq!(remote.call(10 * MS, |_| panic!("nothing runs the device")), None::<()>);
    assert!(begun.elapsed() >= 10 * MS);
    let sim = RunningDevice::listen(simulator, "127.0.0.1:0").unwrap();
    let here = std::thread::current().id();
    let thread = sim.call(move |_| (std::thread::current().id() != here, Instant::now() > begun)).unwrap();
    assert_eq!(thread, (true, true));
    // Faults that were asked for before the call have happened.
    for restarts in 1..=5 {
        sim.faults().restart(MS);
        assert!(sim.call(|_| ()).is_some());
        assert_eq!(sim.faults().happened().len(), restarts);
    }
    drop(sim);
    assert_eq!(remote.call(MS, |_| ()), None, "the device is gone");
}

#[test]
fn the_last_executed_commands_are_stored_and_all_are_counted() {
    let mut simulator = Simulator::new(Gadget { work: Some(NOW), ..Gadget::default() }).keeping_nothing();
    let remote = simulator.remote();
    assert_eq!(remote.executed(0, 9).0, 0);
    for ms in 0..10_003 {
        simulator.handle_timeout(MS * ms);
        simulator.device_mut().work = Some(MS * ms);
    }
    simulator.handle_timeout(MS * 20_000);
    let (total, first) = remote.executed(0, 2);
    let (_, last) = remote.executed(total - 1, 9);
    assert_eq!((total, first.len(), last.len()), (10_004, 2, 1));
    assert_eq!([first[0].0, first[1].0, last[0].0], [4, 5, 10_003]);
    assert_eq!([first[0].1.at, last[0].1.at], [4 * MS, 20_000 * MS]);
    assert!(remote.executed(total, 9).1.is_empty() && remote.executed(u64::MAX, 9).1.is_empty());
}

#[test]
fn a_connection_ends_when_its_device_is_dropped_whether_or_not_everything_was_read() {
    let line = Line { is_blocked: true, ..Line::sending(&[(NOW, "AB")]) };
    let sim =
        RunningDevice::listen(Simulator::new(Gadget { line, ..Gadget::default() }), "127.0.0.1:0").unwrap();
    let mut program = TcpStream::connect(sim.address()).unwrap();
    program.set_read_timeout(Some(S)).unwrap();
    program.read_exact(&mut [0; 2]).unwrap();
    program.write_all(b"CD").unwrap();
    drop(sim);
    let end = program.read(&mut [0]).map_err(|error| error.kind());
    let is_reset = end == Err(ErrorKind::ConnectionReset);
    assert!(end == Ok(0) || is_reset && cfg!(not(target_os = "linux")), "{end:?}");
}

#[test]
fn a_device_that_panics_does_so_where_it_is_dropped() {
    // A text that does not fit a message.
    let line = Line::sending(&[(NOW, "ABCDEFGHIJKLMNOPQRSTUVWXYZABCDEFGHIJKLMNOPQRSTUVWXYZABCDEFGHIJKLM")]);
    let sim =
        RunningDevice::listen(Simulator::new(Gadget { line, ..Gadget::default() }), "127.0.0.1:0").unwrap();
    let mut program = TcpStream::connect(sim.address()).unwrap();
    program.set_read_timeout(Some(20 * S)).unwrap();
    assert_eq!(program.read(&mut [0; 80]).unwrap_or(0), 0, "it is gone");
    let drop = std::panic::catch_unwind(core::panic::AssertUnwindSafe(|| drop(sim)));
    assert!(drop.is_err());
}

/// Tests a device that reads meanwhile, and one that does not.
#[cfg(target_os = "linux")]
#[test]
fn a_program_that_reads_late_gets_every_byte_and_one_that_never_reads_stops_nothing() {
    [false, true].into_iter().for_each(reads_late);
}

#[cfg(target_os = "linux")]
fn reads_late(is_blocked: bool) {
    // 43 bytes: no system has a buffer of a multiple of them.
    let text = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopq";
    let sends = vec![(NOW, text); 8000];
    let line = Line { is_blocked, ..Line::sending(&sends) };
    let gadget = Gadget { line, ..Gadget::default() };
    let sim = RunningDevice::pty(Simulator::new(gadget)).unwrap();
    let inherited = std::process::Command::new("ls").args(["-l", "/proc/self/fd"]).output().unwrap();
    assert!(!String::from_utf8_lossy(&inherited.stdout).contains(sim.path()), "no process has it open");
    std::thread::sleep(10 * MS); // until the buffers are full
    let mut program = std::fs::File::open(sim.path()).unwrap();
    let (mut count, mut buffer) = (0, [0; 4096]);
    while count < 100_000 {
        let length = program.read(&mut buffer).unwrap();
        let expected = text.as_bytes().iter().cycle().skip(count % text.len());
        assert!(buffer[..length].iter().zip(expected).all(|(found, expected)| found == expected), "{count}");
        count += length;
    }
    std::thread::sleep(5 * MS);
    drop(sim);
}
