//! The workstation, which draws as fast as it gets poses.

use core::time::Duration;

use static_cell::StaticCell;
use val2_viewer::{Workstation, WorkstationConfig};

use super::{Caller, Peer};

static PEER: StaticCell<Caller<Workstation>> = StaticCell::new();

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(workstation) = Workstation::new(WorkstationConfig::default()) else { panic!("it works") };
    PEER.init(Caller::new(workstation, |workstation, now| {
        workstation.draw(now);
        Some(now + Duration::from_millis(200))
    }))
}
