//! A task in a cell where all goes well.
#![allow(unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use mmacell_proto::{Command, Mode, PlatformPose, Progress, RobotPose};
use mmacell_task::{Device, Event, Output, Step, Task, TaskConfig};

pub const ZERO: Duration = Duration::ZERO;
pub const MS: Duration = Duration::from_millis(1);

pub const fn robot(x: i32) -> RobotPose {
    RobotPose::from_units([x, 0, 0, 0])
}

pub const fn platform(a: i32) -> PlatformPose {
    PlatformPose::from_units([a, 0])
}

pub const CONFIG: TaskConfig = TaskConfig {
    robot_home: robot(1),
    platform_home: platform(2),
    camera_1: Some(robot(10)),
    camera_2: Some(robot(20)),
    percent: 50,
    ..TaskConfig::DEFAULT
};
pub const PART: Event = Event::PartFound { platform: platform(3), pick: robot(30) };
pub const SLOT: Event = Event::SlotFound { place: robot(40) };

pub fn status(device: Device, moving: bool) -> Event {
    progress(device, if moving { Progress::Moving } else { Progress::Arrived })
}

pub fn progress(device: Device, motion: Progress) -> Event {
    Event::Status { device, motion }
}

pub fn to(x: i32) -> Output {
    Output::Robot(Command::Move { mode: Mode::Absolute, pose: robot(x) })
}

pub fn turn(a: i32) -> Output {
    Output::Platform(Command::Move { mode: Mode::Absolute, pose: platform(a) })
}

pub fn grip(gripper: i32, open: bool) -> Output {
    Output::Grip { gripper, open }
}

pub fn servo() -> [Output; 2] {
    [Output::Robot(Command::Servo { on: true }), Output::Platform(Command::Servo { on: true })]
}

pub const ASK_ROBOT: Output = Output::Robot(Command::Status);
pub const ASK_PLATFORM: Output = Output::Platform(Command::Status);
pub const STOP: Output = Output::Robot(Command::Stop);

/// Returns all outputs that the task has now.
pub fn poll(task: &mut Task, now: Duration) -> Vec<Output> {
    core::iter::from_fn(|| task.poll_output(now)).collect()
}

/// Returns the answer of a faultless cell without a part on the gripper.
pub fn answer(output: Output, task: &Task) -> Option<Event> {
    Some(match output {
        Output::Robot(Command::Status) => status(Device::Robot, false),
        Output::Platform(Command::Status) => status(Device::Platform, false),
        Output::Robot(_) => Event::Done(Device::Robot),
        Output::Platform(_) => Event::Done(Device::Platform),
        Output::Conditioning(_) => Event::Done(Device::Conditioning),
        Output::Grip { .. } => Event::Done(Device::Gripper),
        Output::Acquire { .. } if task.step() == Step::FindPart => PART,
        Output::Acquire { .. } => SLOT,
        _ => return None,
    })
}

pub fn ready(task: &mut Task, now: Duration) {
    for device in [Device::Robot, Device::Platform, Device::Conditioning] {
        task.handle_event(now, Event::Ready(device));
    }
}

/// Runs in a cell where all goes well until the task enters a step; every output on the way, that step's entry last.
pub fn run_to(task: &mut Task, end: Step) -> Vec<Output> {
    let (mut now, mut outputs) = (ZERO, Vec::new());
    for _ in 0..1000 {
        while let Some(output) = task.poll_output(now) {
            outputs.push(output);
            if output == Output::Entered(end) {
                return outputs;
            }
            if let Some(event) = answer(output, task) {
                task.handle_event(now, event);
            }
            if output == grip(mmacell_proto::BLOW, true) {
                task.handle_event(now, Event::Switch { high: false });
            }
        }
        now = task.poll_timeout().unwrap_or(now).max(now);
        task.handle_timeout(now);
    }
    panic!("{end:?} is not reached from {:?}: {outputs:?}", task.step());
}

/// Returns a task that has just entered a step, without an answer in it.
pub fn task_at(step: Step) -> Task {
    let mut task = Task::new(CONFIG);
    ready(&mut task, ZERO);
    let carries = matches!(
        step,
        Step::GoPlace | Step::AwaitPlace | Step::Release | Step::Blow | Step::BlowOff | Step::StopAtPart
    );
    if carries || matches!(step, Step::PlaceDwell | Step::CheckReleased | Step::Placed) {
        run_to(&mut task, Step::AwaitPick);
        task.handle_event(ZERO, Event::Switch { high: true });
    }
    run_to(&mut task, step);
    task
}

pub fn entered(outputs: &[Output]) -> Vec<Step> {
    outputs.iter().filter_map(|o| if let Output::Entered(step) = o { Some(*step) } else { None }).collect()
}
