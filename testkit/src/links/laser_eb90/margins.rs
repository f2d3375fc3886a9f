//! How long the host may be wrong about its controller and the line: explored, in steps of a tick.

use super::any_controller::{self, Times};
use crate::model::{Margin, Peer as _, Setting, Step};

/// One of them.
type Time = fn(&mut Times) -> &mut u8;

/// What the host assumes about time.
pub fn margins() -> Vec<Margin> {
    let changes: [(&str, &str, Time); 4] = [
        ("max_pause", "a frame is so long under way beyond its time on the line", |real| &mut real.pause),
        ("earlier_execution", "an instruction is executed for so long", |real| &mut real.execution),
        ("settle", "an answer is so late", |real| &mut real.settle),
        ("reply_time", "an error code is so late after the decision", |real| &mut real.reply),
    ];
    changes
        .map(|(setting, real, time)| {
            let step = |more: i8| {
                let mut system = super::any_controller(true, false);
                let assumed = *time(&mut system.peer.real);
                *time(&mut system.peer.real) = assumed.saturating_add_signed(more);
                let real = u32::from(*time(&mut system.peer.real));
                let tick = any_controller::AnyController::TICK;
                let setting = Setting::new("wrong about time", system).on(any_controller::RULES);
                Step::model(tick * u32::from(assumed), tick * real, setting)
            };
            Margin { end: "laser-eb90 host", setting, real, steps: [-1, 0, 1, 2, 3].map(step).into() }
        })
        .into()
}
