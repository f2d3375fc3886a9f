//! The program that cuts: instructions as many as a frame takes, and a question now and then.

use laser_eb90::{Host, HostConfig};
use static_cell::StaticCell;

use super::{Caller, Peer};

const MOVE: u16 = 0x0101;
const STATUS: u16 = 0x0301;

static PEER: StaticCell<Caller<Host>> = StaticCell::new();

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(host) = Host::new(HostConfig::at_baud(115_200)) else { panic!("it works") };
    PEER.init(Caller::new(host, |host, now| {
        if host.is_held() {
            host.resume(); // the queue was full
        }
        let x = (now.subsec_micros() % 10_000) as f32 / 8.0;
        if now.subsec_micros().is_multiple_of(8) {
            let _ = host.submit(STATUS, |_| Ok(()));
        }
        while host.submit(MOVE, |parameters| parameters.f32(&[x, -x, 2.5, 0.0, 90.0, x]).map(drop)).is_ok() {}
        None
    }))
}
