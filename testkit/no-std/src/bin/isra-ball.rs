//! A poll and its packet through both ends.
#![no_std]
#![no_main]

use core::time::Duration;

use isra_ball::{Ball, Config, Host, HostEvent, Keys};
use no_std as _;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some([1, -2, 3, -4, 5, -6]))
}

fn run() -> Option<[i8; 6]> {
    let (mut host, mut ball) = (Host::new(Config::default()).ok()?, Ball::new(0, 0).ok()?);
    let (now, mut buf) = (Duration::ZERO, [0; 16]);
    ball.measure([1, -2, 3], [-4, 5, -6], Keys(0x81));
    let n = host.poll_transmit(now, &mut buf)?;
    ball.handle_input(now, buf.get(..n)?);
    let n = ball.poll_transmit(now, &mut buf)?;
    host.handle_input(now, buf.get(..n)?);
    match host.poll_event()? {
        HostEvent::Packet(packet) => Some(packet.axes()),
        _ => None,
    }
}
