//! A request and its pose through both ends.
#![no_std]
#![no_main]

use core::time::Duration;

use no_std as _;
use val2_viewer::robot_session::Session as _;
use val2_viewer::{Host, HostConfig, Workstation, WorkstationConfig, WorkstationEvent};

const POSE: [i16; 12] = [16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16];

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some(POSE))
}

fn run() -> Option<[i16; 12]> {
    let mut host = Host::new(HostConfig::default()).ok()?;
    let mut workstation = Workstation::new(WorkstationConfig::default()).ok()?;
    let mut buf = [0; Host::MAX_TRANSMIT];
    host.handle_connected(Duration::ZERO);
    workstation.handle_connected(Duration::ZERO);
    let now = Duration::from_millis(200);
    workstation.draw(now);
    let n = workstation.poll_transmit(now, &mut buf)?;
    host.set_pose(now, POSE);
    host.handle_input(now, buf.get(..n)?);
    let n = host.poll_transmit(now, &mut buf)?;
    workstation.handle_input(now, buf.get(..n)?);
    match workstation.poll_event()? {
        WorkstationEvent::Pose(packet) => Some(packet.pose),
        _ => None,
    }
}
