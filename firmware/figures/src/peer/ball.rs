//! The program that reads the ball.

use isra_ball::{Host, HostConfig};
use static_cell::StaticCell;

use super::{Caller, Peer};

static PEER: StaticCell<Caller<Host>> = StaticCell::new();

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(host) = Host::new(HostConfig::default()) else { panic!("it works") };
    PEER.init(Caller::new(host, |_, _| None))
}
