//! How long the host may be wrong about its controller and the line: explored, in steps of a tick; and the controller about its host,
//! on a virtual clock.

use core::time::Duration;

use laser_eb90::{ControllerConfig, timing};

use super::any_controller::{self, Times};
use crate::model::{Margin, Peer as _, Setting, Step};
use crate::soak::{Article, Fault};

/// One of them.
type Time = fn(&mut Times) -> &mut u8;

/// What the ends assume about time.
pub fn margins() -> Vec<Margin> {
    let changes: [(&str, &str, Time); 5] = [
        ("max_pause", "a frame is so long under way beyond its time on the line", |real| &mut real.pause),
        ("earlier_execution", "an instruction is executed for so long", |real| &mut real.execution),
        ("settle", "an answer is so late", |real| &mut real.settle),
        ("reply_time", "an error code is so late after the decision", |real| &mut real.reply),
        ("longest_frame", "a frame of an earlier host is so long on the line", |real| &mut real.earlier),
    ];
    let silence = Margin::around(
        ["laser-eb90 controller", "silence", "two bytes of a frame are so far apart"],
        ControllerConfig::default().silence,
        is_taken,
    );
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
        .into_iter()
        .chain([silence])
        .collect()
}

/// A frame that pauses in its middle, of a host that hears at once.
fn is_taken(apart: Duration) -> Option<&'static str> {
    let mut article = Article::new(timing::BAUD, Duration::ZERO);
    let pause = Fault::Pause(20, apart - timing::transmission_time(1, timing::BAUD));
    let is_confirmed = article.exchange(0, &[&[pause]]);
    (!is_confirmed || article.transmissions > 1).then_some("a frame is taken that pauses")
}
