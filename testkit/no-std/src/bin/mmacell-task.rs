//! The task until its first order to the robot.
#![no_std]
#![no_main]

use core::time::Duration;

use mmacell_task::mmacell_proto::Command;
use mmacell_task::{Device, Event, Output, Step, Task, TaskConfig};
use no_std as _;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some(Command::Servo { on: true }))
}

fn run() -> Option<Command<mmacell_task::mmacell_proto::RobotPose>> {
    let (now, mut task) = (Duration::ZERO, Task::new(TaskConfig::DEFAULT));
    for device in [Device::Robot, Device::Platform, Device::Conditioning] {
        task.handle_event(now, Event::Ready(device));
    }
    while let Some(output) = task.poll_output(now) {
        if let (Output::Robot(command), Step::ServosOn) = (output, task.step()) {
            return Some(command);
        }
    }
    None
}
