//! The tolerance of the host for wrong assumptions about its controller and the line, explored in steps of a tick;
//! and of the controller about its host, on a virtual clock.

use core::time::Duration;

use laser_eb90::{Controller, ControllerConfig, Frame, Payload, Profile};
use robot_session::{Encode as _, Session as _};

use super::CUT;
use super::any_controller::{self, Times};
use super::line_to_controller::AnyInstruction;
use crate::model::{Margin, Peer as _, Setting, Step};

/// One of them.
type Time = fn(&mut Times) -> &mut u8;

/// Returns the assumptions of the ends about time.
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

/// A frame whose halves are so far apart.
fn is_taken(apart: Duration) -> Option<&'static str> {
    let mut line = [0; Frame::MAX_LEN];
    let mut payload = [0; 64];
    let mut payload = Payload::new(&mut payload, &Profile::default());
    payload.word(CUT).and_then(|it| it.f32(&[1.0, 2.0])).expect("there is room");
    let frame = payload.frame().expect("it has a word");
    let length = frame.encode(&mut line).expect("a buffer of a frame");
    let (writer, reader) = robot_work_queue::boxed::<AnyInstruction>(4, 9999).expect("such a queue");
    let mut controller = Controller::new(ControllerConfig::default(), writer).expect("the default can work");
    controller.handle_connected(Duration::ZERO);
    let (head, rest) = line[..length].split_at(length / 2);
    controller.handle_input(Duration::ZERO, head);
    controller.handle_timeout(apart);
    controller.handle_input(apart, rest);
    reader.is_empty().then_some("a frame is taken that pauses")
}
