//! Two polls and their packets through both ends.
#![no_std]
#![no_main]

use core::time::Duration;

use isra_ball::robot_session::Session as _;
use isra_ball::{Ball, BallConfig, Host, HostConfig, HostEvent, Keys};
use no_std as _;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some([1, -2, 3, -4, 5, -6]))
}

fn run() -> Option<[i8; 6]> {
    let mut host = Host::new(HostConfig::default()).ok()?;
    let mut ball = Ball::new(BallConfig::default()).ok()?;
    let mut buf = [0; 16];
    host.handle_connected(Duration::ZERO);
    ball.handle_connected(Duration::ZERO);
    loop {
        ball.measure([1, -2, 3], [-4, 5, -6], Keys(0x81));
        let now = host.poll_timeout()?;
        let n = host.poll_transmit(now, &mut buf)?;
        ball.handle_input(now, buf.get(..n)?);
        let n = ball.poll_transmit(now, &mut buf)?;
        host.handle_input(now + Duration::from_millis(14), buf.get(..n)?);
        match host.poll_event()? {
            HostEvent::Packet(packet) => return Some(packet.axes()),
            // Of the first packet nobody knows how old it is.
            HostEvent::Old(_) => {}
            _ => return None,
        }
    }
}
