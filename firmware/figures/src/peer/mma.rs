//! The central controller: motions, and a status between two of its other commands.

use mmacell_proto::{Central, CentralConfig, Command, Mode, RobotPose};
use static_cell::StaticCell;

use super::{Caller, Peer};

type Session = Central<RobotPose>;
static PEER: StaticCell<Caller<Session>> = StaticCell::new();

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(central) = Session::new(CentralConfig::DEFAULT) else { panic!("it works") };
    PEER.init(Caller::new(central, |central, now| {
        let part = now.subsec_micros();
        let at = (part % 20_000) as i32 - 10_000;
        // Refused while the previous command has no outcome.
        let _ = central.request(match part % 16 {
            0 => Command::Servo { on: true },
            1 => Command::Override { percent: (part % 100 + 1) as u8 },
            2 | 3 => Command::Move {
                mode: Mode::Absolute,
                pose: RobotPose::from_units([at, -at, 90_000 + at, at / 4]),
            },
            _ => Command::Status,
        });
        None
    }))
}
