//! The laser robot, with a queue of seven cuts.
#![no_std]
#![no_main]

use laser_eb90::robot_session::Session as _;
use laser_eb90::{Controller, ControllerConfig, Instruction, Item};
use robot_work_queue::WorkQueue;

struct Cut([f32; 2]);

impl TryFrom<Instruction<'_>> for Cut {
    type Error = ();

    fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
        match instruction.parameters.next() {
            Some(Ok(Item::F32(values))) => values.array().map(Self).ok_or(()),
            _ => Err(()),
        }
    }
}

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut queue) = WorkQueue::<Cut, 7>::new(9999) else { return 1 };
    let (writer, mut reader) = queue.split();
    let Ok(mut session) = Controller::new(ControllerConfig::default(), writer) else { return 1 };
    no_std::run(&mut session, &mut [0; Controller::<Cut>::MAX_TRANSMIT], |_, _| {
        if let Some(job) = reader.take() {
            core::hint::black_box(job.0);
            job.complete();
        }
    })
}
