//! The controller of the arm, in ALTER from the beginning.

use static_cell::StaticCell;
use val2_alter::{Controller, ControllerConfig};

use super::{Caller, Peer};

type Alter = Caller<Controller>;
static PEER: StaticCell<Alter> = StaticCell::new();

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(controller) = Controller::new(ControllerConfig::default()) else { panic!("it works") };
    PEER.init(Caller::new(controller, |controller, now| {
        // Refused while it runs.
        let _ = controller.start(now);
        None
    }))
}
