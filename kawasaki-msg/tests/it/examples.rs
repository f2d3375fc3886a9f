//! Both examples over real sockets: the robot executes the jobs of the PC's order.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, clippy::duplicate_mod, dead_code)]

use std::net::{TcpListener, UdpSocket};
use std::thread;

use kawasaki_msg::{Job, RobotConfig, Work};

#[path = "../../examples/drawing.rs"]
mod drawing;
#[path = "../../examples/pallet.rs"]
mod pallet;

use drawing::ends;

fn over_tcp<W: Work + Send + Sync + PartialEq + core::fmt::Debug + 'static>(jobs: &[W]) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::scope(|scope| {
        let robot = scope.spawn(|| ends::robot::<W>(RobotConfig::tcp(), || ends::tcp(&address)).unwrap());
        assert_eq!(ends::pc_tcp(&listener, jobs).unwrap() as usize, jobs.len());
        executed(jobs, &robot.join().unwrap());
    });
}

fn over_udp<W: Work + Send + Sync + PartialEq + core::fmt::Debug + 'static>(jobs: &[W]) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = socket.local_addr().unwrap().to_string();
    thread::scope(|scope| {
        let robot = scope.spawn(|| ends::robot::<W>(RobotConfig::udp(), || ends::udp(&address)).unwrap());
        assert_eq!(ends::pc_udp(socket, jobs).unwrap() as usize, jobs.len());
        executed(jobs, &robot.join().unwrap());
    });
}

/// Asserts that every job was executed once, in sequence, under its number and that of its order.
fn executed<W: Work + PartialEq + core::fmt::Debug>(jobs: &[W], executed: &[Job<W>]) {
    assert_eq!(executed.len(), jobs.len());
    for ((work, job), number) in jobs.iter().zip(executed).zip(1..) {
        assert_eq!(*job, Job { order: 50, number, work: *work });
    }
}

#[test]
fn a_drawing_over_tcp() {
    over_tcp(&drawing::zigzag());
}

#[test]
fn a_drawing_over_udp() {
    over_udp(&drawing::zigzag());
}

#[test]
fn a_pallet_over_tcp() {
    over_tcp(&pallet::pallet());
}

#[test]
fn a_pallet_over_udp() {
    over_udp(&pallet::pallet());
}
