//! A start, a standard message and its reply through both ends.
#![no_std]
#![no_main]

use core::time::Duration;

use no_std as _;
use val2_alter::robot_session::Session as _;
use val2_alter::{Controller, ControllerConfig, Frame, Host, HostConfig, Limits, timing};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some(80))
}

fn run() -> Option<i16> {
    let mut controller = Controller::new(ControllerConfig::default()).ok()?;
    let mut host = Host::new(HostConfig { limits: Limits::NONE, ..HostConfig::default() }).ok()?;
    controller.handle_connected(Duration::ZERO);
    host.handle_connected(Duration::ZERO);
    let mut buf = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).ok()?;
    for now in [Duration::ZERO, timing::CYCLE] {
        let n = controller.poll_transmit(now, &mut buf)?;
        host.handle_input(now, buf.get(..n)?);
        let n = host.poll_transmit(now, &mut buf)?;
        // What comes while the request is still on the line is no reply to it.
        controller.handle_input(now + timing::CYCLE / 2, buf.get(..n)?);
        host.set_target(now, [80, 0, 0, 0, 0, 0]);
    }
    controller.values().first().copied()
}
