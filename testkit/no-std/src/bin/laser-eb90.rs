//! A batch and its answer through both ends, and the queue between them.
#![no_std]
#![no_main]

use core::time::Duration;

use laser_eb90::robot_session::Session as _;
use laser_eb90::{Controller, ControllerConfig, Frame, Host, HostConfig, HostEvent, Instruction, Item};
use no_std as _;
use robot_work_queue::WorkQueue;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some([4.0, 18.0]))
}

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

fn run() -> Option<[f32; 2]> {
    let mut queue = WorkQueue::<Cut, 7>::new(9999).ok()?;
    let (writer, mut reader) = queue.split();
    let mut controller = Controller::new(ControllerConfig::default(), writer).ok()?;
    let mut host = Host::new(HostConfig::default()).ok()?;
    controller.handle_connected(Duration::ZERO);
    host.handle_connected(Duration::ZERO);
    let mut line = [0; Frame::MAX_LEN];
    for x in [4.0, 5.0, 6.0] {
        host.submit(0x0101, |parameters| parameters.f32(&[x, 18.0]).map(drop)).ok()?;
    }
    let start = host.poll_timeout()?;
    let n = host.poll_transmit(start, &mut line)?;
    controller.handle_input(start, line.get(..n)?);
    let end = controller.poll_timeout()?;
    let n = controller.poll_transmit(end, &mut line)?;
    host.handle_input(end, line.get(..n)?);
    match host.poll_event()? {
        HostEvent::Done { count: 3, .. } => reader.take().map(|job| job.0),
        _ => None,
    }
}
