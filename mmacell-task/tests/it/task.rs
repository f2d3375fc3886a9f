//! The task of §6: each way through it, and its diagram.

use core::fmt::Write;
use std::collections::HashSet;

use crate::common::*;
use mmacell_proto::{BLOW, Command, Progress, VACUUM};
use mmacell_task::{Device, Event, Failure, Fault, Output, Step, Task, TaskConfig, Trigger};

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
        &[Output::Entered(Step::PlaceDwell)],
        &[Output::Entered(Step::Release), grip(VACUUM, false), grip(BLOW, true)],
        &[Output::Entered(Step::Blow)],
        &[Output::Entered(Step::BlowOff), grip(BLOW, false)],
        &[Output::Entered(Step::CheckReleased)],
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
        Output::Entered(Step::GripDwell),
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
    assert_eq!(task.poll_timeout(), Some(CONFIG.motion_timeout), "both answers are awaited");
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
fn the_switch_of_the_last_part_means_nothing_for_the_next_one() {
    let mut task = task_at(Step::GoCamera1);
    for _ in 0..2 {
        run_to(&mut task, Step::AwaitPick);
        task.handle_event(ZERO, Event::Switch { high: false });
        assert_eq!(task.step(), Step::AwaitPick, "it was low: it has not risen");
        task.handle_event(ZERO, Event::Switch { high: true });
        run_to(&mut task, Step::AwaitPlace);
        task.handle_event(ZERO, Event::Switch { high: true });
        assert_eq!(task.step(), Step::AwaitPlace, "it was high: it has not fallen");
        run_to(&mut task, Step::Placed);
        task.handle_event(ZERO, Event::Next);
    }
}

#[test]
fn a_device_that_was_stopped_or_reset_may_be_at_rest_anywhere() {
    let mut task = task_at(Step::StopAtPart);
    assert_eq!(poll(&mut task, ZERO), [STOP]);
    task.handle_event(ZERO, Event::Done(Device::Robot));
    assert_eq!(poll(&mut task, ZERO), [ASK_ROBOT]);
    task.handle_event(ZERO, progress(Device::Robot, Progress::Still));
    assert_eq!(task.step(), Step::GoPlace);
    let mut task = task_at(Step::AwaitHome);
    task.handle_event(ZERO, Event::Abort);
    task.handle_event(ZERO, Event::Recover);
    assert!(poll(&mut task, ZERO).contains(&Output::Platform(Command::Reset)));
    task.handle_event(ZERO, Event::Done(Device::Platform));
    assert!(poll(&mut task, ZERO).contains(&ASK_PLATFORM));
    task.handle_event(ZERO, progress(Device::Platform, Progress::Still));
    assert_eq!((task.step(), task.fault()), (Step::Resetting, Some(Fault::Aborted)));
}

#[test]
fn where_no_camera_needs_room_the_robot_stays() {
    let mut task = Task::new(TaskConfig { camera_1: None, camera_2: None, ..CONFIG });
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
    assert_eq!(early.step(), Step::GoCamera1, "the last one reported counts, as soon as it can be followed");
}

#[test]
fn of_steps_that_nobody_polls_the_newest_eight_are_kept() {
    let mut task = Task::new(CONFIG);
    ready(&mut task, ZERO);
    let mut steps = Vec::new();
    for round in 0..9 {
        let failure = Failure::Lost;
        task.handle_event(
            ZERO,
            match round % 2 {
                0 => Event::Failed { device: Device::Vision, failure },
                _ => Event::Recover,
            },
        );
        steps.push(task.step());
    }
    assert_eq!(entered(&poll(&mut task, ZERO)), steps[steps.len() - 8..]);
}

/// `docs/task.md` is made from the table.
#[test]
fn the_diagram_is_drawn_from_the_table() {
    let fails = |step: &Step| step.next(Trigger::Failed) == Some(Step::Faulted);
    let name = |step: &Step| match step.number() {
        Some(number) => format!("{number} {}", step.label()),
        None => step.label().into(),
    };
    let mut text = String::from(
        "# The pick-and-place task\n\n\
         Drawn from the table in `src/step.rs`; a test compares the two. The numbers are the steps of the source, section 6.\n\n\
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
        .filter(|(from, on, to)| {
            let fault = matches!(on, Trigger::Failed | Trigger::TimedOut) && **to == Step::Faulted;
            !(fails(from) && fault)
        })
        .partition(|(from, _, to)| fails(from) && fails(to));
    for (from, on, to) in inner {
        writeln!(text, "        {from:?} --> {to:?}: {}", on.label()).unwrap();
    }
    text.push_str("    }\n    Running --> Faulted: failed, aborted or too long\n");
    for (from, on, to) in outer {
        writeln!(text, "    {from:?} --> {to:?}: {}", on.label()).unwrap();
    }
    text.push_str("    Finished --> [*]\n```\n");
    if std::env::var_os("WRITE_DIAGRAM").is_some() {
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/task.md"), &text).unwrap();
    }
    assert_eq!(text, include_str!("../../docs/task.md"), "\n{text}");
}
