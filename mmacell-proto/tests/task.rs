//! The task of §6: its table and diagram, each way through it, and what it never does whatever happens.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Write;
use core::time::Duration;
use std::collections::HashSet;

use mmacell_proto::state::Motion;
use mmacell_proto::task::{Config, Device, Event, Failure, Output, Step, Task, Trigger};
use mmacell_proto::{BLOW, Command, ErrorCode, Mode, PlatformPose, RobotPose, Status, VACUUM, controller};
use proptest::prelude::*;

const ZERO: Duration = Duration::ZERO;
const MS: Duration = Duration::from_millis(1);

const fn robot(x: i32) -> RobotPose {
    RobotPose::from_units([x, 0, 0, 0])
}

const fn platform(a: i32) -> PlatformPose {
    PlatformPose::from_units([a, 0])
}

const CONFIG: Config = Config {
    robot_home: robot(1),
    platform_home: platform(2),
    camera_1: Some(robot(10)),
    camera_2: Some(robot(20)),
    percent: 50,
    ..Config::DEFAULT
};
const PART: Event = Event::PartFound { platform: platform(3), pick: robot(30) };
const SLOT: Event = Event::SlotFound { place: robot(40) };

fn status(device: Device, moving: bool) -> Event {
    Event::Status { device, moving }
}

fn to(x: i32) -> Output {
    Output::Robot(Command::Move { mode: Mode::Absolute, pose: robot(x) })
}

fn turn(a: i32) -> Output {
    Output::Platform(Command::Move { mode: Mode::Absolute, pose: platform(a) })
}

fn grip(gripper: i32, open: bool) -> Output {
    Output::Grip { gripper, open }
}

fn servo() -> [Output; 2] {
    [Output::Robot(Command::Servo { on: true }), Output::Platform(Command::Servo { on: true })]
}

const ASK_ROBOT: Output = Output::Robot(Command::Status);
const ASK_PLATFORM: Output = Output::Platform(Command::Status);
const STOP: Output = Output::Robot(Command::Stop);

/// Everything that the task gives now.
fn poll(task: &mut Task, now: Duration) -> Vec<Output> {
    core::iter::from_fn(|| task.poll_output(now)).collect()
}

/// The answer of a cell in which everything goes well, without a part on the gripper.
fn answer(output: Output, task: &Task) -> Option<Event> {
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

fn ready(task: &mut Task, now: Duration) {
    for device in [Device::Robot, Device::Platform, Device::Conditioning] {
        task.handle_event(now, Event::Ready(device));
    }
}

/// Runs in a cell where all goes well until the task enters a step; every output on the way, that step's entry last.
fn run_to(task: &mut Task, end: Step) -> Vec<Output> {
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
        }
        now = task.poll_timeout().unwrap_or(now).max(now);
        task.handle_timeout(now);
    }
    panic!("{end:?} is not reached from {:?}: {outputs:?}", task.step());
}

/// A task that has just entered a step, with nothing answered in it.
fn task_at(step: Step) -> Task {
    let mut task = Task::new(CONFIG);
    ready(&mut task, ZERO);
    let carries =
        matches!(step, Step::GoPlace | Step::AwaitPlace | Step::Release | Step::Blow | Step::BlowOff);
    if carries || matches!(step, Step::Placed | Step::StopAtPart) {
        run_to(&mut task, Step::AwaitPick);
        task.handle_event(ZERO, Event::Switch { high: true });
    }
    run_to(&mut task, step);
    task
}

fn entered(outputs: &[Output]) -> Vec<Step> {
    outputs.iter().filter_map(|o| if let Output::Entered(step) = o { Some(*step) } else { None }).collect()
}

/// All 21 steps of §6 in their order, and every order in them.
#[test]
fn a_part_that_is_caught_goes_through_the_21_steps() {
    let mut task = Task::new(CONFIG);
    assert_eq!(poll(&mut task, ZERO), [Output::Entered(Step::AwaitDevices)]);
    task.handle_event(ZERO, Event::Ready(Device::Robot));
    task.handle_event(ZERO, Event::Ready(Device::Platform));
    assert_eq!(poll(&mut task, ZERO), []);
    task.handle_event(ZERO, Event::Ready(Device::Conditioning));
    let mut outputs = run_to(&mut task, Step::AwaitPick);
    task.handle_event(ZERO, Event::Switch { high: true });
    outputs.extend(run_to(&mut task, Step::Placed));
    let both = |robot, platform| [Output::Robot(robot), Output::Platform(platform)];
    let percent = 50;
    let expected: Vec<Output> = [
        &[Output::Entered(Step::DevicesReady)][..],
        &[Output::Entered(Step::ServosOn)],
        &servo(),
        &[Output::Entered(Step::SetOverride)],
        &both(Command::Override { percent }, Command::Override { percent }),
        &[Output::Entered(Step::GoHome), to(1), turn(2)],
        &[Output::Entered(Step::AwaitHome), ASK_ROBOT, ASK_PLATFORM],
        &[Output::Entered(Step::GoCamera1), to(10)],
        &[Output::Entered(Step::AwaitCamera1), ASK_ROBOT],
        &[Output::Entered(Step::FindPart), Output::Acquire { camera: 1 }],
        &[Output::Entered(Step::TurnPlatform), turn(3)],
        &[Output::Entered(Step::GoCamera2), to(20)],
        &[Output::Entered(Step::AwaitCamera2), ASK_ROBOT, ASK_PLATFORM],
        &[Output::Entered(Step::FindSlot), Output::Acquire { camera: 2 }],
        &[Output::Entered(Step::GoPick), to(30)],
        &[Output::Entered(Step::VacuumOn), grip(VACUUM, true)],
        &[Output::Entered(Step::AwaitPick)],
        &[Output::Entered(Step::StopAtPart), STOP, ASK_ROBOT],
        &[Output::Entered(Step::CheckGrip), Output::Entered(Step::GoPlace), to(40)],
        &[Output::Entered(Step::AwaitPlace), ASK_ROBOT],
        &[Output::Entered(Step::Release), grip(VACUUM, false), grip(BLOW, true)],
        &[Output::Entered(Step::Blow)],
        &[Output::Entered(Step::BlowOff), grip(BLOW, false)],
        &[Output::Entered(Step::Placed)],
    ]
    .concat();
    assert_eq!(outputs, expected);
    let numbers: HashSet<u8> = Step::ALL.iter().filter_map(|step| step.number()).collect();
    assert_eq!(numbers, (1..=21).collect());
}

/// §6 step 20: "l'oggetto non è stato preso oppure è stato perso"
#[test]
fn a_part_that_is_missed_is_tried_again_from_step_7() {
    let mut task = task_at(Step::AwaitPick);
    let outputs = run_to(&mut task, Step::AwaitCamera1);
    let expected = [
        ASK_ROBOT,
        Output::Entered(Step::CheckGrip),
        Output::Entered(Step::GiveUp),
        STOP,
        grip(VACUUM, false),
        ASK_ROBOT,
        Output::Entered(Step::GoCamera1),
        to(10),
        Output::Entered(Step::AwaitCamera1),
    ];
    assert_eq!(outputs, expected, "the robot is not sent off with nothing");
}

/// A stop may not overtake the answer to a question that is under way: one command is outstanding at a time.
#[test]
fn a_part_that_is_lost_in_flight_stops_the_robot_and_the_vacuum() {
    let mut task = task_at(Step::AwaitPlace);
    assert_eq!(poll(&mut task, ZERO), [ASK_ROBOT]);
    task.handle_event(ZERO, Event::Switch { high: false });
    assert_eq!(poll(&mut task, ZERO), [Output::Entered(Step::GiveUp), grip(VACUUM, false)]);
    task.handle_event(ZERO, status(Device::Robot, false));
    assert_eq!(task.step(), Step::GiveUp, "the answer is older than the stop");
    assert_eq!(poll(&mut task, ZERO), [STOP]);
    task.handle_event(ZERO, Event::Done(Device::Robot));
    assert_eq!(poll(&mut task, ZERO), [ASK_ROBOT]);
    task.handle_event(ZERO, status(Device::Robot, false));
    assert_eq!(task.step(), Step::GiveUp, "the vacuum is not yet known to be off");
    task.handle_event(ZERO, Event::Done(Device::Gripper));
    assert_eq!(poll(&mut task, ZERO), [Output::Entered(Step::GoCamera1), to(10)]);
}

#[test]
fn a_part_that_falls_just_as_it_arrives_is_lost() {
    let mut task = task_at(Step::AwaitPlace);
    assert_eq!(poll(&mut task, ZERO), [ASK_ROBOT]);
    let mut late = task.clone();
    task.handle_event(ZERO, Event::Switch { high: false });
    task.handle_event(ZERO, status(Device::Robot, false));
    assert_eq!(task.step(), Step::GiveUp);
    late.handle_event(ZERO, status(Device::Robot, false));
    late.handle_event(ZERO, Event::Switch { high: false });
    assert_eq!(late.step(), Step::Release, "it has arrived");
}

#[test]
fn a_part_that_falls_while_the_robot_starts_is_lost_when_it_has_started() {
    let mut task = task_at(Step::GoPlace);
    assert_eq!(poll(&mut task, ZERO), [to(40)]);
    task.handle_event(ZERO, Event::Switch { high: false });
    assert_eq!(poll(&mut task, ZERO), []);
    task.handle_event(ZERO, Event::Done(Device::Robot));
    let gave_up = [Step::AwaitPlace, Step::GiveUp].map(Output::Entered);
    assert_eq!(poll(&mut task, ZERO), [&gave_up[..], &[STOP, grip(VACUUM, false)]].concat());
}

#[test]
fn a_moving_device_is_asked_at_intervals_and_a_standing_one_no_more() {
    let mut task = task_at(Step::AwaitCamera2);
    assert_eq!(poll(&mut task, ZERO), [ASK_ROBOT, ASK_PLATFORM]);
    assert_eq!(task.poll_timeout(), None, "both answers are awaited");
    task.handle_event(MS, status(Device::Robot, true));
    assert_eq!(task.poll_timeout(), Some(21 * MS));
    task.handle_event(2 * MS, status(Device::Platform, false));
    assert_eq!(poll(&mut task, 20 * MS), []);
    assert_eq!(poll(&mut task, 21 * MS), [ASK_ROBOT]);
    task.handle_event(22 * MS, status(Device::Robot, false));
    assert_eq!(poll(&mut task, 22 * MS)[0], Output::Entered(Step::FindSlot));
}

/// §6 step 21: "attiva per pochi millisecondi il soffio"
#[test]
fn the_blow_takes_its_time() {
    let mut task = task_at(Step::Release);
    assert_eq!(poll(&mut task, ZERO), [grip(VACUUM, false)]);
    task.handle_event(ZERO, Event::Done(Device::Gripper));
    assert_eq!(poll(&mut task, ZERO), [grip(BLOW, true)]);
    task.handle_event(MS, Event::Done(Device::Gripper));
    assert_eq!(task.poll_timeout(), Some(6 * MS));
    task.handle_timeout(5 * MS);
    assert_eq!(poll(&mut task, 5 * MS), [Output::Entered(Step::Blow)]);
    task.handle_timeout(6 * MS);
    assert_eq!(poll(&mut task, 6 * MS), [Output::Entered(Step::BlowOff), grip(BLOW, false)]);
}

#[test]
fn where_no_camera_needs_room_the_robot_stays() {
    let mut task = Task::new(Config { camera_1: None, camera_2: None, ..CONFIG });
    ready(&mut task, ZERO);
    let outputs = run_to(&mut task, Step::GoPick);
    let moves: Vec<_> = outputs.iter().filter(|o| matches!(o, Output::Robot(Command::Move { .. }))).collect();
    assert_eq!(moves, [&to(1)]);
    let steps = entered(&outputs);
    assert!(steps.contains(&Step::GoCamera1) && steps.contains(&Step::GoCamera2));
}

#[test]
fn after_a_part_comes_the_next_one_or_the_end() {
    let mut task = task_at(Step::Placed);
    assert_eq!(poll(&mut task, ZERO), []);
    let mut end = task.clone();
    task.handle_event(ZERO, Event::Next);
    assert_eq!(poll(&mut task, ZERO), [Output::Entered(Step::GoCamera1), to(10)]);
    end.handle_event(ZERO, Event::Finish);
    let close = [Output::Robot(Command::Close), Output::Platform(Command::Close)];
    let close = [&close[..], &[Output::Conditioning(Command::Close)]].concat();
    assert_eq!(poll(&mut end, ZERO), [&[Output::Entered(Step::Closing)], &close[..]].concat());
    end.handle_event(ZERO, Event::Done(Device::Robot));
    end.handle_event(ZERO, Event::Failed { device: Device::Platform, failure: Failure::Lost });
    assert_eq!(end.step(), Step::Closing);
    end.handle_event(ZERO, Event::Done(Device::Conditioning));
    assert_eq!(poll(&mut end, ZERO), [Output::Entered(Step::Finished)]);
    let mut early = Task::new(CONFIG);
    ready(&mut early, ZERO);
    early.handle_event(ZERO, Event::Finish);
    early.handle_event(ZERO, Event::Next);
    run_to(&mut early, Step::FindPart);
    poll(&mut early, ZERO);
    early.handle_event(ZERO, Event::NotFound);
    assert_eq!(early.step(), Step::GoCamera1, "the last one told counts, as soon as it can be followed");
}

#[test]
fn a_camera_that_sees_nothing_waits_to_be_told() {
    for step in [Step::FindPart, Step::FindSlot] {
        let mut task = task_at(step);
        task.handle_event(ZERO, Event::NotFound);
        assert_eq!(task.step(), step, "nobody has asked yet");
        poll(&mut task, ZERO);
        task.handle_event(ZERO, Event::NotFound);
        assert_eq!(poll(&mut task, ZERO), [Output::Entered(Step::NothingFound)]);
        task.handle_event(ZERO, Event::Next);
        assert_eq!(task.step(), Step::GoCamera1);
    }
}

#[test]
fn what_was_not_asked_for_means_nothing() {
    let mut task = task_at(Step::ServosOn);
    for event in [Event::Done(Device::Robot), Event::Done(Device::Platform), PART, SLOT] {
        task.handle_event(ZERO, event);
        assert_eq!(task.step(), Step::ServosOn);
    }
    assert_eq!(poll(&mut task, ZERO), servo());
    let mut task = task_at(Step::FindPart);
    poll(&mut task, ZERO);
    task.handle_event(ZERO, SLOT);
    assert_eq!(task.step(), Step::FindPart, "that is camera 2's");
}

/// Wherever something fails, everything stops, the valves close, and only a reset leads on.
#[test]
fn a_failure_stops_the_cell_from_every_step_and_a_reset_leads_back() {
    let failures = [Failure::Refused(ErrorCode::Generic), Failure::Error(ErrorCode::Servo2), Failure::Lost];
    let immune = [Step::AwaitDevices, Step::Faulted, Step::Closing, Step::Finished];
    let reachable = Step::ALL.into_iter().filter(|step| !immune.contains(step));
    let reachable =
        reachable.filter(|s| !matches!(s, Step::DevicesReady | Step::NothingFound | Step::Resetting));
    for (step, failure) in reachable.flat_map(|step| failures.map(|failure| (step, failure))) {
        let device = Device::Platform;
        let mut task = task_at(step);
        if task.step() != step {
            continue; // passed through at once
        }
        task.handle_event(ZERO, Event::Failed { device, failure });
        assert_eq!(task.failure(), Some((device, failure)));
        let mut orders = poll(&mut task, ZERO);
        assert_eq!(orders.remove(0), Output::Entered(Step::Faulted), "{step:?}");
        // Each order may have to wait for the answer to the last one.
        for device in [Device::Robot, Device::Platform, Device::Gripper] {
            task.handle_event(ZERO, Event::Done(device));
            orders.extend(poll(&mut task, ZERO));
        }
        let mut expected = vec![STOP, grip(VACUUM, false), grip(BLOW, false)];
        if failure != Failure::Lost {
            expected.insert(1, Output::Platform(Command::Stop));
        }
        assert_eq!(orders, expected, "{step:?}");
        for device in [Device::Robot, Device::Platform, Device::Gripper] {
            task.handle_event(ZERO, Event::Done(device));
        }
        task.handle_event(ZERO, Event::Recover);
        if failure == Failure::Lost {
            assert_eq!(task.step(), Step::Faulted, "the platform is not there");
            task.handle_event(ZERO, Event::Ready(Device::Platform));
        }
        let outputs = run_to(&mut task, Step::ServosOn);
        let reset = [Output::Robot(Command::Reset), Output::Platform(Command::Reset)];
        let closed = [grip(VACUUM, false), grip(BLOW, false)];
        for expected in reset.iter().chain(&closed) {
            assert!(outputs.contains(expected), "{step:?}: {outputs:?}");
        }
    }
}

#[test]
fn the_events_of_a_connection_are_translated() {
    let from = |event| Event::from_controller(Device::Robot, &event);
    let status = |error, moving| Status { moving, pose: robot(0), servo: true, percent: 1, error };
    let done = controller::Event::Done { command: Command::Stop };
    assert_eq!(from(done), Some(Event::Done(Device::Robot)));
    let refused = controller::Event::Refused { command: Command::Stop, error: ErrorCode::Servo1 };
    let failed = |failure| Some(Event::Failed { device: Device::Robot, failure });
    assert_eq!(from(refused), failed(Failure::Refused(ErrorCode::Servo1)));
    for (motion, moving) in
        [(Motion::Still, false), (Motion::Starting, true), (Motion::Moving, true), (Motion::Stopping, true)]
    {
        let event = controller::Event::Status { status: status(ErrorCode::None, false), motion };
        assert_eq!(from(event), Some(Event::Status { device: Device::Robot, moving }));
    }
    let event = controller::Event::Status { status: status(ErrorCode::Servo2, false), motion: Motion::Still };
    assert_eq!(from(event), failed(Failure::Error(ErrorCode::Servo2)));
    let closed = |reason| from(controller::Event::Closed { reason, unknown: None });
    assert_eq!(closed(controller::Closing::Timeout), failed(Failure::Lost));
    assert_eq!(closed(controller::Closing::Agreed), None);
}

fn device() -> impl Strategy<Value = Device> {
    use Device::{Conditioning, Gripper, Platform, Robot, Vision};
    prop::sample::select(vec![Robot, Platform, Conditioning, Vision, Gripper])
}

fn event() -> impl Strategy<Value = Option<Event>> {
    let failures = prop::sample::select(vec![Failure::Refused(ErrorCode::Generic), Failure::Lost]);
    prop_oneof![
        8 => Just(None), // the answer that is due
        2 => any::<bool>().prop_map(|high| Some(Event::Switch { high })),
        2 => device().prop_map(|device| Some(Event::Ready(device))),
        1 => device().prop_map(|device| Some(Event::Done(device))),
        1 => (device(), any::<bool>()).prop_map(|(device, moving)| Some(Event::Status { device, moving })),
        1 => (device(), failures).prop_map(|(device, failure)| Some(Event::Failed { device, failure })),
        1 => prop::sample::select(vec![PART, SLOT, Event::NotFound, Event::Next, Event::Finish, Event::Recover])
            .prop_map(Some),
    ]
}

fn of(output: Output) -> Option<Device> {
    Some(match output {
        Output::Robot(_) => Device::Robot,
        Output::Platform(_) => Device::Platform,
        Output::Conditioning(_) => Device::Conditioning,
        Output::Acquire { .. } => Device::Vision,
        Output::Grip { .. } => Device::Gripper,
        _ => return None,
    })
}

proptest! {
    /// Whatever happens in whatever order: every step follows from the one before by the table, no device has two orders at a
    /// time, no motion is ordered before the last one is known to have ended, and the vacuum is off before a new attempt.
    #[test]
    fn whatever_happens_the_rules_hold(events in prop::collection::vec(event(), 1..300)) {
        let mut task = Task::new(CONFIG);
        let mut step = None;
        let mut vacuum = false;
        let mut outstanding: Vec<(Device, Output)> = Vec::new();
        let mut now = ZERO;
        for event in events {
            for output in poll(&mut task, now) {
                if let Output::Entered(entered) = output {
                    let legal = step.is_none_or(|step: Step| step.transitions().iter().any(|(_, to)| *to == entered));
                    prop_assert!(legal, "{:?} -> {:?}", step, entered);
                    step = Some(entered);
                    let new_attempt = matches!(entered, Step::GoCamera1 | Step::Placed | Step::ServosOn);
                    prop_assert!(!(new_attempt && vacuum), "{:?} with the vacuum on", entered);
                } else if let Some(device) = of(output) {
                    prop_assert!(outstanding.iter().all(|(busy, _)| *busy != device), "{:?} behind {:?}", output, outstanding);
                    outstanding.push((device, output));
                    if let Output::Grip { gripper: VACUUM, open } = output {
                        vacuum = open;
                    }
                }
            }
            prop_assert_eq!(step, Some(task.step()));
            now += MS;
            match event {
                Some(event) => {
                    match event {
                        Event::Done(device) | Event::Status { device, .. } | Event::Failed { device, .. } => {
                            outstanding.retain(|(busy, _)| *busy != device);
                        }
                        Event::PartFound { .. } | Event::SlotFound { .. } | Event::NotFound => {
                            outstanding.retain(|(busy, _)| *busy != Device::Vision);
                        }
                        _ => {}
                    }
                    task.handle_event(now, event);
                }
                None if outstanding.is_empty() => {
                    now = task.poll_timeout().unwrap_or(now).max(now);
                    task.handle_timeout(now);
                }
                None => {
                    let (_, output) = outstanding.remove(0);
                    let event = answer(output, &task).unwrap();
                    task.handle_event(now, event);
                }
            }
        }
    }
}

/// `docs/task.md` is what the table gives.
#[test]
fn the_diagram_is_drawn_from_the_table() {
    let fails = |step: &Step| step.next(Trigger::Failed) == Some(Step::Faulted);
    let name = |step: &Step| match step.number() {
        Some(number) => format!("{number} {}", step.label()),
        None => step.label().into(),
    };
    let mut text = String::from(
        "# The pick-and-place task\n\n\
         Drawn from the table in `src/task/step.rs`; a test compares the two. The numbers are the steps of the source, section 6.\n\n\
         ```mermaid\nstateDiagram-v2\n    [*] --> AwaitDevices\n",
    );
    for step in Step::ALL.iter().filter(|step| !fails(step)) {
        writeln!(text, "    {step:?}: {}", name(step)).unwrap();
    }
    text.push_str("    state Running {\n");
    for step in Step::ALL.iter().filter(|step| fails(step)) {
        writeln!(text, "        {step:?}: {}", name(step)).unwrap();
    }
    let edges =
        Step::ALL.iter().flat_map(|from| from.transitions().iter().map(move |(on, to)| (from, on, to)));
    let (inner, outer): (Vec<_>, Vec<_>) = edges
        .filter(|(from, on, _)| !(fails(from) && **on == Trigger::Failed))
        .partition(|(from, _, to)| fails(from) && fails(to));
    for (from, on, to) in inner {
        writeln!(text, "        {from:?} --> {to:?}: {}", on.label()).unwrap();
    }
    text.push_str("    }\n    Running --> Faulted: a device failed\n");
    for (from, on, to) in outer {
        writeln!(text, "    {from:?} --> {to:?}: {}", on.label()).unwrap();
    }
    text.push_str("    Finished --> [*]\n```\n");
    assert_eq!(text, include_str!("../docs/task.md"), "\n{text}");
}
